"""The fence: legs and predicted flight, not only points, and how near they come."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from faao_mav.mission.fence_area import Area
from faao_mav.validate.context import ValidationContext, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME

RULES = Rules()

LEAST_MARGIN = 2.0
"""The distance to the fence, m, below which the error of the aircraft's position counts. Chosen;
what a change costs is not measured."""

_GEOMETRY = "plane geometry about home; ArduPilot AC_Fence, PX4 Geofence"


def _what(part: Area | None) -> str:
    if part is None:
        return "outside all inclusions"
    return f"{'outside' if part.inclusion else 'inside'} {part.name}"


@RULES.error("fence-crosses-itself", "a fence polygon crosses itself", _GEOMETRY)
def _crosses(context: ValidationContext) -> Iterator[Issue]:
    for area in context.fence.areas if context.fence else ():
        if area.crosses_itself:
            yield Issue(
                None,
                f"{area.name} crosses or touches itself: what counts as inside is not what you see",
                "put its corners in order around the area",
            )


@RULES.error("fence-home", "home lies outside the fence", _GEOMETRY)
def _home(context: ValidationContext) -> Iterator[Issue]:
    if context.home is not None:
        for issue in _points(context, [("home", (0.0, 0.0))], "move home or the fence"):
            then = context.vehicle.type.home_outside_fence
            yield replace(issue, message="; ".join(filter(None, (issue.message, then))))


@RULES.error("fence-rally", "a rally point lies outside the fence", _GEOMETRY)
def _rally(context: ValidationContext) -> Iterator[Issue]:
    if context.fence is not None:
        points = [
            (f"rally point {n}", context.fence.frame.to_local(point.latitude, point.longitude))
            for n, point in enumerate(context.mission.rally, start=1)
        ]
        yield from _points(context, points, "move the rally point or the fence")


@RULES.error("fence-return", "the breach return point lies outside the fence", _GEOMETRY)
def _return(context: ValidationContext) -> Iterator[Issue]:
    point = context.mission.fence.breach_return
    if context.fence is not None and point is not None:
        local = context.fence.frame.to_local(point.latitude, point.longitude)
        yield from _points(context, [("the breach return point", local)], "move it inside")


def _points(
    context: ValidationContext, points: list[tuple[str, Any]], action: str
) -> Iterator[Issue]:
    if context.fence is None or not points:
        return
    import shapely

    broken = context.fence.broken(shapely.points([place for _, place in points]))
    for k in np.flatnonzero(broken.any).tolist():
        yield Issue(None, f"{points[k][0]} is {' and '.join(map(_what, broken.parts(k)))}", action)


@RULES.error("fence-leg", "a leg leaves the fence", _GEOMETRY)
def _legs(context: ValidationContext) -> Iterator[Issue]:
    fence = context.fence
    if fence is None or not context.legs:
        return
    import shapely

    for k in np.flatnonzero(fence.broken_legs.any).tolist():
        leg = context.legs[k]
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


@RULES.error("fence-flight", "the predicted flight leaves the fence", _GEOMETRY)
def _flight(context: ValidationContext) -> Iterator[Issue]:
    fence, track = context.fence, context.track
    if fence is None or track is None or not len(fence.flight):
        return
    told = set()
    if context.legs:
        told = {context.legs[k].index for k in np.flatnonzero(fence.broken_legs.any)}
    broken = fence.broken_flight
    for index in sorted(set(fence.flight_items[broken.any].tolist()) - told):
        first = int(np.flatnonzero(broken.any & (fence.flight_items == index))[0])
        yield Issue(
            index,
            f"the predicted flight gets {' and '.join(map(_what, broken.parts(first)))}, first at "
            f"{track.t[first]:.0f} s",
            "fly slower there or keep more room, or change the fence",
        )


@RULES.warning("fence-close", f"less than {LEAST_MARGIN:g} m from the fence", _GEOMETRY)
def _close(context: ValidationContext) -> Iterator[Issue]:
    nearest = context.fence.nearest if context.fence else None
    if nearest is not None and nearest[0] < LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence; less than {LEAST_MARGIN:g} m is "
            "within the error of the aircraft's position",
            "keep more room",
        )


@RULES.note("fence-margin", "how near the mission comes to the fence", _GEOMETRY)
def _margin(context: ValidationContext) -> Iterator[Issue]:
    nearest = context.fence.nearest if context.fence else None
    if nearest is not None and nearest[0] >= LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence, the nearest that the mission comes",
            "nothing",
        )
