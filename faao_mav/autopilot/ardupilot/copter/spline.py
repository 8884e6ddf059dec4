"""Spline legs: cubic Hermite curves flown as fast as their bends allow."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits

_SCALE = 4.0
"""The greatest length of both tangents of a spline together, in lengths of its chord. The
autopilot's own."""

_SPACING = 0.5
"""About the distance, m, between the points at which a curve is evaluated. Chosen; what a change
costs is not measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Points (k, 3) of a spline leg, m, with unit tangents (k, 3), and what bounds the speed there.

    `curvature` (k, 3) is the vector d tangent / d length, 1/m; `lengths` (k - 1,) are those between
    the points, m.
    """

    points: Real
    tangents: Real
    curvature: Real
    lengths: Real

    def allowed(self, limits: ArduCopterLimits, speed: float) -> Real:
        """Return the speeds (k,), m/s, within the commanded `speed` across the ground and `limits`.

        At a speed v in a bend v² |curvature| is half the acceleration at most.
        """
        bend = np.maximum(np.linalg.norm(self.curvature, axis=1), 1e-12)
        bent: Real = np.sqrt(_half_acceleration(limits, self.curvature / bend[:, None]) / bend)
        rising = self.tangents[:, 2] >= 0
        vertical = np.where(rising, limits.climb_speed, limits.descent_speed)
        return np.minimum(_within(self.tangents, speed, vertical), bent)


@dataclass(frozen=True, slots=True, eq=False)
class CurvedLeg:
    """A flown spline leg: when (k,), s from its beginning, the target passes the curve's points."""

    curve: Curve
    times: Real
    speeds: Real

    @property
    def duration(self) -> float:
        """From the beginning to the end, s."""
        return float(self.times[-1])

    @property
    def final(self) -> float:
        """The speed at the end, m/s."""
        return float(self.speeds[-1])


def hermite(origin: Real, destination: Real, leaving: Real, arriving: Real) -> Curve:
    """Return the cubic from `origin` to `destination` (3,) with these tangents at the ends."""
    chord = float(np.linalg.norm(destination - origin))
    tangents = float(np.linalg.norm(leaving) + np.linalg.norm(arriving))
    scale = min(1.0, _SCALE * chord / tangents) if tangents > 0 else 1.0
    leaving, arriving = scale * leaving, scale * arriving
    step = destination - origin
    quadratic = 3 * step - 2 * leaving - arriving
    cubic = leaving + arriving - 2 * step
    x = np.linspace(0.0, 1.0, 1 + int(np.clip(np.ceil(chord / _SPACING), 16, 200)))[:, None]
    points = origin + x * (leaving + x * (quadratic + x * cubic))
    # the derivatives vanish at an end at rest: the direction is that of the next order there
    inside = np.clip(x, 1e-6, 1 - 1e-6)
    first = leaving + inside * (2 * quadratic + 3 * inside * cubic)
    second = 2 * quadratic + 6 * inside * cubic
    speed = np.linalg.norm(first, axis=1)[:, None]
    cusp = speed < 1e-9 * chord
    first, speed = np.where(cusp, step, first), np.where(cusp, chord, speed)
    unit = first / speed
    across = second - unit * np.sum(second * unit, axis=1)[:, None]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Curve(points, unit, across / speed**2, lengths)


def flown(
    curve: Curve, limits: ArduCopterLimits, speed: float, start: float, end: float
) -> CurvedLeg:
    """Return how the target moves along `curve` from the speed `start` to at most `end`, m/s.

    The commanded `speed`, m/s, is one across the ground.

    At every point it is at most as fast as the bend allows and as it could brake, over the
    straight line to the end, to `end`; its speed changes by half the acceleration at most.
    """
    slope = _half_acceleration(limits, curve.tangents)
    left = np.linalg.norm(curve.points[-1] - curve.points, axis=1)
    wanted = np.minimum(curve.allowed(limits, speed) ** 2, 2 * slope * left + end**2)
    squares = [start**2]
    for aim, change in zip(
        wanted[1:].tolist(), (2 * slope[1:] * curve.lengths).tolist(), strict=True
    ):
        now = squares[-1]
        squares.append(min(max(aim, now - change), now + change))
    speeds = np.sqrt(np.maximum(squares, 0.0))
    spans = 2 * curve.lengths / np.maximum(speeds[1:] + speeds[:-1], 1e-3)
    return CurvedLeg(curve, np.concatenate([[0.0], np.cumsum(spans)]), speeds)


def _half_acceleration(limits: ArduCopterLimits, directions: Real) -> Real:
    """Return half of the largest accelerations (k,), m/s², along unit vectors (k, 3).

    A spline uses one half along the curve and the other across it.
    """
    return _within(directions, limits.acceleration, limits.climb_acceleration) / 2


def _within(directions: Real, across: float, vertical: Real | float) -> Real:
    ground = np.hypot(directions[:, 0], directions[:, 1])
    up = np.abs(directions[:, 2])
    return np.minimum(across / np.maximum(ground, 1e-12), vertical / np.maximum(up, 1e-12))
