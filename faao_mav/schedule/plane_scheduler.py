"""Missions for aeroplanes: waypoints that keep the plan's path, then speeds that keep its time.

An aeroplane aims at a point far ahead on its track: it cuts into bends and swings out of them. So
its waypoints are moved against its predicted offsets from the plan, again and again; then the
speeds are fitted. It cannot wait, and it is slow to change its speed: time that it loses it cannot
always make up for.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule
from faao_mav.schedule.scheduler import Scheduler

_MOVES = 12  # times that the waypoints are moved; chosen, what more would bring is not measured

# The share of its offset from the plan by which a waypoint is moved the other way: with more,
# neighbouring waypoints correct the same offset and overdo it.
_MOVE_SHARE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class PlaneScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that neither waits nor turns on the spot."""

    def _first(self, route: Route) -> Schedule:
        """Return `route` with the waypoints that keep the path best, at the plan's speeds."""
        points = np.arange(route.first + 1, route.last + 1)
        schedule = best = self.flight(route)
        for _ in range(_MOVES):
            schedule = self.flight(self.moved(schedule, points, _MOVE_SHARE))
            if schedule.cost < best.cost:
                best = schedule
        return best

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with the speeds that fit best, few and as they are sent."""
        fitted = self.fitted(first.route, self.max_speed)
        best = min(first, fitted, key=lambda each: each.cost)
        return self.rounded(self.shared(best, self.max_speed), self.max_speed)
