"""A route for an aeroplane whose predicted flight keeps the plan's path, then its time.

An aeroplane aims at a point far ahead on its track: it cuts into bends and swings out of them. So
its waypoints are moved by what the predicted flight strays, again and again; then the speeds are
fitted. It cannot wait, and it is slow to change its speed: what it loses it cannot always make up.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule
from faao_mav.schedule.scheduler import Scheduler

_MOVES = 12
_GAIN = 0.5
"""Of what the aircraft strays: more, and neighbouring waypoints overdo it together."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaneScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that neither waits nor turns on the spot."""

    def first(self, route: Route) -> Schedule:
        """Return `route` with the waypoints that keep the path best, at the plan's speeds."""
        points = np.arange(route.first + 1, route.last + 1)
        positions = route.positions.copy()
        now = best = self.flight(route)
        for _ in range(_MOVES):
            positions[points] -= _GAIN * self.astray(now, points)
            now = self.flight(replace(route, positions=positions.copy()))
            if now.cost < best.cost:
                best = now
        return best

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with the speeds that fit best, few and as they are sent."""
        fitted = self.fitted(first.route, self.max_speed)
        best = min(first, fitted, key=lambda each: each.cost)
        return self.rounded(self.shared(best, self.max_speed), self.max_speed)
