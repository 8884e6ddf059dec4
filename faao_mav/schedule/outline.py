"""The first legs for a trajectory: hovers become holds, the rest few legs at mean speeds."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.schedule.hover import SLOWEST, Stop, find_hovers
from faao_mav.schedule.route import Route
from faao_mav.schedule.simplify import simplify
from faao_mav.vector import lengths
from faao_mav.vehicle.legs import Legs

if TYPE_CHECKING:
    from faao_mav.plan import Plan

# Shares of the path tolerance, chosen so that together they never exceed it: hovers stay within
# 2 * 0.45, legs within 0.9 of ends that lie on samples or in hovers, merged stops within 0.05.
_LEG_SHARE = 0.9
_HOVER_SHARE = 0.45
_MERGE_SHARE = 0.05

_HOVER_RADIUS = 1.0
"""A hover's radius at most, m, however lax the path tolerance."""

_FINE = 1.0
"""Metres between the points at which bends are measured."""

_TURN = 0.3
"""Radians between two spline waypoints at most, unless they would be too close."""

_SPARSER = 2.0

_SAME_POINT = 1e-3
"""Ends closer than this are one waypoint, m."""


@dataclass(frozen=True, slots=True)
class Splines:
    """Spline waypoints `spacing` m apart, where `straight` legs would be too short if given.

    The last before a stop is at least `braking` m before it: autopilots brake on the last leg.
    """

    spacing: float
    braking: float = 0.0
    straight: Legs | None = None


def plan_route(
    t: ArrayLike,
    w: ArrayLike,
    plan: "Plan",
    *,
    splines: Splines | None = None,
    share: float = 1.0,
) -> Route:
    """Return waypoints, holds and speeds that follow the trajectory.

    The polyline through the waypoints passes every sample of `w` within `share` of
    `plan.mission.path_tolerance`. Hovers are one waypoint with a hold of whole seconds; what
    rounding leaves over is carried to the next hold. Between hovers `simplify` chooses the
    waypoints; each leg's speed is its length over its planned duration, to 0.001 m/s, at most
    `plan.vehicle.max_speed`. Ramps are not allowed for yet: `schedule` does that.

    `t` (n,) s, n >= 2, increasing, are the times of the slots, `w` (n, 2) the local east-north
    positions at those times, metres. With `splines` what they say is spline waypoints. Raises
    `InputError` for what is no trajectory.
    """
    times, positions = _checked(t, w)
    tolerance = share * plan.mission.path_tolerance
    stops = _stops(times, positions, tolerance)
    waypoints, curved = [stops[0]], [False]
    for start, stop in pairwise(stops):
        stretch = slice(start.last, stop.first + 1)
        path = positions[stretch].copy()
        path[0], path[-1] = start.position, stop.position
        inner = simplify(path, _LEG_SHARE * tolerance)
        marked = [False] * (len(inner) + 1)
        if splines is not None:
            inner, marked = _with_splines(times[stretch], path, inner, splines)
        waypoints += [Stop(start.last + k, start.last + k, path[k]) for k in inner]
        waypoints.append(stop)
        curved += marked
    route = _timed(times, waypoints, plan.vehicle.max_speed)
    return replace(route, splines=np.array(curved))


def set_out(t: Real, w: Real, plan: "Plan") -> float:
    """Return when the trajectory leaves its beginning, s: where `plan_route` lets it hover first.

    `t` (n,) s, `w` (n, 2) m.
    """
    return float(t[_stops(t, w, plan.mission.path_tolerance)[0].last])


def _with_splines(
    t: Real, path: Real, inner: list[int], splines: Splines
) -> tuple[list[int], list[bool]]:
    """Return indices of waypoints, and for each and the end whether it is a spline's.

    Runs of legs between the points `inner` that are to be splines get points of their own.
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
        runs_on = is_bent and k + 1 < len(bent) and bent[k + 1]
        if runs_on:
            continue
        between = path[ends[first] : ends[k + 1] + 1]
        braking = splines.braking if k + 1 == len(bent) else 0.0
        spaced = _spaced(between, splines.spacing, braking) if is_bent else []
        added = [ends[first] + i for i in spaced]
        points += [*added, ends[k + 1]]
        marked += [bool(is_bent)] * (len(added) + 1)
        first = k + 1
    return points[:-1], marked


def _spaced(path: Real, spacing: float, last: float) -> list[int]:
    """Return the indices between first and last of points that are `spacing` m apart in bends.

    On straight parts they are up to `_SPARSER` times as far apart. The last point is at least
    `last` m from the end, if there is one then.
    """
    way = np.concatenate([[0.0], np.cumsum(lengths(np.diff(path, axis=0)))])
    end = float(way[-1]) - max(0.0, last - spacing)
    if end <= 2 * _FINE:
        return []
    fine = np.linspace(0.0, end, math.ceil(end / _FINE) + 1)
    x, y = (np.interp(fine, way, axis) for axis in path.T)
    heading = np.unwrap(np.arctan2(*(np.gradient(_smooth(axis, spacing / 4)) for axis in (y, x))))
    bend = np.abs(np.gradient(heading)) / _FINE
    per_metre = np.clip(bend / _TURN, 1 / (_SPARSER * spacing), 1 / spacing)
    count = np.cumsum(_smooth(per_metre, spacing)) * _FINE
    parts = max(1, round(float(count[-1])))
    wanted = np.interp(np.linspace(count[0], count[-1], parts + 1)[1:-1], count, fine)
    found = np.searchsorted(way, wanted)
    return [int(k) for k in np.unique(found) if 0 < k < len(path) - 1]


def _smooth(values: Real, reach: float) -> Real:
    """Return the means of `values`, `_FINE` m apart, over `reach` m to both sides."""
    half = min(round(reach / _FINE), (len(values) - 1) // 2)
    padded = np.pad(values, half, mode="edge")
    return np.convolve(padded, np.full(2 * half + 1, 1 / (2 * half + 1)), mode="valid")


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


def _stops(t: Real, w: Real, tolerance: float) -> list[Stop]:
    """Return the hovers, with the trajectory's ends as first and last, at w_I and w_F exactly."""
    end = len(t) - 1
    closed = math.dist(w[0], w[end]) <= _SAME_POINT
    stops = find_hovers(t, w, min(_HOVER_RADIUS, _HOVER_SHARE * tolerance))
    if stops and stops[0].first == 0:
        last = stops[0].last
        if last == end and not closed:
            last -= 1  # two ends in one hover: leave a leg between them
        stops[0] = Stop(0, last, w[0])
    else:
        stops.insert(0, Stop(0, 0, w[0]))
    if stops[-1].last == end:
        stops[-1] = Stop(stops[-1].first, end, w[end])
    else:
        stops.append(Stop(end, end, w[end]))
    return _merged(stops, w, tolerance)


def _merged(stops: list[Stop], w: Real, tolerance: float) -> list[Stop]:
    """Return `stops` without neighbours in one place between which nothing of note happens."""
    result = [stops[0]]
    for stop in stops[1:]:
        before = result[-1]
        ends_at_w_f = stop.last == len(w) - 1
        near = _SAME_POINT if before.first == 0 and ends_at_w_f else _MERGE_SHARE * tolerance
        position = stop.position if ends_at_w_f else before.position
        samples = w[before.first : stop.last + 1]
        if (
            math.dist(before.position, stop.position) <= near
            and lengths(samples - position).max() <= tolerance
        ):
            result[-1] = Stop(before.first, stop.last, position)
        else:
            result.append(stop)
    return result


def _timed(t: Real, waypoints: list[Stop], max_speed: float) -> Route:
    """Return the route with speeds and holds that keep the planned times nominally."""
    positions = np.array([stop.position for stop in waypoints])
    arrivals = t[[stop.first for stop in waypoints]]
    departures = t[[stop.last for stop in waypoints]]
    length = lengths(np.diff(positions, axis=0))
    planned = arrivals[1:] - departures[:-1]
    speeds = np.array(
        [_speed(s / d, max_speed) for s, d in zip(length, planned, strict=True)], dtype=float
    )
    # Where the plan hovers, or creeps slower than is flown, there is time to wait.
    waits = departures > arrivals
    waits[1:] |= length < SLOWEST * planned
    holds = np.zeros(len(waypoints))
    clock = arrivals[0]
    for k in range(len(waypoints)):
        if waits[k]:
            holds[k] = max(0, round(departures[k] - clock))
        clock += holds[k]
        if k < len(length):
            clock += length[k] / speeds[k]
    still = np.zeros(len(waypoints))
    plain = np.zeros(len(waypoints), dtype=bool)
    last = len(waypoints) - 1
    return Route(positions, arrivals, departures, speeds, holds, still, still, plain, 0, last)


def _speed(speed: float, max_speed: float) -> float:
    """Return the speed to command, m/s: rounded, never above `max_speed`, never 0."""
    rounded = round(max(speed, SLOWEST), 3)
    return rounded if rounded <= max_speed else math.floor(max_speed * 1000) / 1000 or max_speed
