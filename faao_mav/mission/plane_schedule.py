"""A route for an aeroplane whose predicted flight keeps the plan's path, then its time.

An aeroplane aims at a point far ahead on its track: it cuts into bends and swings out of them. So
its waypoints are moved by what the predicted flight strays, again and again; then the speeds are
fitted. It cannot wait, and it is slow to change its speed: what it loses it cannot always make up.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.route import Route
from faao_mav.mission.schedule import Schedule, Scheduler
from faao_mav.mission.vector import lengths

_MOVES = 12
_GAIN = 0.5
"""Of what the aircraft strays: more, and neighbouring waypoints overdo it together."""

_PASSING = 6.0
"""Seconds about the planned time in which the aircraft passes a waypoint: it may come twice."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaneScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that neither waits nor turns on the spot."""

    def first(self, route: Route) -> Schedule:
        """Return `route` with the waypoints that keep the path best, at the plan's speeds."""
        planned = route.positions
        now = best = self.flight(route)
        for _ in range(_MOVES):
            astray = self._astray(now, planned)
            now = self.flight(replace(route, positions=now.route.positions - _GAIN * astray))
            if now.cost < best.cost:
                best = now
        return best

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with the speeds that fit best, few and as they are sent."""
        fitted = self.fitted(first.route, self.max_speed)
        best = min(first, fitted, key=lambda each: each.cost)
        return self.rounded(self.shared(best, self.max_speed), self.max_speed)

    def _astray(self, found: Schedule, planned: Real) -> Real:
        """Return how far the flight passes from the `planned` waypoints (m, 2), (m, 2) m.

        Those before and at w_I, and after w_F, stay: they are no part of the path's bends.
        """
        route, flown = found.route, found.flown
        start = found.clock.start(flown) - self.t[0]
        result = np.zeros_like(planned)
        for k in range(route.first + 1, route.last + 1):
            about = route.arrivals[k] + start
            first, last = np.searchsorted(flown.t, [about - _PASSING, about + _PASSING])
            near = flown.position[first:last, :2]
            if len(near):
                result[k] = near[np.argmin(lengths(near - planned[k]))] - planned[k]
        return result
