"""Missions for aeroplanes: waypoints that keep the plan's path, then speeds that keep its time.

An aeroplane aims at a point far ahead on its track: it cuts into bends and swings out of them. So
its waypoints are moved against its predicted offsets from the plan, again and again; then the
speeds are fitted. Waypoints are judged by the path alone:
the speeds mend the time. The aircraft cannot wait, and it is slow to change its speed: a change
begins legs before the plan's, and time that is lost it cannot always make up for.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import PASSING_WINDOW, Schedule, positions_at
from faao_mav.schedule.scheduler import Scheduler
from faao_mav.vector import lengths

_MOVES = 12  # times that the waypoints are moved; twice as many bring a tenth at most

# The share of its offset from the plan by which a waypoint is moved the other way: with more,
# neighbouring waypoints correct the same offset and overdo it.
_MOVE_SHARE = 0.5

_ROUNDS = 3  # times that waypoints are moved and speeds fitted, in turn; chosen
# Where the plan's speed changes by more than this share, its legs are split so often, s; chosen.
_CHANGE, _CHANGE_SPACING = 0.05, 5.0


@dataclass(frozen=True, slots=True, eq=False)
class PlaneScheduler(Scheduler):
    """As `Scheduler`, for an aircraft that neither waits nor turns on the spot."""

    def _first(self, route: Route) -> Schedule:
        """Return `route`, of ground speeds, with the waypoints that keep the path best.

        Its speeds are the airspeeds to command for the plan's.
        """
        ratio = self.model.true_over_commanded(self.altitude)
        route = self.with_waypoints(route, self._changes(route))
        ways = np.diff(route.positions, axis=0)
        ground = ways * (route.speeds / lengths(ways))[:, None]
        speeds = np.clip(lengths(ground - self.wind) / ratio, self.min_speed, self.max_speed)
        return self._kept(replace(route, speeds=speeds))

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
        """Return `first` with the speeds that fit best, few and as they are sent."""
        tried = [first]
        for _ in range(_ROUNDS):
            kept = self._kept(tried[-1].route).route
            if len(tried) > 1 and np.array_equal(kept.positions, tried[-1].route.positions):
                break  # the waypoints are where they were, and so would be the speeds
            tried.append(self.fitted(kept, self.max_speed))
        best = min(tried, key=lambda each: each.cost)
        return self.rounded(self.shared(best, self.max_speed), self.max_speed)
