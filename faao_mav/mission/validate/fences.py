"""The fence: legs and predicted flight, not only points, and how near they come."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.validate import parameters
from faao_mav.mission.validate.area import Area, areas_of, free_area, lines
from faao_mav.mission.validate.case import HOME, Case, Leg, number
from faao_mav.mission.validate.finding import Level
from faao_mav.mission.validate.rule import Issue, Rules

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

RULES = Rules()

LEAST_MARGIN = 2.0
"""Nearer to the fence than this, m, the aircraft's own position error counts."""

_GEOMETRY = "plane geometry about home; ArduPilot AC_Fence, PX4 Geofence"
_UNION_OPTION = 2  # bit of FENCE_OPTIONS


@dataclass(frozen=True, slots=True)
class _Map:
    """The fence of a case: its parts, where the inclusions let the aircraft be, and the frame."""

    frame: LocalFrame
    areas: tuple[Area, ...]
    free: "BaseGeometry | None"
    any_inclusion: bool

    def broken_by(self, paths: Any) -> tuple[NDArray[np.bool_], list[tuple[Area | None, Any]]]:
        """Say which of `paths` (n,) leave the fence, (n,), and by which of its parts.

        A part of None stands for several inclusions of which one would be enough.
        """
        import shapely

        reasons: list[tuple[Area | None, Any]] = []
        inclusions = [area for area in self.areas if area.inclusion]
        if self.any_inclusion and len(inclusions) > 1:
            reasons.append((None, ~shapely.covers(self.free, paths)))
        else:
            reasons += [(area, ~shapely.covers(area.shape, paths)) for area in inclusions]
        for area in self.areas:
            if not area.inclusion:
                inside = shapely.intersects(area.shape, paths) & ~shapely.touches(area.shape, paths)
                reasons.append((area, inside))
        broken = np.zeros(len(paths), dtype=bool)
        for _, by in reasons:
            broken |= by
        return broken, reasons

    def margins(self, paths: Any) -> Real:
        """Return how far each of `paths` (n,), inside the fence, stays from its edge, m; (n,)."""
        import shapely

        margin = np.full(len(paths), np.inf)
        if self.free is not None and not self.free.is_empty:
            margin = np.minimum(margin, shapely.distance(self.free.boundary, paths))
        for area in self.areas:
            if not area.inclusion:
                margin = np.minimum(margin, shapely.distance(area.shape, paths))
        return margin


def _map(case: Case) -> _Map | None:
    fence = case.mission.fence
    if not fence:
        return None
    frame = case.frame or LocalFrame(*_first_vertex(fence))
    areas = areas_of(fence, frame)
    any_inclusion = case.vehicle.autopilot == "px4" or bool(
        int(parameters.FENCE_OPTIONS.of(case.vehicle)) & _UNION_OPTION
    )
    return _Map(frame, areas, free_area(areas, any_inclusion=any_inclusion), any_inclusion)


def _first_vertex(fence: Fence) -> tuple[float, float]:
    return fence.polygons[0].vertices[0] if fence.polygons else fence.circles[0].center


def _what(part: Area | None) -> str:
    if part is None:
        return "outside all inclusions"
    return f"{'outside' if part.inclusion else 'inside'} {part.name}"


@RULES.add("fence-crosses-itself", Level.ERROR, "a fence polygon crosses itself", _GEOMETRY)
def _crosses(case: Case) -> Iterator[Issue]:
    fence = _map(case)
    for area in fence.areas if fence else ():
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
    fence = _map(case)
    if fence is not None:
        points = [
            (f"rally point {n}", fence.frame.to_local(point.latitude, point.longitude))
            for n, point in enumerate(case.mission.rally, start=1)
        ]
        yield from _points(case, points, "move the rally point or the fence")


@RULES.add("fence-return", Level.ERROR, "the breach return point lies outside the fence", _GEOMETRY)
def _return(case: Case) -> Iterator[Issue]:
    fence, point = _map(case), case.mission.fence.breach_return
    if fence is not None and point is not None:
        local = fence.frame.to_local(point.latitude, point.longitude)
        yield from _points(case, [("the breach return point", local)], "move it inside")


def _points(case: Case, points: list[tuple[str, Any]], action: str) -> Iterator[Issue]:
    import shapely

    fence = _map(case)
    if fence is None or not points:
        return
    _, reasons = fence.broken_by(shapely.points([place for _, place in points]))
    for k, (name, _) in enumerate(points):
        parts = [_what(part) for part, by in reasons if by[k]]
        if parts:
            yield Issue(None, f"{name} is {' and '.join(parts)}", action)


def _leg_lines(legs: list[Leg]) -> Any:
    starts = np.array([[leg.start.east, leg.start.north] for leg in legs]).reshape(-1, 2)
    ends = np.array([[leg.end.east, leg.end.north] for leg in legs]).reshape(-1, 2)
    return lines(starts, ends)


@RULES.add("fence-leg", Level.ERROR, "a leg leaves the fence", _GEOMETRY)
def _legs(case: Case) -> Iterator[Issue]:
    import shapely

    fence = _map(case)
    if fence is None or not case.legs:
        return
    paths = _leg_lines(list(case.legs))
    broken, reasons = fence.broken_by(paths)
    for k in np.flatnonzero(broken):
        leg = case.legs[k]
        start = "home" if leg.start.index == HOME else f"item {number(leg.start.index)}"
        parts = []
        for part, by in reasons:
            if by[k]:
                shape = fence.free if part is None else part.shape
                inside = shapely.intersection(shape, paths[k]).length
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
    fence, found = _map(case), _track_lines(case)
    if fence is None or found is None:
        return
    paths, item = found
    if case.legs:
        broken, _ = fence.broken_by(_leg_lines(list(case.legs)))
        told = {leg.index for leg, out in zip(case.legs, broken, strict=True) if out}
    else:
        told = set()
    broken, reasons = fence.broken_by(paths)
    assert case.track is not None
    for index in sorted({int(k) for k in item[broken]} - told):
        first = int(np.flatnonzero(broken & (item == index))[0])
        parts = [_what(part) for part, by in reasons if by[first]]
        yield Issue(
            index,
            f"the predicted flight gets {' and '.join(parts)}, first at "
            f"{case.track.t[first]:.0f} s",
            "fly slower there or keep more room, or change the fence",
        )


def _track_lines(case: Case) -> tuple[Any, NDArray[np.int_]] | None:
    positions = case.track_positions
    if positions is None or case.track is None or len(positions) < 2:
        return None
    ground = positions[:, :2]
    return lines(ground[:-1], ground[1:]), case.track.item[1:]


def _nearest(case: Case) -> tuple[float, int] | None:
    """Return the least margin of legs and flight, m, and its item; None if any leaves the fence."""
    fence = _map(case)
    if fence is None or not case.legs:
        return None
    paths = _leg_lines(list(case.legs))
    items = np.array([leg.index for leg in case.legs])
    track = _track_lines(case)
    if track is not None:
        paths, items = np.concatenate([paths, track[0]]), np.concatenate([items, track[1]])
    if fence.broken_by(paths)[0].any():
        return None
    margins = fence.margins(paths)
    nearest = int(np.argmin(margins))
    return float(margins[nearest]), int(items[nearest])


@RULES.add("fence-close", Level.WARNING, f"less than {LEAST_MARGIN:g} m from the fence", _GEOMETRY)
def _close(case: Case) -> Iterator[Issue]:
    nearest = _nearest(case)
    if nearest is not None and nearest[0] < LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence; less than {LEAST_MARGIN:g} m is "
            "within the error of the aircraft's position",
            "keep more room",
        )


@RULES.add("fence-margin", Level.NOTE, "how near the mission comes to the fence", _GEOMETRY)
def _margin(case: Case) -> Iterator[Issue]:
    nearest = _nearest(case)
    if nearest is not None and np.isfinite(nearest[0]) and nearest[0] >= LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence, the nearest that the mission comes",
            "nothing",
        )
