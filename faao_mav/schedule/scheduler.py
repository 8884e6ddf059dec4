"""What finds speeds, waits and waypoints with which the predicted flight keeps the plan.

Constants that name no source are chosen; what a change costs is not measured.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.autopilot import Model, Vehicle
from faao_mav.errors import InputError
from faao_mav.plan import Vector
from faao_mav.schedule.route import Route, sent_speeds, with_run_in
from faao_mav.schedule.schedule import Schedule, positions_at
from faao_mav.schedule.timing import SHORTEST_HOLD, Goal, Retimed, Unknowns, stepped

# The position error at equal times, m, that is left as it is. Repeats of one flight in ArduCopter's
# simulator differ by up to 0.4 m rms.
ALLOWED_ERROR = 0.8

WORTHWHILE = 0.95  # the largest ratio of the costs after and before a change that is kept

_LEAST_GAIN = 0.1  # the share of the sum of squares that a flight saves for another one to follow

_ALIKE = 0.1  # the relative difference of neighbours' speeds that are tried as one


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

    def first(self, route: Route) -> Schedule:
        """Return `route`, with the run-in that the plan needs, in its first fit to the plan."""
        return self._first(with_run_in(route, self.t, self.w, self.model, self.max_speed))

    @abstractmethod
    def _first(self, route: Route) -> Schedule: ...

    @abstractmethod
    def refined(self, first: Schedule) -> Schedule:
        """Return `first` brought closer to the plan, with values as they are sent."""

    def flight(self, route: Route) -> Schedule:
        """Return the predicted flight of `route`, which is rounded for it."""
        route = self._with_radii(route.rounded())
        path = route.path(altitude=self.altitude, wind=self.wind)
        return Schedule(route, self.model.fly(path), self.t, self.w, self.tolerance)

    def fitted(self, route: Route, top_speed: float, *, groups: Integers | None = None) -> Schedule:
        """Return the flight of `route` with the speeds, the waits and the lead that fit best.

        No speed is above `top_speed`, m/s; legs with the same number in `groups` share one.
        """
        if len(route.speeds) == 0:
            return self.flight(route)
        groups = np.arange(len(route.speeds)) if groups is None else groups
        unknowns, goal = Unknowns(route, groups, self.min_speed, top_speed), Goal(self.t, self.w)
        x = unknowns.initial
        best = self.flight(unknowns.commanded(x))
        cost = goal.cost(best)
        before = math.inf
        while cost < (1 - _LEAST_GAIN) * before:
            known = self.model.leg_durations(best.route.leg_lengths, best.route.joined)
            tried, foreseen = stepped(goal, unknowns, Retimed(best, known), x)
            if foreseen > (1 - _LEAST_GAIN) * cost:
                break
            try:
                flown = self.flight(unknowns.commanded(tried))
            except InputError:  # it is not followed to its end
                break
            before, now = cost, goal.cost(flown)
            if now >= before:
                break
            x, best, cost = tried, flown, now
        return best

    def with_waypoints(self, route: Route, times: Real) -> Route:
        """Return the route with a waypoint more where the plan is at each of `times` (k,), s."""
        at = np.searchsorted(route.arrivals, times)
        positions = positions_at(times, self.t, self.w)
        return route.insert(at, positions, times, route.speeds[at - 1])

    def shared(self, schedule: Schedule, top_speed: float) -> Schedule:
        """Return `schedule` with one speed for neighbouring legs wherever that hardly costs."""
        groups = _speed_groups(schedule.route.speeds)
        if len(groups) == 0 or groups[-1] == len(groups) - 1:
            return schedule
        shared = self.fitted(schedule.route, top_speed, groups=groups)
        most = max(schedule.cost / WORTHWHILE, ALLOWED_ERROR / 2)
        return shared if shared.cost <= most else schedule

    def rounded(self, schedule: Schedule, top_speed: float) -> Schedule:
        """Return `schedule` with the values that are sent, and a last wait to the plan's end."""
        route = schedule.route
        waits = route.waits.copy()
        if route.last == len(waits) - 1:  # it ends at rest, and the plan with its last slot
            end = 2 * self.t[-1] - self.t[-2]
            early = end + schedule.start - schedule.flown.arrivals[-1]
            waits[-1] = max(SHORTEST_HOLD, np.ceil(early))
        speeds = sent_speeds(route.speeds, top_speed)
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
