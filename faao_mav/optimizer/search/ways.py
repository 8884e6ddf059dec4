"""Starts inside a fence: the shortest ways round, to the end or by the stations, flown."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.mission.fence_area import FreeArea
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.search.starts import straight_flight, with_stops
from faao_mav.optimizer.search.track import ALLOWED, nearest_flight

_ROOM = (2.0, 0.5, 0.0)
"""Room that ways leave beside the margin where they can, m: a start inside the limits. Chosen."""

_MOST_OTHERS = 4
"""Most obstacles that are passed on their other side, one at a time. Chosen."""

_SHARES = (1.0, 0.75, 0.5, 0.25, 0.1)
"""Shares of the way to a station that are tried. Chosen."""


def starts_inside(
    kin: Kinematics,
    names: Sequence[str],
    stations: Mapping[str, Real],
    area: FreeArea,
    constraints: Sequence[Constraint],
) -> dict[str, Trajectory]:
    """Return flights inside `area` by the names of the plan's `optimizer.starts`.

    They go the shortest ways, and as far towards the stations as time and fence allow; of the way
    to the end there are also those that pass an obstacle on its other side, `straight 2` and on.
    Those of which no feasible flight is found are left out.

    Raises:
        InfeasibleError: no flight is found.
    """
    found: dict[str, Trajectory] = {}
    direct = shortest_by(area, [kin.start, kin.end])
    if direct is not None:
        for name in names:
            ways: Iterator[Real]
            if name == "straight":
                ways = iter([direct, *_on_other_sides(area, direct)])
            else:
                ways = _by_way_of(area, kin, direct, [stations[key] for key in name.split("-")])
            stops = name != "straight"
            for flight in _flown(kin, ways, constraints, first=stops):
                number = sum(other.split(" ")[0] == name for other in found) + 1
                found[name if number == 1 else f"{name} {number}"] = flight
    if not found and direct is not None:
        found.update(("straight", flight) for flight in _flown(kin, iter([direct]), constraints))
    if not found:
        raise InfeasibleError(
            "no flight was found that stays inside the fence with its margin, keeps "
            f"{kin.max_speed:g} m/s and {kin.max_acceleration:g} m/s^2, and ends in time; give "
            "more flight.duration, a smaller fence.margin or another start or end"
        )
    return found


def shortest_by(area: FreeArea, points: Sequence[Real]) -> Real | None:
    """Return the corners (k, 2) of the shortest way through `points`; None if there is none."""
    corners = [points[0][None]]
    for a, b in pairwise(points):
        ways = (
            area.inside(room).shortest_way(a, b) if room else area.shortest_way(a, b)
            for room in _ROOM
        )
        way = next((way for way in ways if way is not None), None)
        if way is None:
            return None
        corners.append(way[1:])
    return np.concatenate(corners)


def _length(way: Real) -> float:
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def _on_other_sides(area: FreeArea, way: Real) -> list[Real]:
    """Return the ways that pass one of the obstacles that `way` turns round on its other side."""
    import shapely

    others: list[Real] = []
    holes = area.holes
    left = set(range(len(holes)))
    for before, corner, after in zip(way[:-2], way[1:-1], way[2:], strict=True):
        away = shapely.distance(holes, shapely.Point(corner)) if left else np.full(1, np.inf)
        hole = int(np.argmin(away))
        if hole not in left or away[hole] > 2 * max(_ROOM):
            continue
        left.remove(hole)
        inward = sum((each - corner) / np.hypot(*(each - corner)) for each in (before, after))
        blocked = area.barred(corner, -inward / np.hypot(*inward))
        other = None if blocked is None else shortest_by(blocked, [way[0], way[-1]])
        if other is not None:
            others.append(other)
        if len(others) == _MOST_OTHERS:
            break
    return others


def _by_way_of(
    area: FreeArea, kin: Kinematics, direct: Real, stations: Sequence[Real]
) -> Iterator[Real]:
    """Yield ways towards the `stations`, the farthest first."""
    import shapely

    line = shapely.LineString(direct)
    spurs = []
    for station in stations:
        stop = area.nearest(station, kin.start)
        anchor = shapely.get_coordinates(line.interpolate(line.project(shapely.Point(stop))))[0]
        spur = shortest_by(area, [anchor, stop])
        if spur is None:
            return
        spurs.append(shapely.LineString(spur))
    for share in _SHARES:
        stops = [
            shapely.get_coordinates(spur.interpolate(share, normalized=True))[0] for spur in spurs
        ]
        way = shortest_by(area, [kin.start, *stops, kin.end])
        if way is not None and _length(way) <= kin.max_speed * kin.time_step * (kin.slots - 1):
            yield way


def _flown(
    kin: Kinematics, ways: Iterator[Real], constraints: Sequence[Constraint], *, first: bool = False
) -> Iterator[Trajectory]:
    """Yield feasible flights along `ways`, with `first` that of the first way that has one."""
    for way in ways:
        flight = along(kin, way, constraints)
        if flight is not None:
            yield flight
            if first:
                return


def along(kin: Kinematics, way: Real, constraints: Sequence[Constraint]) -> Trajectory | None:
    """Return a flight that stops at the corners of `way`, else one that tracks it, or None."""
    if kin.min_speed == 0:
        flight = with_stops(kin, list(way[1:-1]))
        if flight is not None and all(each.excess(kin, flight) <= ALLOWED for each in constraints):
            return flight
    steps = np.hypot(*np.diff(way, axis=0).T)
    gone = np.append(0, np.cumsum(steps))
    at = np.linspace(0, gone[-1], kin.slots)
    path = np.stack([np.interp(at, gone, each) for each in way.T], axis=1)
    return nearest_flight(kin, path, straight_flight(kin), constraints)
