"""Spline legs: cubic Hermite curves flown as fast as their bends allow."""

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits

_SCALE = 4.0
"""The greatest length of both tangents of a spline together, in lengths of its chord. The
autopilot's own."""

_SPACING = 0.5
"""About the distance, m, between the points at which a curve is evaluated. Chosen; what a change
costs is not measured."""


def within(ways: Real, across: Real | float, vertical: Real | float) -> Real:
    """Return the largest values (k,) along unit vectors `ways` (k, 3) that keep both limits."""
    ground, up = np.hypot(ways[:, 0], ways[:, 1]), np.abs(ways[:, 2])
    return np.minimum(across / np.maximum(ground, 1e-12), vertical / np.maximum(up, 1e-12))


def speed_along(ways: Real, speeds: Real | float, limits: ArduCopterLimits) -> Real:
    """Return the greatest speeds (k,), m/s, where `speeds` across the ground are commanded."""
    vertical = np.where(ways[:, 2] >= 0, limits.climb_speed, limits.descent_speed)
    return within(ways, speeds, vertical)


class Curve:
    """Points (k, 3), m, of the leg to spline waypoint `to`, with unit `tangents` (k, 3).

    It leaves along the leg before, or as the spline before arrived, and arrives parallel to the
    line from its origin to the point after, or, before a straight leg, along that leg; where the
    aircraft stops it has no tangent. No place is faster than its `allowed` (k,), m/s: at a speed v
    in a bend v² |curvature| is half the acceleration at most. `fly` sets the `speeds` (k,), m/s,
    with which the target passes the points, and when, `times` (k,), s from the beginning.
    """

    def __init__(
        self,
        to: int,
        points: Real,
        splines: Flags,
        stopping: Flags,
        limits: ArduCopterLimits,
        speed: float,
    ) -> None:
        k, steps = to - 1, np.diff(points, axis=0)
        step, leaving, arriving = steps[k], np.zeros(3), np.zeros(3)
        if not stopping[k]:
            leaving = steps[k - 1] + (step if splines[k] else 0.0)
        if not stopping[to]:
            arriving = steps[to] + (step if splines[to + 1] else 0.0)
        chord = float(np.linalg.norm(step))
        tangents = float(np.linalg.norm(leaving) + np.linalg.norm(arriving))
        scale = min(1.0, _SCALE * chord / tangents) if tangents > 0 else 1.0
        leaving, arriving = scale * leaving, scale * arriving
        quadratic, cubic = 3 * step - 2 * leaving - arriving, leaving + arriving - 2 * step
        x = np.linspace(0.0, 1.0, 1 + int(np.clip(np.ceil(chord / _SPACING), 16, 200)))[:, None]
        self.points = points[k] + x * (leaving + x * (quadratic + x * cubic))
        # the derivatives vanish at an end at rest: the direction is that of the next order there
        inside = np.clip(x, 1e-6, 1 - 1e-6)
        first = leaving + inside * (2 * quadratic + 3 * inside * cubic)
        second = 2 * quadratic + 6 * inside * cubic
        rate = np.linalg.norm(first, axis=1)[:, None]
        cusp = rate < 1e-9 * chord
        first, rate = np.where(cusp, step, first), np.where(cusp, chord, rate)
        self.tangents = first / rate
        across = second - self.tangents * np.sum(second * self.tangents, axis=1)[:, None]
        bend = np.maximum(np.linalg.norm(across / rate**2, axis=1), 1e-12)
        own = limits.acceleration, limits.climb_acceleration
        bent = within(across / rate**2 / bend[:, None], *own) / 2
        self.allowed = np.minimum(speed_along(self.tangents, speed, limits), np.sqrt(bent / bend))
        self._slope = within(self.tangents, *own) / 2
        self.times = self.speeds = np.zeros(len(x))

    def fly(self, start: float, end: float) -> None:
        """Set `times` and `speeds` from the speed `start` to at most `end`, m/s.

        At every point it is at most as fast as it could brake, over the straight line to the end,
        to `end`; its speed changes by half the acceleration at most.
        """
        lengths = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        left = np.linalg.norm(self.points[-1] - self.points, axis=1)
        wanted = np.minimum(self.allowed**2, 2 * self._slope * left + end**2)
        squares = [start**2]
        for aim, change in zip(wanted[1:], 2 * self._slope[1:] * lengths, strict=True):
            squares.append(min(max(aim, squares[-1] - change), squares[-1] + change))
        self.speeds = np.sqrt(np.maximum(squares, 0.0))
        spans = 2 * lengths / np.maximum(self.speeds[1:] + self.speeds[:-1], 1e-3)
        self.times = np.concatenate([[0.0], np.cumsum(spans)])

    def motion(self, t: Real) -> Real:
        """Return place and velocity (n, 6), SI, at the times `t` (n,), s from the beginning."""
        told = np.hstack([self.points, self.tangents * self.speeds[:, None]])
        return np.stack([np.interp(t, self.times, column) for column in told.T], axis=-1)
