"""What finds speeds, waits and waypoints with which the predicted flight keeps the plan.

For a multicopter it takes as few legs as keep the plan's time and path. The initial route's speeds
and waits are fitted (`timing`); legs on which the predicted flight is still too far from the plan
at equal times are split there, and all is fitted anew. In the end legs whose speeds hardly differ
share one, and values are rounded to what is sent.

An aeroplane aims at a point far ahead on its track: it cuts into bends and swings out of them. So
its waypoints are moved against its predicted offsets from the plan, again and again; then the
speeds are fitted. Waypoints are judged by the path alone: the speeds mend the time. The aircraft
cannot wait, and it is slow to change its speed: a change begins legs before the plan's, and time
that is lost it cannot always make up for.

Constants that name no source are chosen; what a change costs is not measured.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.autopilot import FlightPath, Model, Vehicle
from faao_mav.autopilot.vehicle_type import OVERSPEED
from faao_mav.errors import InputError
from faao_mav.plan import Vector
from faao_mav.schedule.prediction import LATE_WEIGHT, PASSING_WINDOW, Schedule, positions_at
from faao_mav.schedule.route import Route, sent_speeds
from faao_mav.schedule.timing import SHORTEST_HOLD, Retimed, Unknowns, stepped
from faao_mav.schedule.waypoints import SHORTEST_HOVER
from faao_mav.vector import lengths

# The position error at equal times, m, that is left as it is. Repeats of one flight in ArduCopter's
# simulator differ by up to 0.4 m rms.
ALLOWED_ERROR = 0.8

_WORTHWHILE = 0.95  # the largest ratio of the costs after and before a change that is kept
_LEAST_GAIN = 0.1  # the share of the sum of squares that a flight saves for another one to follow
_SAMPLES = 240  # the most instants at which a predicted flight is compared with the plan
_ALIKE = 0.1  # the relative difference of neighbours' speeds that are tried as one

# The shortest wait of a copter at the first waypoint, s. After a hold of 1 s ArduCopter is still
# drifting and leaves 0.4 to 0.75 s late, measured in its simulator.
_FIRST_WAIT = 6.0
_SPEED_SHARE = 0.85  # of the plan's speed at a split, for which both parts must be long enough

# The share of its offset from the plan by which a plane's waypoint is moved the other way: with
# more, neighbouring waypoints correct the same offset and overdo it.
_MOVE_SHARE = 0.5
_MOVES = 12  # times that the waypoints are moved; twice as many bring a tenth at most
_ROUNDS = 3  # times that waypoints are moved and speeds fitted, in turn; chosen
_AHEAD = 2.0  # how long before the plan's speed changes the command may, s; measured on 26 plans
# Where the plan's speed changes by more than this share, its legs are split so often, s; chosen.
_CHANGE, _CHANGE_SPACING = 0.05, 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Scheduler(ABC):
    """The plan and the vehicle that all trials of a conversion have in common.

    Lifecycle: `first` is called for each set of parameters and each initial route, and is quick;
    `refined` for the most promising of the schedules that it returns.

    The plan is at `w` (n, 2), m, at `t` (n,), s. `model` predicts the flights of `vehicle`. Speeds
    are within `min_speed` and `max_speed`, m/s. The flight is over when the aircraft is within
    `tolerance` m of w_F. It is flown `altitude` m above sea level, in a `wind`, m/s.
    """

    t: Real
    w: Real
    vehicle: Vehicle
    model: Model
    min_speed: float
    max_speed: float
    tolerance: float
    altitude: float = 0.0
    wind: Vector = (0.0, 0.0)

    @abstractmethod
    def first(self, route: Route) -> Schedule:
        """Return `route`, which has the run-in that the plan needs, in its first fit to it."""

    @abstractmethod
    def refined(self, first: Schedule) -> Schedule:
        """Return `first` brought closer to the plan, with values as they are sent."""

    def flight(self, route: Route) -> Schedule:
        """Return the predicted flight of `route`, which is rounded for it."""
        route = self._with_radii(route.rounded())
        count = len(route.positions)
        path = FlightPath(
            points=np.column_stack([route.positions, np.zeros(count)]),
            speeds=route.speeds,
            holds=route.waits,
            splines=np.zeros(count, dtype=bool),
            radii=route.radii,
            elevation=self.altitude,
            wind=self.wind,
        )
        return Schedule(route, self.model.fly(path), self.t, self.w, self.tolerance)

    def fitted(self, route: Route, *, groups: Integers | None = None) -> Schedule:
        """Return the flight of `route` with the speeds, the waits and the lead that fit best.

        Legs with the same number in `groups` share a speed.
        """
        if len(route.speeds) == 0:
            return self.flight(route)
        samples = np.unique(np.linspace(0, len(self.t) - 1, _SAMPLES).astype(int))
        t, w = self.t[samples], self.w[samples]

        def missed(flown: Schedule) -> float:  # as `Schedule.error` squared, of the samples
            apart = lengths(flown.positions(t) - w)
            return float(np.mean(apart**2)) + (LATE_WEIGHT * flown.late) ** 2

        groups = np.arange(len(route.speeds)) if groups is None else groups
        unknowns = Unknowns(route, groups, self.min_speed, self.max_speed)
        x, slow = unknowns.initial, math.isfinite(self.model.speed_rates.fall)
        best = self.flight(unknowns.commanded(x))
        before, cost = math.inf, missed(best)
        while cost < (1 - _LEAST_GAIN) * before:
            known = self.model.leg_durations(best.route.leg_lengths, best.route.joined)
            retimed = Retimed(best, known, slow=slow)
            tried, foreseen = stepped(t, w, unknowns, retimed, x)
            if foreseen > (1 - _LEAST_GAIN) * cost:
                break
            try:
                flown = self.flight(unknowns.commanded(tried))
            except InputError:  # it is not followed to its end
                break
            before, now = cost, missed(flown)
            if now >= before:
                break
            x, best, cost = tried, flown, now
        return best

    def with_waypoints(self, route: Route, times: Real) -> Route:
        """Return the route with a waypoint more where the plan is at each of `times` (k,), s."""
        at = np.searchsorted(route.arrivals, times)
        positions = positions_at(times, self.t, self.w)
        return route.insert(at, positions, times, route.speeds[at - 1])

    def sent(self, schedule: Schedule) -> Schedule:
        """Return `schedule` with the values that are sent, and a last wait to the plan's end.

        Neighbouring legs have one speed wherever that hardly costs.
        """
        groups = _speed_groups(schedule.route.speeds)
        if len(groups) and groups[-1] < len(groups) - 1:
            shared = self.fitted(schedule.route, groups=groups)
            if shared.cost <= max(schedule.cost / _WORTHWHILE, ALLOWED_ERROR / 2):
                schedule = shared
        route = schedule.route
        waits = route.waits.copy()
        if route.last == len(waits) - 1:  # it ends at rest, and the plan with its last slot
            end = 2 * self.t[-1] - self.t[-2]
            early = end + schedule.start - schedule.flown.arrivals[-1]
            waits[-1] = max(SHORTEST_HOLD, np.ceil(early))
        speeds = sent_speeds(route.speeds, self.max_speed)
        return self.flight(replace(route, speeds=speeds, waits=waits))

    def _with_radii(self, route: Route) -> Route:
        """Return `route` with the acceptance radii that suit its legs and turns."""
        stops = route.waits > 0
        stops[[0, -1]] = True
        onward = np.where(route.waits[1:] > 0, np.inf, route.leg_lengths)  # it waits there anyway
        leg_lengths = np.concatenate([[np.inf], onward, [np.inf]])
        room = np.minimum(leg_lengths[:-1], leg_lengths[1:])
        radii = self.model.radii(room, route.turns, stops)
        return replace(route, radii=np.round(radii, 1))


def _speed_groups(speeds: Real) -> Integers:
    """Number the runs of legs whose speeds stay within a factor 1 + `_ALIKE` of their first."""
    groups, leader = np.zeros(len(speeds), dtype=int), 0
    for k in range(1, len(speeds)):
        same = abs(speeds[k] - speeds[leader]) <= _ALIKE * speeds[leader]
        groups[k] = groups[k - 1] + (not same)
        leader = leader if same else k
    return groups


@dataclass(frozen=True, slots=True, eq=False)
class CopterScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that waits at hovers and is quick to change its speed.

    Where it would not keep up, speeds are up to a tenth above `max_speed`.
    """

    def first(self, route: Route) -> Schedule:
        """Return `route` with the speeds and waits that fit best."""
        waits = route.waits.copy()
        waits[0] = max(waits[0], _FIRST_WAIT)
        if route.last == len(waits) - 1:  # it ends at rest, and takes that long to come to it
            waits[-1] = max(waits[-1], SHORTEST_HOVER)
        return self.fitted(replace(route, waits=waits))

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with more legs where it is off, and values as they are sent."""
        quick, best = self, first
        if first.error > ALLOWED_ERROR:  # corners cost time that only speed makes up for
            quick = replace(self, max_speed=OVERSPEED * self.max_speed)
            best = quick.fitted(first.route)
        while len(times := self._split_times(best)):
            tried = quick.fitted(self._split(best.route, times))
            if tried.cost > _WORTHWHILE * best.cost:
                break
            best = tried
        return quick.sent(best)

    def _split(self, route: Route, times: Real) -> Route:
        """Return the route with waypoints more where the plan is at the `times` (k,), s.

        The speeds of the parts of a leg differ as the plan's do: the fit begins with them.
        """
        at, split = np.searchsorted(route.arrivals, times), self.with_waypoints(route, times)
        planned = route.planned_speeds
        shares = split.planned_speeds / np.insert(planned, at, planned[at - 1])
        return replace(split, speeds=shares * split.speeds)

    def _split_times(self, schedule: Schedule) -> Real:
        """Return the plan's times (k,), s, at which legs that are too far off are best split."""
        route = schedule.route
        off = lengths(schedule.positions(self.t) - self.w)
        times = []
        for k in range(route.first, route.last):
            inside = np.flatnonzero(
                (self.t > route.departures[k]) & (self.t < route.arrivals[k + 1])
            )
            usable = inside[self._long_enough(route, k, inside)]
            if len(usable) and off[inside].max() > ALLOWED_ERROR:
                times.append(float(self.t[usable[np.argmax(off[usable])]]))
        return np.array(times)

    def _long_enough(self, route: Route, k: int, inside: Integers) -> Flags:
        """Tell for each sample `inside` leg k whether both parts are long enough for their speed.

        On a part much shorter than its ramps the aircraft is slower than planned at the split.
        """
        planned_speed = lengths(self.w[inside + 1] - self.w[inside - 1])
        planned_speed /= self.t[inside + 1] - self.t[inside - 1]
        legs, result = self.model, np.ones(len(inside), dtype=bool)
        parts = (
            (route.positions[k], self.t[inside] - route.departures[k]),
            (route.positions[k + 1], route.arrivals[k + 1] - self.t[inside]),
        )
        for end, duration in parts:
            length = lengths(self.w[inside] - end)
            speed = np.maximum(length / duration, _SPEED_SHARE * planned_speed)
            result &= length >= np.maximum(legs.shortest_leg(speed), legs.least)
        return result


@dataclass(frozen=True, slots=True, eq=False)
class PlaneScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that neither waits nor turns on the spot."""

    def first(self, route: Route) -> Schedule:
        """Return `route` with waypoints where the speed changes, at the plan's airspeeds."""
        return self.flight(self._at_speeds(self.with_waypoints(route, self._changes(route)), 0.0))

    def _at_speeds(self, route: Route, ahead: float) -> Route:
        """Return `route` with the plan's airspeeds `ahead` s after the middle of each leg."""
        ratio = self.model.true_over_commanded(self.altitude)
        duration, times = np.diff(self.t), (route.arrivals[1:] + route.arrivals[:-1]) / 2
        airspeed = lengths(np.diff(self.w, axis=0) / duration[:, None] - self.wind)
        planned = np.interp(times + ahead, self.t[1:] - duration / 2, airspeed)
        return replace(route, speeds=np.clip(planned / ratio, self.min_speed, self.max_speed))

    def _kept(self, route: Route) -> Schedule:
        """Return the flight of `route` with its waypoints moved to keep the path best."""
        schedule = best = self.flight(route)
        for _ in range(_MOVES):
            schedule = self.flight(self._moved(schedule))
            if schedule.deviation.path < best.deviation.path:
                best = schedule
        return best

    def _moved(self, schedule: Schedule) -> Route:
        """Return the route with its waypoints moved against the flight's offsets, by `_MOVE_SHARE`.

        An offset is that from the plan's position when it passes the waypoint to the nearest
        position of the flight within 3 s of when the waypoint counts as reached, for the flight may
        pass it again.
        """
        route, flown = schedule.route, schedule.flown
        positions = route.positions.copy()
        planned = positions_at(route.arrivals, self.t, self.w)
        for k in range(route.first + 1, route.last + 1):
            about = flown.arrivals[k]
            window = [about - PASSING_WINDOW, about + PASSING_WINDOW]
            first, last = np.searchsorted(flown.t, window)
            near = flown.position[first:last, :2]
            positions[k] -= _MOVE_SHARE * (near[np.argmin(lengths(near - planned[k]))] - planned[k])
        return replace(route, positions=positions)

    def _changes(self, route: Route) -> Real:
        """Return times, s, at which legs are split so that changes of speed can begin there.

        The vehicle takes as long for the plan's whole range of speeds as `speed_rates` says. So
        near are the times to where the plan's speed changes: half before it, half behind.
        """
        middle = (self.t[1:] + self.t[:-1]) / 2
        speed = lengths(np.diff(self.w, axis=0)) / np.diff(self.t)
        reach = np.ptp(speed) / self.model.speed_rates.fall / 2 + _CHANGE_SPACING
        times: list[float] = []
        for time in np.arange(self.t[0], self.t[-1], _CHANGE_SPACING).tolist():
            near = speed[np.abs(middle - time) <= reach]
            apart = np.abs(np.append(route.arrivals, times[-1:]) - time).min()
            if len(near) and np.ptp(near) > _CHANGE * near.max() and apart > _CHANGE_SPACING / 3:
                times.append(time)
        return np.array(times)

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with the speeds that fit best, few and as they are sent.

        The fit begins once with the plan's speeds, and once `_AHEAD` of them.
        """
        tried = list[Schedule]()
        for ahead in (0.0, _AHEAD):
            tried.append(self._kept(self._at_speeds(first.route, ahead)))
            for n in range(_ROUNDS):
                kept = self._kept(tried[-1].route).route
                if n > 0 and np.array_equal(kept.positions, tried[-1].route.positions):
                    break  # the waypoints are where they were, and so would be the speeds
                tried.append(self.fitted(kept))
        return self.sent(min(tried, key=lambda each: each.cost))
