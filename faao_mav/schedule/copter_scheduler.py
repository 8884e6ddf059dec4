"""Missions for multicopters: as few legs as it takes to keep the plan's time and path.

The initial route's speeds and waits are fitted (`timing`); legs on which the predicted flight is
still too far from the plan at equal times are split there, and all is fitted anew. In the end
legs whose speeds hardly differ share one, and values are rounded to what is sent.

Constants that name no source are chosen; what a change costs is not measured.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.autopilot.vehicle_type import OVERSPEED
from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule
from faao_mav.schedule.scheduler import ALLOWED_ERROR, WORTHWHILE, Scheduler
from faao_mav.schedule.waypoints import SHORTEST_HOVER
from faao_mav.vector import lengths

# The shortest wait at the first waypoint, s. After a hold of 1 s ArduCopter is still drifting and
# leaves 0.4 to 0.75 s late, measured in its simulator.
_FIRST_WAIT = 6.0


_SPEED_SHARE = 0.85  # of the plan's speed at a split, for which both parts must be long enough


@dataclass(frozen=True, slots=True, eq=False)
class CopterScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that waits at hovers and is quick to change its speed.

    Where it would not keep up, speeds are up to a tenth above `max_speed`.
    """

    def _first(self, route: Route) -> Schedule:
        """Return `route` with the speeds and waits that fit best."""
        waits = route.waits.copy()
        waits[0] = max(waits[0], _FIRST_WAIT)
        if route.last == len(waits) - 1:  # it ends at rest, and takes that long to come to it
            waits[-1] = max(waits[-1], SHORTEST_HOVER)
        return self.fitted(replace(route, waits=waits), self.max_speed)

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with more legs where it is off, and values as they are sent."""
        best, top_speed = first, self.max_speed
        if best.error > ALLOWED_ERROR:  # corners cost time that only speed makes up for
            top_speed *= OVERSPEED
            best = self.fitted(best.route, top_speed)
        while len(times := self._split_times(best)):
            tried = self.fitted(self._split(best.route, times), top_speed)
            if tried.cost > WORTHWHILE * best.cost:
                break
            best = tried
        return self.rounded(self.shared(best, top_speed), top_speed)

    def _split(self, route: Route, times: Real) -> Route:
        """Return the route with waypoints more where the plan is at the `times` (k,), s.

        The speeds of the parts of a leg differ as the plan's do: the fit begins with them.
        """
        at, split = np.searchsorted(route.arrivals, times), self.with_waypoints(route, times)
        planned = _planned_speeds(route)
        shares = _planned_speeds(split) / np.insert(planned, at, planned[at - 1])
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


def _planned_speeds(route: Route) -> Real:
    """Return the speed with which the plan moves along each leg, (m - 1,), m/s; none is 0."""
    durations, lengths = route.arrivals[1:] - route.departures[:-1], route.leg_lengths
    speeds: Real = np.maximum(lengths, 1e-9) / np.maximum(durations, 1e-9)
    return speeds
