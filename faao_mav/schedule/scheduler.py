"""A route whose predicted flight keeps the plan's time, with as few legs as that takes.

`plan_route` gives the first legs. Their speeds and holds are fitted (`timing`); legs on which the
predicted flight is still too far from the plan at equal times are split there, and all is fitted
anew. In the end legs whose speeds hardly differ share one, and values are rounded to what is sent.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Integers, Real
from faao_mav.schedule.hover import SLOWEST
from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule
from faao_mav.schedule.timing import SHORTEST_HOLD, Clock, fit
from faao_mav.vector import lengths
from faao_mav.vehicle import CopterModel, FlightPath
from faao_mav.vehicle.legs import Legs

ALLOWED = 0.8
"""Metres that a leg may be off at equal times before it is split."""

WAYPOINTS = 24
"""Waypoints at most, unless the path itself takes more."""

_FASTER = 1.1
"""Of the greatest speed: commanded at most, where the aircraft would not keep up otherwise."""

_SETTLED = 6.0
"""A hold at w_I at least, s.

ArduCopter leaves late by up to 0.75 s after a hold of 1 s: it is still drifting.
"""

_SETTLING = 3.0
"""A hold at w_F at least while speeds are fitted, s: the aircraft comes to rest there."""

_ROUNDS = 5
_ROOM = 0.85
"""Of the planned speed at a split: what both legs have to have room for."""

_WORTHWHILE = 0.98
"""A round of splits has to bring the error below this share of what it was."""

_ALIKE = (0.1, 0.03)
"""Speeds of neighbouring legs that differ by less, relatively, are tried as one."""

_SPLINE_RUN = 3
"""Splines that have one speed while it is sought."""

_MOVED = 0.8
"""Of what the aircraft strays."""

_PASSING = 6.0
"""Seconds within which an aircraft passes a waypoint that it takes as reached."""

_DEARER = 1.05
_SPEED_DIGITS, _HOLD_DIGITS = 3, 1


@dataclass(frozen=True, slots=True, eq=False)
class Scheduler:
    """The plan and the vehicle that all trials of a conversion have in common.

    `t` (n,) s and `w` (n, 2) m are the plan; `legs` says how short a leg may be for its speed,
    and how wide its acceptance radius; no speed is below `min_speed` or above `max_speed`, m/s,
    unless the aircraft would not keep up: then by at most a tenth. The flight is over when the
    aircraft is within `tolerance` m of w_F. `whole_seconds`: holds lose their fractions.
    """

    t: Real
    w: Real
    model: CopterModel
    legs: Legs
    max_speed: float
    tolerance: float
    min_speed: float = SLOWEST
    whole_seconds: bool = True

    def first(self, route: Route) -> Schedule:
        """Return `route` with the speeds and holds that fit best."""
        waits = route.holds + route.delays
        waits[0] = max(waits[0], _SETTLED)
        if route.last == len(route.holds) - 1:  # it ends at rest
            waits[-1] = max(waits[-1], _SETTLING)
        return self.fitted(self._waiting(route, waits), self.max_speed)

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with more legs where it is off, and values as they are sent."""
        best, top = first, self.max_speed
        if best.error > ALLOWED:  # corners cost time that only speed makes up for
            top *= _FASTER
            best = self.fitted(best.route, top)
        for _ in range(_ROUNDS):
            finer = self._finer(best, top)
            if finer is None:
                break
            best = finer
        for _ in range(_ROUNDS):
            if best.deviation.path <= self.tolerance and not best.route.splines.any():
                break
            moved = self._moved(best, top)
            if moved.cost > _WORTHWHILE * best.cost:
                break
            best = moved
        return self.rounded(self.shared(best, top), top)

    def flight(self, route: Route) -> Schedule:
        """Return the predicted flight of `route`."""
        route, path, clock = self._told(route)
        return Schedule(route, path, self.model.fly(path), clock)

    def _told(self, route: Route) -> tuple[Route, FlightPath, Clock]:
        """Return `route` with its acceptance radii, the path to fly, and the flight's clock."""
        stops = route.holds + route.delays > 0
        stops[[0, -1]] = True
        reach = np.concatenate([[np.inf], route.leg_lengths, [np.inf]])
        radii = self.legs.radii(np.minimum(reach[:-1], reach[1:]), route.turns)
        route = replace(route, radii=np.where(stops, 0.0, np.round(radii, 1)))
        path = FlightPath(
            points=np.column_stack([route.positions, np.zeros(len(route.positions))]),
            speeds=route.speeds,
            holds=route.holds,
            delays=route.delays,
            splines=route.splines,
            radii=route.radii,
        )
        leaving = route.first == 0
        at = route.departures if leaving else route.arrivals
        clock = Clock(
            t=self.t - self.t[0],
            w=self.w,
            point=route.first,
            at=at[route.first] - self.t[0],
            leaving=leaving,
            near=self.tolerance,
            lead=route.lead,
        )
        return route, path, clock

    def fitted(self, route: Route, top: float, groups: Integers | None = None) -> Schedule:
        """Return the flight of `route` with the speeds and holds that fit best.

        No speed is above `top`, m/s; legs with the same number in `groups` share one.
        """
        route, path, clock = self._told(route)
        free = (route.holds > 0) & (np.arange(len(route.holds)) != 0)
        free[-1] = False
        free &= ~route.splines  # their waits are whole seconds: no delay may follow a spline
        speeds, waits, lead = fit(
            self.model,
            path,
            clock,
            groups=_own_speeds(route) if groups is None else groups,
            free=free,
            min_speed=self.min_speed,
            max_speed=top,
        )
        return self.flight(self._waiting(replace(route, speeds=speeds, lead=lead), waits))

    def _waiting(self, route: Route, waits: Real) -> Route:
        """Return `route` with `waits` (m,), s, as holds, and as delays what holds cannot say."""
        holds = np.floor(waits) if self.whole_seconds else waits
        return replace(route, holds=holds, delays=np.round(waits - holds, 9))

    def _finer(self, found: Schedule, top: float) -> Schedule | None:
        """Return `found` with the legs split that are off by too much, or None if that is no use.

        A leg may become too short for its speed: then fewer splits can be better than all.
        """
        times = self._splits(found)
        for count in dict.fromkeys((len(times), len(times) // 2, 1)):
            if 0 < count <= len(times):
                finer = self.fitted(self._split(found.route, sorted(times[:count])), top)
                if finer.cost <= _WORTHWHILE * found.cost:
                    return finer
        return None

    def _moved(self, found: Schedule, top: float) -> Schedule:
        """Return `found` with waypoints moved by what the aircraft strays from them.

        ArduPilot's swings wide in splines, for it is not told what turning takes; PX4's cuts
        corners with wide acceptance radii.
        """
        route = found.route
        moves = (route.splines | (route.radii > 0)) & (route.holds == 0)
        points = np.arange(route.first + 1, route.last)
        points = points[moves[points]]
        positions = route.positions.copy()
        positions[points] -= _MOVED * self.astray(found, points)
        return self.fitted(replace(route, positions=positions), top)

    def astray(self, found: Schedule, points: Integers) -> Real:
        """Return how far from the plan's place the flight passes the waypoints `points` (k,), m.

        (k, 2): from where the plan is when it comes there to the nearest place of the flight, soon
        before or after that takes the waypoint as reached, for it may pass by more than once.
        """
        route, flown = found.route, found.flown
        planned = np.column_stack([np.interp(route.arrivals[points], self.t, x) for x in self.w.T])
        result = np.zeros_like(planned)
        for row, k in enumerate(points):
            about = flown.arrivals[k]
            first, last = np.searchsorted(flown.t, [about - _PASSING, about + _PASSING])
            near = flown.position[first:last, :2]
            result[row] = near[np.argmin(lengths(near - planned[row]))] - planned[row]
        return result

    def _splits(self, found: Schedule) -> list[float]:
        """Return the plan's times at which legs that are off by too much are best split.

        The worst leg comes first.
        """
        route = found.route
        off = lengths(found.positions(self.t - self.t[0]) - self.w)
        room = WAYPOINTS - len(route.positions)
        worst = []
        for k in range(route.first, route.last):
            if route.splines[k + 1]:
                continue
            inside = np.flatnonzero(
                (self.t > route.departures[k]) & (self.t < route.arrivals[k + 1])
            )
            usable = inside[self._usable(route, k, inside)]
            if len(inside) and len(usable) and off[inside].max() > ALLOWED:
                at = usable[np.argmax(off[usable])]
                worst.append((float(off[inside].max()), float(self.t[at])))
        worst.sort(reverse=True)
        return [time for _, time in worst[: max(room, 0)]]

    def _split(self, route: Route, times: list[float]) -> Route:
        """Return `route` with waypoints where the plan is at `times` (s, sorted)."""
        at = np.searchsorted(route.arrivals, times)
        positions = np.column_stack([np.interp(times, self.t, x) for x in self.w.T])
        split = route.with_waypoints(at, positions, np.array(times), route.speeds[at - 1])
        return replace(split, last=route.last + len(times))

    def _usable(self, route: Route, k: int, inside: Integers) -> NDArray[np.bool_]:
        """Tell for each sample `inside` leg k whether both parts would be legs of some use.

        On one much shorter than its ramps the aircraft is slower than planned at the split.
        """
        passing = lengths(self.w[inside + 1] - self.w[inside - 1])
        passing /= self.t[inside + 1] - self.t[inside - 1]
        result = np.ones(len(inside), dtype=bool)
        ends = (
            (route.positions[k], self.t[inside] - route.departures[k]),
            (route.positions[k + 1], route.arrivals[k + 1] - self.t[inside]),
        )
        for end, lasting in ends:
            length = lengths(self.w[inside] - end)
            shortest = self.legs.shortest_leg(np.maximum(length / lasting, _ROOM * passing))
            result &= length >= np.maximum(shortest, self.legs.least)
        return result

    def shared(self, found: Schedule, top: float) -> Schedule:
        """Return `found` with one speed for neighbouring legs wherever that hardly costs."""
        for alike in _ALIKE:
            groups = _groups(found.route.speeds, alike)
            if len(groups) == 0 or groups[-1] == len(groups) - 1:
                continue
            tried = self.fitted(found.route, top, groups)
            if tried.cost <= max(_DEARER * found.cost, ALLOWED / 2):
                return tried
        return found

    def rounded(self, found: Schedule, top: float) -> Schedule:
        """Return `found` with the values that are sent."""
        route = found.route
        top = np.floor(top * 10**_SPEED_DIGITS) / 10**_SPEED_DIGITS or top
        waits = np.round(route.holds + route.delays, _HOLD_DIGITS)
        speeds = np.minimum(np.round(route.speeds, _SPEED_DIGITS), top)
        lead = round(route.lead, _HOLD_DIGITS)
        sent = self.flight(self._waiting(replace(route, speeds=speeds, lead=lead), waits))
        if route.last < len(waits) - 1:
            return sent
        # the relay is needed to the end of the plan's last slot
        lasting = self.t[-1] - self.t[0] + self.t[-1] - self.t[-2]
        early = lasting + sent.clock.start(sent.flown) - sent.flown.arrivals[-1]
        waits[-1] = max(SHORTEST_HOLD, np.ceil(early))
        return self.flight(self._waiting(sent.route, waits))


def _own_speeds(route: Route) -> Integers:
    """Number the legs that have a speed of their own: each, or a few splines that go on."""
    groups = np.zeros(len(route.speeds), dtype=int)
    run = 1
    for k in range(1, len(groups)):
        goes_on = route.splines[k] and route.splines[k + 1] and not route.holds[k]
        run = run + 1 if goes_on and run < _SPLINE_RUN else 1
        groups[k] = groups[k - 1] + (run == 1)
    return groups


def _groups(speeds: Real, alike: float) -> Integers:
    """Number the runs of legs whose speeds stay within a factor 1 + `alike` of their first."""
    groups, leader = np.zeros(len(speeds), dtype=int), 0
    for k in range(1, len(speeds)):
        same = abs(speeds[k] - speeds[leader]) <= alike * speeds[leader]
        groups[k] = groups[k - 1] + (not same)
        leader = leader if same else k
    return groups
