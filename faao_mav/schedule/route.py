"""The relay route: waypoints, when the plan passes them, and what the mission commands there.

The initial route has few legs at the plan's mean speeds, and hovers as waits. Nothing in it knows
how the vehicle speeds up or turns: the schedulers fit it to the predicted flight.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.autopilot import Model
from faao_mav.plan import Plan
from faao_mav.schedule.waypoints import DIGITS, LEG_SHARE, Waypoint, hovers_and_ends, simplify
from faao_mav.vector import lengths

_MOVING = 0.5  # the speed at an end of a plan, m/s, above which there is a run-in; chosen


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """The relay route as m >= 1 waypoints and the m - 1 legs between them.

    `positions` (m, 2) are local east-north metres. The plan reaches waypoint k at `arrivals[k]`
    and leaves it at `departures[k]`, s; the two differ at hovers. The mission commands a speed for
    each leg, `speeds` (m - 1,), m/s, and for each waypoint how long to wait there, `waits` (m,), s,
    and an acceptance radius, `radii` (m,), m, 0 for the autopilot's own.

    The plan's flight begins at waypoint `first`, w_I, and ends at waypoint `last`, w_F. A waypoint
    before `first` lets the aircraft reach w_I at speed, one after `last` lets it leave w_F at
    speed. The aircraft leaves w_I `lead` seconds before the plan does.
    """

    positions: Real
    arrivals: Real
    departures: Real
    speeds: Real
    waits: Real
    radii: Real
    first: int
    last: int
    lead: float = 0.0

    @property
    def leg_lengths(self) -> Real:
        """Length of each leg, (m - 1,), m."""
        return lengths(np.diff(self.positions, axis=0))

    @property
    def planned_speeds(self) -> Real:
        """The speed with which the plan moves along each leg, (m - 1,), m/s; none is 0."""
        durations = self.arrivals[1:] - self.departures[:-1]
        speeds: Real = np.maximum(self.leg_lengths, 1e-9) / np.maximum(durations, 1e-9)
        return speeds

    @property
    def joined(self) -> Flags:
        """Which legs follow another without a stop, (m - 1,)."""
        joined: Flags = self.waits[:-1] == 0
        joined[0] = False
        return joined

    @property
    def distance(self) -> float:
        """Length of the route from w_I to w_F, m."""
        return float(self.leg_lengths[self.first : self.last].sum())

    @property
    def turns(self) -> Real:
        """Change of heading at each waypoint, (m,), rad, 0 to pi; 0 at both ends."""
        headings = np.arctan2(*np.diff(self.positions, axis=0).T[::-1])
        turns = np.abs((np.diff(headings) + np.pi) % (2 * np.pi) - np.pi)
        return np.concatenate([[0.0], turns, [0.0]])[: len(self.positions)]

    def rounded(self) -> "Route":
        """Return the route to 1 mm, 1 mm/s and 1 ms.

        What is chosen from predicted flights then does not hang on how a processor rounds.
        """
        values = {name: getattr(self, name) for name in ("positions", "speeds", "waits", "lead")}
        return replace(self, **{name: np.round(x, DIGITS) for name, x in values.items()})

    def insert(self, at: Integers, positions: Real, times: Real, speeds: Real) -> "Route":
        """Return the route with plain waypoints before those that now have the indices `at` (k,).

        The plan passes the new waypoints, `positions` (k, 2), at `times` (k,), s, without a wait.
        `speeds` (k,), m/s, are those of the legs that begin there; behind the last waypoint, of the
        leg that ends there. `first` and `last` stay with their waypoints.
        """
        new = {"positions": positions, "speeds": speeds, "arrivals": times, "departures": times}
        longer: dict[str, Any] = {}
        for name, values in (new | {"waits": 0.0, "radii": 0.0}).items():
            old = getattr(self, name)
            longer[name] = np.insert(old, np.minimum(at, len(old)), values, axis=0)
        first, last = (end + int(np.sum(at <= end)) for end in (self.first, self.last))
        return replace(self, first=first, last=last, **longer)


def sent_speeds(speeds: Real, max_speed: float) -> Real:
    """Return `speeds` (k,), m/s, as they are sent: to a millimetre a second, within `max_speed`.

    >>> sent_speeds(np.array([4.00049, 7.9999]), 7.9999)
    array([4.   , 7.999])
    """
    scale = 10**DIGITS
    limit = np.floor(max_speed * scale + 1e-6) / scale or max_speed
    return np.minimum(np.round(speeds, DIGITS), limit)


def initial_route(t: Real, w: Real, plan: Plan) -> Route:
    """Return waypoints, waits and speeds that follow the trajectory.

    The polyline through the waypoints passes every sample of `w` within
    `plan.mission.path_tolerance`. Hovers are one waypoint with a wait of whole seconds; what
    rounding leaves over is carried to the next wait. Each leg's speed is its length over its
    planned duration, to 0.001 m/s, at most `plan.max_ground_speed`: the time that it takes to
    speed up and slow down is not allowed for.

    `t` (n,) s, n >= 2, increasing, are the times of the slots, `w` (n, 2) the local east-north
    positions at those times, metres.
    """
    slowest, tolerance = slowest_leg(plan), plan.mission.path_tolerance
    fixed = hovers_and_ends(t, w, tolerance, slowest)
    waypoints = [fixed[0]]
    for start, stop in pairwise(fixed):
        stretch = slice(start.last, stop.first + 1)
        path = w[stretch].copy()
        path[0], path[-1] = start.position, stop.position
        inner = simplify(path, LEG_SHARE * tolerance)
        waypoints += [Waypoint(start.last + k, start.last + k, path[k]) for k in inner]
        waypoints.append(stop)
    return _timed(t, waypoints, slowest, plan.max_ground_speed)


def slowest_leg(plan: Plan) -> float:
    """Return the least speed that the plan's vehicle is commanded for a leg, m/s.

    Where the plan is slower it waits. It is half of `max_speed` at most.
    """
    return min(plan.aircraft.flight_model().slowest, plan.vehicle.max_speed / 2)


def with_run_in(route: Route, t: Real, w: Real, legs: Model, max_speed: float) -> Route:
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


def set_out(t: Real, w: Real, plan: Plan) -> float:
    """Return when the trajectory leaves w_I, s: the end of the initial route's first hover.

    `t` (n,) s, `w` (n, 2) m.
    """
    tolerance = plan.mission.path_tolerance
    return float(t[hovers_and_ends(t, w, tolerance, slowest_leg(plan))[0].last])


def begins_at_speed(t: Real, w: Real) -> bool:
    """Tell whether the plan `t` (n,) s, `w` (n, 2) m begins faster than 0.5 m/s."""
    return float(lengths(_end_velocities(t, w)[0])) > _MOVING


def _timed(t: Real, waypoints: list[Waypoint], slowest: float, max_speed: float) -> Route:
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
        first=0,
        last=len(waypoints) - 1,
    )


def _end_velocities(t: Real, w: Real) -> Real:
    """Return the velocities (2, 2), m/s, at which the plan begins and ends.

    Of second order: the mean over the first slot is not 0 for a plan that speeds up from rest.
    """
    return np.asarray(np.gradient(w, t, axis=0, edge_order=2 if len(t) > 2 else 1)[[0, -1]])
