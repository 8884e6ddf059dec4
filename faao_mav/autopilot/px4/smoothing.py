"""Following a velocity within limits of acceleration and jerk, several axes in step.

Every axis ramps its acceleration up, keeps it and ramps it down, by the jerk j. With direction such
that the velocity must rise, acceleration a and velocity error e, q² = a²/2 + j e, an axis alone
takes T = (p + q²/p - a) / j with the peak p = min(q, limit). All take the longest T, so the peaks
are the roots p of p² - (j T + a) p + q² = 0; one that already accelerates more keeps that up.
"""

from collections.abc import Sequence
from math import copysign, sqrt
from typing import NamedTuple

_TINY = 1e-16
"""Added to squares of accelerations, so that nothing is divided by 0."""


class Axis(NamedTuple):
    """Position, m, velocity, m/s, and acceleration, m/s², along one axis."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


def follow(
    axes: Sequence[Axis],
    setpoints: Sequence[float],
    limits: Sequence[float],
    jerk: float,
    dt: float,
) -> list[Axis]:
    """Return the axes after `dt` s of pursuing the velocities `setpoints`, m/s.

    `limits` are the greatest accelerations, m/s².
    """
    ramps = []
    for axis, setpoint, limit in zip(axes, setpoints, limits, strict=True):
        a = axis.acceleration
        rest = setpoint - axis.velocity - a * abs(a) / (2 * jerk)
        start = a if rest >= 0 else -a
        square = _TINY + jerk * abs(rest) + max(start, 0.0) ** 2
        peak = min(sqrt(square), limit)
        ramps.append((start, square, peak + square / peak - start))
    total = max([ramp[-1] for ramp in ramps])
    after = []
    for axis, setpoint, (start, square, _) in zip(axes, setpoints, ramps, strict=True):
        half = (total + start) / 2
        peak = max(square / (half + sqrt(max(half * half - square, 0.0))), start)
        after.append(_stepped(axis, setpoint, peak, jerk, dt))
    return after


def _stepped(axis: Axis, setpoint: float, peak: float, jerk: float, dt: float) -> Axis:
    """Return `axis` after `dt` s: it accelerates by `peak` at most.

    At the end of the step it accelerates as much as it loses, by the jerk, until it is there.
    """
    position, velocity, a = axis
    error = setpoint - velocity - a * dt / 2
    most = jerk * (sqrt(dt * dt + 2 * abs(error) / jerk) - dt)
    goal = copysign(min(peak, most), error)
    change = min(max(goal - a, -jerk * dt), jerk * dt)
    moved = (velocity + a * dt / 2 + change * dt / 6) * dt
    return Axis(position + moved, velocity + (a + change / 2) * dt, a + change)
