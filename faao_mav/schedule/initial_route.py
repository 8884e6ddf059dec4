"""The initial route for a trajectory: few legs at the plan's mean speeds, hovers as waits.

Nothing in it knows how the vehicle speeds up or turns: the schedulers fit it to the predicted
flight.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.plan import Plan
from faao_mav.schedule.route import Route, sent_speeds
from faao_mav.schedule.waypoints import (
    LEG_SHARE,
    Waypoint,
    along_spline,
    fits,
    hovers_and_ends,
    simplify,
)
from faao_mav.vector import lengths
from faao_mav.vehicle import LegLimits, vehicle_of

_MOVING = 0.5  # the speed at an end of a plan, m/s, above which there is a run-in; chosen

# The share of the plan's greatest speed on a leg up to which it is a leg of its own: of 0.6 to 0.9
# the one with which four hard plans were kept best.
_RAMPED = 0.6


@dataclass(frozen=True, slots=True)
class Splines:
    """Which legs become splines, and how far apart their waypoints are.

    Spline waypoints are `spacing` m apart in bends. The last one before a stop is at least
    `braking` m before it: an autopilot brakes on the last leg alone. All legs become splines, or
    with `straight` only those that are too short to reach their speed if flown straight.
    """

    spacing: float
    braking: float = 0.0
    straight: LegLimits | None = None


def initial_route(
    t: ArrayLike,
    w: ArrayLike,
    plan: Plan,
    *,
    splines: Splines | None = None,
    share: float = 1.0,
) -> Route:
    """Return waypoints, waits and speeds that follow the trajectory.

    The polyline through the waypoints passes every sample of `w` within `share` of
    `plan.mission.path_tolerance`. Hovers are one waypoint with a wait of whole seconds; what
    rounding leaves over is carried to the next wait. Each leg's speed is its length over its
    planned duration, to 0.001 m/s, at most `plan.max_ground_speed`: the time that it takes to
    speed up and slow down is not allowed for.

    `t` (n,) s, n >= 2, increasing, are the times of the slots, `w` (n, 2) the local east-north
    positions at those times, metres. Raises `InputError` for what is no trajectory.
    """
    times, positions = _checked(t, w)
    legs, slowest = vehicle_of(plan).legs, slowest_leg(plan)
    tolerance = share * plan.mission.path_tolerance
    fixed = hovers_and_ends(times, positions, tolerance, slowest)
    waypoints, curved = [fixed[0]], [False]
    for start, stop in pairwise(fixed):
        stretch = slice(start.last, stop.first + 1)
        path = positions[stretch].copy()
        path[0], path[-1] = start.position, stop.position
        inner = _apart(path, simplify(path, LEG_SHARE * tolerance), legs.least, tolerance)
        marked = [False] * (len(inner) + 1)
        if splines is not None:
            inner, marked = _with_splines(times[stretch], path, inner, splines)
        waypoints += [Waypoint(start.last + k, start.last + k, path[k]) for k in inner]
        waypoints.append(stop)
        curved += marked
    return _timed(times, waypoints, curved, slowest, plan.max_ground_speed)


def slowest_leg(plan: Plan) -> float:
    """Return the least speed that the plan's vehicle is commanded for a leg, m/s.

    Where the plan is slower it waits. It is half of `max_speed` at most.
    """
    return min(vehicle_of(plan).legs.slowest, plan.vehicle.max_speed / 2)


def with_run_in(route: Route, t: Real, w: Real, legs: LegLimits, max_speed: float) -> Route:
    """Return `route` with a leg on which the aircraft reaches the plan's first speed before w_I.

    Likewise with one after w_F, so that the aircraft does not brake before it. Ends at which the
    plan waits, or is slower than 0.5 m/s, get none. `t` (n,) s, `w` (n, 2) m.
    """
    if len(route.positions) < 2:
        return route
    for end, velocity in zip((0, -1), _end_velocities(t, w), strict=True):
        speed = float(lengths(velocity))
        if speed <= _MOVING or route.departures[end] > route.arrivals[end]:
            continue
        flown, outward = min(speed, max_speed), 1.0 if end else -1.0
        length = legs.run_in * float(legs.shortest_leg(np.array([flown]))[0])
        route = route.insert(
            np.array([len(route.positions) if end else 0]),
            (route.positions[end] + outward * (velocity / speed * length))[None],
            np.array([route.arrivals[end] + outward * length / flown]),
            np.array([speed]),
        )
    return route


def with_ramps(route: Route, t: Real, w: Real, least: float) -> Route:
    """Return `route` with legs of their own for where the plan speeds up and slows down.

    A vehicle that is quicker to change its speed keeps the plan's time at the end of a leg, not on
    the way there. A leg is split where the plan first and last has 0.6 of its greatest speed on it,
    if both parts are `least` m long. `t` (n,) s, `w` (n, 2) m.
    """
    pace = lengths(np.gradient(w, t, axis=0))
    splits: list[int] = []
    for k in range(len(route.speeds)):
        inside = np.flatnonzero((t > route.departures[k]) & (t < route.arrivals[k + 1]))
        if len(inside) == 0:
            continue
        fast = inside[pace[inside] >= _RAMPED * pace[inside].max()]
        ends = route.positions[k : k + 2]
        splits += [i for i in {fast[0], fast[-1]} if min(lengths(ends - w[i])) >= least]
    chosen = np.array(sorted(splits), dtype=int)
    at = np.searchsorted(route.arrivals, t[chosen])
    return route.insert(at, w[chosen], t[chosen], route.speeds[at - 1])


def set_out(t: Real, w: Real, plan: Plan) -> float:
    """Return when the trajectory leaves w_I, s: the end of the initial route's first hover.

    `t` (n,) s, `w` (n, 2) m.
    """
    tolerance = plan.mission.path_tolerance
    return float(t[hovers_and_ends(t, w, tolerance, slowest_leg(plan))[0].last])


def begins_at_speed(t: Real, w: Real) -> bool:
    """Tell whether the plan `t` (n,) s, `w` (n, 2) m begins faster than 0.5 m/s."""
    return float(lengths(_end_velocities(t, w)[0])) > _MOVING


def _checked(t: ArrayLike, w: ArrayLike) -> tuple[Real, Real]:
    times, positions = np.asarray(t, dtype=float), np.asarray(w, dtype=float)
    if times.ndim != 1 or len(times) < 2 or positions.shape != (len(times), 2):
        raise InputError(
            f"trajectory: t {times.shape} and w {positions.shape}; expected (n,) and (n, 2), n >= 2"
        )
    if not (np.isfinite(times).all() and np.isfinite(positions).all()):
        raise InputError("trajectory: t and w must be finite")
    if not (np.diff(times) > 0).all():
        raise InputError("trajectory: t must increase")
    return times, positions


def _apart(path: Real, inner: list[int], least: float, tolerance: float) -> list[int]:
    """Return `inner`, points of `path` (n, 2), without those that make a leg shorter than `least`.

    Points stay without which a sample of the path were farther than `tolerance` from its leg; m.
    """
    ends = [0, *inner, len(path) - 1]
    for k in inner:
        at = ends.index(k)
        before, after = ends[at - 1], ends[at + 1]
        short = min(lengths(path[[before, after]] - path[k])) < least
        if short and fits(path, before, after, tolerance):
            del ends[at]
    return ends[1:-1]


def _with_splines(
    t: Real, path: Real, inner: list[int], splines: Splines
) -> tuple[list[int], list[bool]]:
    """Return indices of waypoints, and for each and the end whether it is a spline's.

    Runs of legs between the points `inner` that become splines get points of their own.
    """
    ends = [0, *inner, len(path) - 1]
    bent = np.ones(len(inner) + 1, dtype=bool)
    if splines.straight is not None:
        length = lengths(np.diff(path[ends], axis=0))
        bent = length < splines.straight.shortest_leg(length / np.diff(t[ends]))
        bent &= len(bent) > 1
    points: list[int] = []
    marked: list[bool] = []
    first = 0
    for k, is_bent in enumerate(bent):
        is_last = k + 1 == len(bent)
        if is_bent and not is_last and bent[k + 1]:
            continue
        added: list[int] = []
        if is_bent:
            run = path[ends[first] : ends[k + 1] + 1]
            spaced = along_spline(run, splines.spacing, splines.braking if is_last else 0.0)
            added = [ends[first] + i for i in spaced]
        points += [*added, ends[k + 1]]
        marked += [bool(is_bent)] * (len(added) + 1)
        first = k + 1
    return points[:-1], marked


def _timed(
    t: Real, waypoints: list[Waypoint], curved: list[bool], slowest: float, max_speed: float
) -> Route:
    """Return the route with the speeds and waits that keep the plan's times without ramps."""
    positions = np.array([waypoint.position for waypoint in waypoints])
    arrivals = t[[waypoint.first for waypoint in waypoints]]
    departures = t[[waypoint.last for waypoint in waypoints]]
    length = lengths(np.diff(positions, axis=0))
    planned = arrivals[1:] - departures[:-1]
    speeds = sent_speeds(np.maximum(length / planned, slowest), max_speed)
    # Where the plan hovers, or creeps slower than is flown, there is time to wait.
    free = departures > arrivals
    free[1:] |= length < slowest * planned
    waits = np.zeros(len(waypoints))
    clock = arrivals[0]
    for k in range(len(waypoints)):
        if free[k]:
            waits[k] = max(0, round(departures[k] - clock))
        clock += waits[k]
        if k < len(length):
            clock += length[k] / speeds[k]
    return Route(
        positions=positions,
        arrivals=arrivals,
        departures=departures,
        speeds=speeds,
        waits=waits,
        radii=np.zeros(len(waypoints)),
        splines=np.array(curved),
        first=0,
        last=len(waypoints) - 1,
    )


def _end_velocities(t: Real, w: Real) -> tuple[Real, Real]:
    """Return the velocities (2,), m/s, at which the plan begins and ends.

    Of second order: the mean over the first slot is not 0 for a plan that speeds up from rest.
    """
    if len(t) < 3:
        between = (w[-1] - w[0]) / (t[-1] - t[0])
        return between, between
    first = np.gradient(w[:3], t[:3], axis=0, edge_order=2)[0]
    last = np.gradient(w[-3:], t[-3:], axis=0, edge_order=2)[-1]
    return first, last
