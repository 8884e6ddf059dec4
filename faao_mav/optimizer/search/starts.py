"""The feasible flights that the search starts from: straight, and by way of the stations.

A start is a way, corner by corner, that is flown with a stop at each corner, or else by the flight
nearest to it. Inside a fence ways are the shortest ones. An aircraft that cannot hover circles at
the stations, and one that has to save energy on its way. All starts are improved roughly, which
tells the one to improve to the end; long flights on a coarse copy with fewer slots.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import cycle, islice, pairwise

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.mission.fence_area import FreeArea
from faao_mav.optimizer.interior.constraint import ALLOWED, Constraint, every_excess
from faao_mav.optimizer.interior.limits import EnergyLimit
from faao_mav.optimizer.interior.maximize import feasible, nearest_flight
from faao_mav.optimizer.interior.rewards import Stage, StageValues
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.straight import cruise_by, straight_flight, with_stops
from faao_mav.power import least_power

BY_STATIONS = ("straight", "bs", "user", "bs-user", "user-bs")
"""What `global` stands for; `bs` and `user` for planes, of which one lost 47 % without them, and
for R_avg (0.7 %). 133 plans for copters that deliver lost 1e-8, twelve with an energy 0.08 % at
most, in 0.6 of the time."""

_SHARES = (1.0, 0.75, 0.5, 0.25, 0.1)
"""Shares of the way to a station that are tried. Chosen."""

_ROOM = (2.0, 0.5, 0.0)
"""Room that ways leave beside the margin where they can, m: a start inside the limits. Chosen."""

_MOST_OTHERS = 4
"""Most obstacles that are passed on their other side, one at a time. Chosen."""

_PLACES = np.linspace(0, 1, 201)
"""Shares of a way at which it may be left for a station. Chosen."""

_TURN_SHARE = 0.7
"""Share of the largest acceleration that circles of a start take; the rest is for the way. Chosen.
"""

COARSE_SLOTS = 60
"""Slots of the coarse copy of flights of at least twice as many: enough for the shape of a route.
Chosen."""

ROUGH = 3e-3
"""The tolerance, bit/s/Hz, to which starts are improved before they are compared. Chosen."""


def starts(
    kin: Kinematics,
    names: Sequence[str],
    stations: Mapping[str, Real],
    area: FreeArea | None = None,
    fence: Sequence[Constraint] = (),
) -> dict[str, Trajectory]:
    """Return the flights named in the plan's `optimizer.starts`, inside `area` by the `fence`.

    A name is `straight` or the stations in the order of the visit, as in `bs-user`. A flight by way
    of stations goes as far towards them as time and fence allow, and hovers there for what time is
    left; with a least speed it circles there. Inside a fence there are also those that pass an
    obstacle of the straight way on its other side, `straight 2` and on. Flights that were not found
    are left out. If none is left, the result is the straight flight.

    `stations` are their positions (2,) by name, m; `area` is where the path may be, None for
    everywhere. Raises `InfeasibleError` where there is no straight flight, and it was asked for or
    is the only one.

    >>> from faao_mav.optimizer.kinematics import Kinematics
    >>> kin = Kinematics(np.zeros(2), np.array([60.0, 0.0]), 41, 0.5, 8.0, 2.0, None, None, True)
    >>> flights = starts(kin, ["straight", "user"], {"user": np.array([30.0, 20.0])})
    >>> [round(float(flight.w[:, 1].max()), 3) for flight in flights.values()]
    [0.0, 20.0]
    """
    found: dict[str, Trajectory] = {}
    direct = shortest_by(area, [kin.start, kin.end])
    for name in names:
        if direct is None:
            break
        if name == "straight":
            ways, most = iter([direct, *_on_other_sides(area, direct)]), None
        else:
            stops = [stations[key] for key in name.split("-")]
            ways, most = _by_way_of(area, kin, direct, stops), 1
        flights = (along(kin, way, fence) for way in ways)
        for number, flight in enumerate(islice(filter(None, flights), most), 1):
            found[name if number == 1 else f"{name} {number}"] = flight
    if not found and direct is not None:
        straight = along(kin, direct, fence)
        found = {} if straight is None else {"straight": straight}
    if not found:
        raise InfeasibleError(
            "no flight was found that stays inside the fence, or off ground, by the margin, keeps "
            f"{kin.max_speed:g} m/s and {kin.max_acceleration:g} m/s^2, and ends in time; give "
            "more flight.duration, a smaller margin or another start or end"
        )
    return found


def shortest_by(area: FreeArea | None, points: Sequence[Real]) -> Real | None:
    """Return the corners (k, 2) of the shortest way through `points`; None if there is none."""
    if area is None:
        return np.array(points)
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


def points_along(way: Real, shares: Real | float) -> Real:
    """Return the points (..., 2) at `shares` (...) of the length of `way` (k, 2)."""
    gone = np.append(0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
    return np.stack([np.interp(shares * gone[-1], gone, x) for x in way.T], axis=-1)


def _on_other_sides(area: FreeArea | None, way: Real) -> list[Real]:
    """Return the ways that pass one of the obstacles that `way` turns round on its other side."""
    others: list[Real] = []
    if area is None:
        return others
    import shapely

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
    return others[:_MOST_OTHERS]


def _by_way_of(
    area: FreeArea | None, kin: Kinematics, direct: Real, stations: Sequence[Real]
) -> Iterator[Real]:
    """Yield ways towards the `stations`, the farthest first."""
    spurs, places = [], points_along(direct, _PLACES)
    for station in stations:
        stop = station if area is None else area.nearest(station, kin.start)
        anchor = places[np.hypot(*(places - stop).T).argmin()]
        spur = shortest_by(area, [anchor, stop])
        if spur is None:
            return
        spurs.append(spur)
    farthest = kin.max_speed * kin.time_step * (kin.slots - 1)
    for share in _SHARES if kin.min_speed == 0 or area is not None else (1.0,):
        stops = [points_along(spur, share) for spur in spurs]
        way = shortest_by(area, [kin.start, *stops, kin.end])
        if way is not None and np.hypot(*np.diff(way, axis=0).T).sum() <= farthest:
            yield way


def along(kin: Kinematics, way: Real, fence: Sequence[Constraint]) -> Trajectory | None:
    """Return a flight that stops, or circles, at the corners of `way`, else one that tracks it.

    None where none is found that keeps the `fence`, or without one where there is no time to stop.
    """
    corners = list(way[1:-1])
    if not fence:
        return cruise_by(kin, corners) if kin.min_speed and corners else with_stops(kin, corners)
    if kin.min_speed == 0 or not corners:
        flight = with_stops(kin, corners)
        if flight is not None and every_excess(kin, fence, flight) <= ALLOWED:
            return flight
    path = points_along(way, np.linspace(0, 1, kin.slots))
    return nearest_flight(kin, path, straight_flight(kin), fence)


def sparing_starts(
    kin: Kinematics, routes: Mapping[str, Trajectory], kept: Sequence[Constraint]
) -> dict[str, Trajectory]:
    """Return flights near to `routes` that keep the energy limit among `kept`; some may be none.

    Rotors take the least power some way above hover. A hover is no start from which that is found:
    P is stationary at v = 0. So a route that takes too much is led round in circles of the speed of
    least power, one to the left and the next to the right: which is better depends on what is
    before and after.
    """
    (limit,) = (each for each in kept if isinstance(each, EnergyLimit))
    speed, _ = least_power(limit.model, kin.max_speed * _PLACES[1:])
    rate = _TURN_SHARE * kin.turning(speed) / speed
    found = {}
    for side, (name, route) in zip(cycle((1, -1)), routes.items(), strict=False):
        angle = side * rate * kin.time_step * np.arange(kin.slots)
        circled = route.w + speed / rate * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        spares = every_excess(kin, kept, route) <= ALLOWED
        flight = route if spares else nearest_flight(kin, circled, route, kept)
        if flight is not None:
            found[name] = flight
    return found


def block_stage(stage: Stage, fine: int, slots: int) -> Stage:
    """Return the rewards of `slots` positions, each standing for a block of the slots of `stage`.

    (1 / slots) sum_m F_m is the mean of `stage` over its `fine` slots with w_n = w_m(n), so that
    every draw of the fading counts.
    """
    block = np.rint(np.linspace(0, slots - 1, fine)).astype(int)
    first = np.searchsorted(block, np.arange(slots))

    def of_blocks(w: Real) -> StageValues:
        at = stage(w[..., block])
        parts = (at.value, at.gradient, at.hessian)
        return StageValues(*(np.add.reduceat(x, first, axis=-1) * slots / fine for x in parts))

    return of_blocks


def improve_starts(
    problem: Problem, stage: Stage, flights: Mapping[str, Trajectory], max_iterations: int
) -> dict[str, Trajectory]:
    """Return the feasible `flights` improved roughly by `stage`.

    Long flights are improved on a coarse copy, but for those with a least speed or an energy: it
    cannot make their circles.
    """
    kin = copy = problem.kinematics
    reward = stage
    if kin.slots >= 2 * COARSE_SLOTS and kin.min_speed == 0 and problem.energy == np.inf:
        # Where a(0) has no bound, v(0) does not limit v(1). The first slot of the copy stands for
        # several: on it v(0) is free and a(0) bounded.
        copy = replace(
            kin,
            slots=COARSE_SLOTS,
            time_step=kin.time_step * (kin.slots - 1) / (COARSE_SLOTS - 1),
            start_velocity=kin.start_velocity if kin.bound_first_acceleration else None,
            bound_first_acceleration=True,
        )
        reward = block_stage(stage, kin.slots, COARSE_SLOTS)
    improved, limits = {}, problem.constraints(kin)
    for name, flight in flights.items():
        start = flight if copy is kin else copy.follow(paced(copy, flight, kin.time_step))
        end = problem.improved(reward, start, ROUGH, max_iterations, kin=copy).trajectory
        if copy is not kin:
            end = feasible(kin, flight, paced(kin, end, copy.time_step), limits)
        improved[name] = end
    return improved


def paced(kin: Kinematics, flight: Trajectory, time_step: float) -> Real:
    """Return the velocities (slots, 2) at which the path of `flight` takes the time of `kin`.

    The slots of `flight` are of `time_step` s. The longer it takes the less speed and acceleration
    it needs. With velocities of the ends that are zero or free, and in calm air, the rates along it
    have nearly the same means.
    """
    faster = time_step * (len(flight.v) - 1) / (kin.time_step * (kin.slots - 1))
    share, at = np.linspace(0, 1, len(flight.v)), np.linspace(0, 1, kin.slots)
    velocities = faster * np.stack([np.interp(at, share, v) for v in flight.v.T], axis=1)
    for n, given in ((0, kin.start_velocity), (-1, kin.end_velocity)):
        if given is not None:
            velocities[n] = given
    return velocities
