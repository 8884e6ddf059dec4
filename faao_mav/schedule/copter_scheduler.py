"""Missions for multicopters: as few legs as it takes to keep the plan's time and path.

The initial route's speeds and waits are fitted (`timing`); legs on which the predicted flight is
still too far from the plan at equal times are split there, and all is fitted anew. In the end
legs whose speeds hardly differ share one, and values are rounded to what is sent.

Constants that name no source are chosen; what a change costs is not measured.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Flags, Integers
from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule
from faao_mav.schedule.scheduler import ALLOWED_ERROR, Scheduler
from faao_mav.vector import lengths

_MOST_WAYPOINTS = 24
"""The most waypoints that splitting legs leads to; the path itself may take more."""

_OVERSPEED = 1.1
"""The greatest commanded speed as a share of the plan's, where the aircraft falls behind."""

_FIRST_WAIT = 6.0
"""The shortest wait at the first waypoint, s.

After a hold of 1 s ArduCopter is still drifting and leaves 0.4 to 0.75 s late, in its simulator.
"""

_LAST_WAIT = 3.0
"""The shortest wait at w_F while speeds are fitted, s: the aircraft comes to rest there."""

_ROUNDS = 5
"""The most rounds of splitting legs, and of moving waypoints."""

_WORTHWHILE = 0.98
"""The share of its cost below which a round has to bring a schedule for another to follow."""

_SPEED_SHARE = 0.85
"""The share of the plan's speed at a split for which both parts of the leg must be long enough."""

_MOVE_SHARE = 0.8
"""The share of its offset from the plan by which a waypoint is moved the other way."""


@dataclass(frozen=True, slots=True, eq=False)
class CopterScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that waits at hovers and is quick to change its speed.

    Where it would not keep up, speeds are up to a tenth above `max_speed`.
    """

    def _first(self, route: Route) -> Schedule:
        """Return `route` with the speeds and waits that fit best."""
        waits = route.waits.copy()
        waits[0] = max(waits[0], _FIRST_WAIT)
        if route.last == len(waits) - 1:  # it ends at rest
            waits[-1] = max(waits[-1], _LAST_WAIT)
        return self.fitted(replace(route, waits=waits), self.max_speed)

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with more legs where it is off, and values as they are sent."""
        best, top_speed = first, self.max_speed
        if best.error > ALLOWED_ERROR:  # corners cost time that only speed makes up for
            top_speed *= _OVERSPEED
            best = self.fitted(best.route, top_speed)
        for _ in range(_ROUNDS):
            finer = self._with_splits(best, top_speed)
            if finer is None:
                break
            best = finer
        for _ in range(_ROUNDS):
            if best.deviation.path <= self.tolerance and not best.route.splines.any():
                break
            moved = self._with_moves(best, top_speed)
            if moved.cost > _WORTHWHILE * best.cost:
                break
            best = moved
        return self.rounded(self.shared(best, top_speed), top_speed)

    def _with_splits(self, schedule: Schedule, top_speed: float) -> Schedule | None:
        """Return `schedule` with the legs split that are off by too much, None if that is no use.

        A leg may become too short for its speed: then fewer splits can be better than all.
        """
        route, times = schedule.route, self._split_times(schedule)
        for count in dict.fromkeys((len(times), len(times) // 2, 1)):
            if 0 < count <= len(times):
                chosen = np.array(sorted(times[:count]))
                at = np.searchsorted(route.arrivals, chosen)
                positions = np.column_stack([np.interp(chosen, self.t, x) for x in self.w.T])
                split = route.insert(at, positions, chosen, route.speeds[at - 1])
                finer = self.fitted(split, top_speed)
                if finer.cost <= _WORTHWHILE * schedule.cost:
                    return finer
        return None

    def _split_times(self, schedule: Schedule) -> list[float]:
        """Return the plan's times, s, at which legs that are off by too much are best split.

        The leg that is off the most comes first.
        """
        route = schedule.route
        off = lengths(schedule.positions(self.t - self.t[0]) - self.w)
        splits = []
        for k in range(route.first, route.last):
            if route.splines[k + 1]:
                continue
            inside = np.flatnonzero(
                (self.t > route.departures[k]) & (self.t < route.arrivals[k + 1])
            )
            usable = inside[self._long_enough(route, k, inside)]
            if len(usable) and off[inside].max() > ALLOWED_ERROR:
                at = usable[np.argmax(off[usable])]
                splits.append((float(off[inside].max()), float(self.t[at])))
        splits.sort(reverse=True)
        most = max(0, _MOST_WAYPOINTS - len(route.positions))
        return [time for _, time in splits[:most]]

    def _long_enough(self, route: Route, k: int, inside: Integers) -> Flags:
        """Tell for each sample `inside` leg k whether both parts are long enough for their speed.

        On a part much shorter than its ramps the aircraft is slower than planned at the split.
        """
        planned_speed = lengths(self.w[inside + 1] - self.w[inside - 1])
        planned_speed /= self.t[inside + 1] - self.t[inside - 1]
        legs, result = self.vehicle.legs, np.ones(len(inside), dtype=bool)
        parts = (
            (route.positions[k], self.t[inside] - route.departures[k]),
            (route.positions[k + 1], route.arrivals[k + 1] - self.t[inside]),
        )
        for end, duration in parts:
            length = lengths(self.w[inside] - end)
            speed = np.maximum(length / duration, _SPEED_SHARE * planned_speed)
            result &= length >= np.maximum(legs.shortest_leg(speed), legs.least)
        return result

    def _with_moves(self, schedule: Schedule, top_speed: float) -> Schedule:
        """Return `schedule` with waypoints moved against the aircraft's offset from the plan.

        ArduPilot's swings wide in splines, for it is not told what turning takes; PX4's cuts
        corners with wide acceptance radii.
        """
        route = schedule.route
        movable = (route.splines | (route.radii > 0)) & (route.waits == 0)
        points = np.arange(route.first + 1, route.last)
        points = points[movable[points]]
        positions = route.positions.copy()
        positions[points] -= _MOVE_SHARE * self.offsets(schedule, points)
        return self.fitted(replace(route, positions=positions), top_speed)
