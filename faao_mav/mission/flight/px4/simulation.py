"""Flying several variants of one path side by side."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Complex, Real
from faao_mav.mission.flight.px4.guidance import Limits, legs, velocity_setpoint
from faao_mav.mission.flight.px4.response import CHANGES, STATES, TRAJECTORY, Response
from faao_mav.mission.flight.px4.smoothing import follow

STEP = 0.1
"""Longest step of the simulation, s: what was calibrated."""

SWITCH_DELAY = 0.1
"""From reaching a waypoint, or from the end of a hold there, to leaving for the next, s."""

START_LAG = 0.12
"""From the first leg becoming current to the trajectory moving, s. Fitted."""

WANDER = 0.08
"""How far the position estimate strays from the trajectory all the time, m. Fitted."""

_SETTLED = 2e-3
"""Slower than this, m/s, a holding aircraft is taken to stand."""

_TINY = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Variants:
    """`points` (m, 3), m >= 2, and `radii` (m,) of a path; `speeds` (B, m - 1), `holds` (B, m)."""

    points: Real
    radii: Real
    speeds: Real
    holds: Real


@dataclass(frozen=True, slots=True, eq=False)
class Log:
    """`arrivals`, `departures` (B, m) s; at each step time (k, B) and motion (k, n, B).

    Steps are not uniform: they end when a waypoint is left.
    """

    arrivals: Real
    departures: Real
    time: Real
    position: Complex
    velocity: Complex


def simulate(limits: Limits, error_limit: float, variants: Variants, beyond: float) -> Log:
    """Fly every variant until the last one has ended, and on for `beyond` seconds.

    `error_limit` is MPC_XY_ERR_MAX, m: the trajectory's clock runs slower by the share of it that
    the aircraft lags behind.
    """
    flight = _Flight(limits, error_limit, variants)
    while not flight.over(beyond):
        flight.step()
    return flight.log()


class _Flight:
    """All variants under way; arrays are (B,), motion (n, B) with n = 2 if the path climbs."""

    def __init__(self, limits: Limits, error_limit: float, variants: Variants) -> None:
        points, holds = variants.points, variants.holds
        count, self._last = len(holds), len(points) - 2
        self._limits, self._error_limit, self._holds = limits, error_limit, holds
        self._legs = legs(limits, points, variants.radii, variants.speeds, holds)
        self._response = Response(STEP)
        rows = 1 if np.ptp(points[:, 2]) == 0 else 2
        start = np.array([complex(*points[0, :2]), complex(points[0, 2])])[:rows, None]
        self._state: Complex = np.zeros((STATES, rows, count), dtype=np.complex128)
        self._state[0] = self._state[TRAJECTORY] = start
        self._remembered = np.zeros(count)
        self._index = np.zeros(count, dtype=np.int_)
        self._leg = self._legs.of(self._index)
        self._due = np.full(count, np.inf)
        self._waiting = False
        self._whole_step = np.full(count, STEP)
        self._ended = np.zeros(count, dtype=np.bool_)
        self._arrivals = np.zeros((count, len(points)))
        self._departures = np.zeros((count, len(points)))
        self._departures[:, 0] = np.where(holds[:, 0] > 0, holds[:, 0] + SWITCH_DELAY, 0.0)
        self._time = self._departures[:, 0] + START_LAG
        self._far = self._distances()
        self._times, self._motions = [self._time], [self._state[:2]]

    def over(self, beyond: float) -> bool:
        if not self._ended.all():
            return False
        return bool(self._time.min() >= self._departures[:, -1].max() + beyond)

    def log(self) -> Log:
        motion = np.stack(self._motions)
        return Log(
            self._arrivals, self._departures, np.stack(self._times), motion[:, 0], motion[:, 1]
        )

    def step(self) -> None:
        """Go on by at most `STEP` seconds; a variant that leaves a waypoint does so at the end."""
        before, far = self._state, self._far
        dt = self._steps() if self._waiting else self._whole_step
        self._move(dt)
        self._time = self._time + dt
        self._far = self._distances()
        if self._far[0].min() <= 0:
            reached = (self._far <= 0).all(axis=0) & np.isinf(self._due) & ~self._ended
            if reached.any():
                self._reach(np.flatnonzero(reached), dt, before, far)
        if self._waiting:
            leaving = self._due - self._time < _TINY
            if leaving.any():
                self._leave(np.flatnonzero(leaving))
        self._times.append(self._time)
        self._motions.append(self._state[:2])

    def _move(self, dt: Real) -> None:
        state = self._state
        place, velocity, acceleration = state[TRAJECTORY:CHANGES]
        heading = velocity[0] / (np.abs(velocity[0]) + _TINY)
        setpoint, self._remembered = velocity_setpoint(
            self._limits,
            self._leg,
            place + velocity * (dt / 2),
            velocity,
            heading,
            self._remembered,
        )
        shift, after, acceleration_after = follow(
            velocity,
            acceleration,
            setpoint,
            self._acceleration_limits(setpoint),
            self._limits.jerk,
            dt * self._pace(heading),
        )
        state[CHANGES] = shift
        np.subtract(after, velocity, out=state[CHANGES + 1])
        np.subtract(acceleration_after, acceleration, out=state[CHANGES + 2])
        self._state = self._response.advance(state, dt)

    def _pace(self, heading: Complex) -> Real:
        """Return how fast the trajectory's clock runs, (B,): 1 less the lag's share of the limit.

        Being ahead does not count; the estimate's wander makes that a gradual affair.
        """
        lag = self._state[TRAJECTORY, 0] - self._state[0, 0]
        ahead = (lag * heading.conj()).real
        size = np.hypot(np.abs(lag), WANDER)
        behind: Real = size * (1 + ahead / np.hypot(ahead, WANDER)) / 2
        return 1 - np.minimum(behind / self._error_limit, 1.0)

    def _acceleration_limits(self, setpoint: Complex) -> Real | float:
        if len(setpoint) == 1:
            return self._limits.acceleration
        limits = np.full(setpoint.shape, self._limits.acceleration)
        up, down = self._limits.climb_acceleration, self._limits.descent_acceleration
        limits[1] = np.where(setpoint[1].real > 0, up, down)
        return limits

    def _distances(self) -> Real:
        """Return how far each variant is from accepting its target, (n, B) m: 0 and less is in."""
        place = self._state[0]
        across: Real = np.abs(place[0] - self._leg.target) - self._leg.radius
        if len(place) == 1:
            return across[None]
        height = np.abs(place[1].real - self._leg.height) - self._limits.height_radius
        return np.stack([across, height])

    def _steps(self) -> Real:
        """Return how far each variant goes, (B,) s; those that stand skip to the end of a hold."""
        motion = np.abs(self._state[TRAJECTORY + 1]) + np.abs(self._state[1])
        standing = np.isfinite(self._due) & (motion < _SETTLED).all(axis=0)
        self._time = np.where(standing, self._due, self._time)
        return np.minimum(STEP, self._due - self._time)

    def _reach(self, which: NDArray[np.int_], dt: Real, before: Complex, far: Real) -> None:
        """Note arrivals at the moment within the last step at which the target was accepted."""
        near = self._far[:, which]
        approach = far[:, which]
        share = np.where(approach > 0, approach / np.maximum(approach - near, _TINY), 0.0)
        offset = before[0, 0, which] - self._leg.target[which]
        closing = (offset.conj() * before[1, 0, which]).real / np.maximum(np.abs(offset), _TINY)
        share[0] = np.where(
            approach[0] > 0, _crossing(approach[0], closing * dt[which], near[0]), 0.0
        )
        arrival = self._time[which] - dt[which] * (1 - share.max(axis=0))
        point = self._index[which] + 1
        self._arrivals[which, point] = arrival
        self._due[which] = arrival + SWITCH_DELAY + self._holds[which, point]
        self._waiting = True

    def _leave(self, which: NDArray[np.int_]) -> None:
        self._departures[which, self._index[which] + 1] = self._due[which]
        self._due[which] = np.inf
        self._waiting = bool(np.isfinite(self._due).any())
        ended = self._index[which] == self._last
        self._ended[which[ended]] = True
        self._index[which[~ended]] += 1
        self._leg = self._legs.of(self._index)
        self._far = self._distances()


def _crossing(start: Real, slope: Real, end: Real) -> Real:
    """Return where in [0, 1] the parabola through `start` > 0 with `slope` to `end` <= 0 is 0."""
    bend = end - start - slope
    root = np.sqrt(np.maximum(slope * slope - 4 * bend * start, 0.0))
    share: Real = np.clip(2 * start / np.maximum(root - slope, _TINY), 0.0, 1.0)
    return share
