"""Missions for aeroplanes: waypoints that keep the plan's path, then speeds that keep its time.

An aeroplane aims at a point far ahead on its track: it cuts into bends and swings out of them. So
its waypoints are moved against its predicted offsets from the plan, again and again, with more of
them where that is not enough; then the speeds are fitted. It cannot wait, and it is slow to change
its speed: time that it loses it cannot always make up for.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule, positions_at
from faao_mav.schedule.scheduler import Scheduler
from faao_mav.vector import distances_to_path, lengths

_MOVES = 12  # times that the waypoints are moved; twice as many bring a tenth at most

# The share of its offset from the plan by which a waypoint is moved the other way: with more,
# neighbouring waypoints correct the same offset and overdo it.
_MOVE_SHARE = 0.5

_SPLITS = 2  # times that legs are split off which the flight strays too far; chosen
_STRAY = 0.5  # the share of the path tolerance beyond which a leg is split; chosen
_SHORTEST_TIME = 1.5  # the least time from a new waypoint to the next one, s; chosen


@dataclass(frozen=True, slots=True, eq=False)
class PlaneScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that neither waits nor turns on the spot."""

    def _first(self, route: Route) -> Schedule:
        """Return `route`, of ground speeds, with the waypoints that keep the path best.

        Its speeds are the airspeeds to command for the plan's.
        """
        ratio = self.vehicle.type.true_over_commanded(self.vehicle, self.altitude)
        ways = np.diff(route.positions, axis=0)
        ground = ways * (route.speeds / lengths(ways))[:, None]
        speeds = np.clip(lengths(ground - self.wind) / ratio, self.min_speed, self.max_speed)
        best = self._kept(replace(route, speeds=speeds))
        for _ in range(_SPLITS):
            if best.deviation.path <= self.tolerance:
                break
            split = self._kept(self._split(best))
            if split.cost >= best.cost:
                break
            best = split
        return best

    def _kept(self, route: Route) -> Schedule:
        """Return the flight of `route` with its waypoints moved to keep the path best."""
        points = np.arange(route.first + 1, route.last + 1)
        schedule = best = self.flight(route)
        for _ in range(_MOVES):
            schedule = self.flight(self.moved(schedule, points, _MOVE_SHARE))
            if schedule.cost < best.cost:
                best = schedule
        return best

    def _split(self, schedule: Schedule) -> Route:
        """Return the route with a waypoint more on each leg where the flight strays too far."""
        route = schedule.route
        stray = distances_to_path(self.w, schedule.flown.position[:, :2])
        times = []
        for k in range(route.first, route.last):
            begin, end = route.arrivals[k] + _SHORTEST_TIME, route.arrivals[k + 1] - _SHORTEST_TIME
            inside = np.flatnonzero((self.t > begin) & (self.t < end))
            if len(inside) and stray[inside].max() > _STRAY * self.tolerance:
                times.append(float(self.t[inside[np.argmax(stray[inside])]]))
        at = np.searchsorted(route.arrivals, times)
        positions = positions_at(np.array(times), self.t, self.w)
        return route.insert(at, positions, np.array(times), route.speeds[at - 1])

    def refined(self, first: Schedule) -> Schedule:
        """Return `first` with the speeds that fit best, few and as they are sent."""
        fitted = self.fitted(first.route, self.max_speed)
        best = min(first, fitted, key=lambda each: each.cost)
        return self.rounded(self.shared(best, self.max_speed), self.max_speed)
