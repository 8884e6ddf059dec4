"""The fence: legs and predicted flight, not only points, and how near they come."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from faao_mav.validate.area import Area
from faao_mav.validate.case import HOME, Case, number
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules

RULES = Rules()

LEAST_MARGIN = 2.0
"""Nearer to the fence than this, m, the aircraft's own position error counts."""

_GEOMETRY = "plane geometry about home; ArduPilot AC_Fence, PX4 Geofence"


def _what(part: Area | None) -> str:
    if part is None:
        return "outside all inclusions"
    return f"{'outside' if part.inclusion else 'inside'} {part.name}"


@RULES.add("fence-crosses-itself", Level.ERROR, "a fence polygon crosses itself", _GEOMETRY)
def _crosses(case: Case) -> Iterator[Issue]:
    for area in case.fence.areas if case.fence else ():
        if area.crosses_itself:
            yield Issue(
                None,
                f"{area.name} crosses or touches itself: what counts as inside is not what you see",
                "put its corners in order around the area",
            )


@RULES.add("fence-home", Level.ERROR, "home lies outside the fence", _GEOMETRY)
def _home(case: Case) -> Iterator[Issue]:
    if case.home is not None:
        yield from _points(case, [("home", (0.0, 0.0))], "move home or the fence")


@RULES.add("fence-rally", Level.ERROR, "a rally point lies outside the fence", _GEOMETRY)
def _rally(case: Case) -> Iterator[Issue]:
    if case.fence is not None:
        points = [
            (f"rally point {n}", case.fence.frame.to_local(point.latitude, point.longitude))
            for n, point in enumerate(case.mission.rally, start=1)
        ]
        yield from _points(case, points, "move the rally point or the fence")


@RULES.add("fence-return", Level.ERROR, "the breach return point lies outside the fence", _GEOMETRY)
def _return(case: Case) -> Iterator[Issue]:
    point = case.mission.fence.breach_return
    if case.fence is not None and point is not None:
        local = case.fence.frame.to_local(point.latitude, point.longitude)
        yield from _points(case, [("the breach return point", local)], "move it inside")


def _points(case: Case, points: list[tuple[str, Any]], action: str) -> Iterator[Issue]:
    if case.fence is None or not points:
        return
    import shapely

    broken = case.fence.broken(shapely.points([place for _, place in points]))
    for k in np.flatnonzero(broken.any).tolist():
        yield Issue(None, f"{points[k][0]} is {' and '.join(map(_what, broken.parts(k)))}", action)


@RULES.add("fence-leg", Level.ERROR, "a leg leaves the fence", _GEOMETRY)
def _legs(case: Case) -> Iterator[Issue]:
    fence = case.fence
    if fence is None or not case.legs:
        return
    import shapely

    for k in np.flatnonzero(fence.broken_legs.any).tolist():
        leg = case.legs[k]
        start = "home" if leg.start.index == HOME else f"item {number(leg.start.index)}"
        parts = []
        for part in fence.broken_legs.parts(k):
            shape = fence.free if part is None else part.shape
            inside = shapely.intersection(shape, fence.legs[k]).length
            length = inside if part is not None and not part.inclusion else leg.length - inside
            parts.append(f"{max(length, 0.0):.1f} m of it {_what(part)}")
        jump = " by DO_JUMP" if leg.jump else ""
        yield Issue(
            leg.index,
            f"the leg from {start}{jump} is {leg.length:.0f} m long, {' and '.join(parts)}",
            "go around with another waypoint, or change the fence",
        )


@RULES.add("fence-flight", Level.ERROR, "the predicted flight leaves the fence", _GEOMETRY)
def _flight(case: Case) -> Iterator[Issue]:
    fence, track = case.fence, case.track
    if fence is None or track is None or not len(fence.flight):
        return
    told = set()
    if case.legs:
        told = {case.legs[k].index for k in np.flatnonzero(fence.broken_legs.any)}
    broken = fence.broken_flight
    for index in sorted(set(fence.flight_items[broken.any].tolist()) - told):
        first = int(np.flatnonzero(broken.any & (fence.flight_items == index))[0])
        yield Issue(
            index,
            f"the predicted flight gets {' and '.join(map(_what, broken.parts(first)))}, first at "
            f"{track.t[first]:.0f} s",
            "fly slower there or keep more room, or change the fence",
        )


@RULES.add("fence-close", Level.WARNING, f"less than {LEAST_MARGIN:g} m from the fence", _GEOMETRY)
def _close(case: Case) -> Iterator[Issue]:
    nearest = case.fence.nearest if case.fence else None
    if nearest is not None and nearest[0] < LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence; less than {LEAST_MARGIN:g} m is "
            "within the error of the aircraft's position",
            "keep more room",
        )


@RULES.add("fence-margin", Level.NOTE, "how near the mission comes to the fence", _GEOMETRY)
def _margin(case: Case) -> Iterator[Issue]:
    nearest = case.fence.nearest if case.fence else None
    if nearest is not None and nearest[0] >= LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence, the nearest that the mission comes",
            "nothing",
        )
