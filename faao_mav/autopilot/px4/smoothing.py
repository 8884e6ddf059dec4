"""Following a velocity within limits of acceleration and jerk, several axes in step."""

from math import sqrt
from typing import TypeAlias

_TINY = 1e-16
"""Added to squares of accelerations, so that nothing is divided by 0."""

Axis: TypeAlias = tuple[float, float, float, float]
"""Velocity m/s, acceleration m/s², the velocity that is asked for and the greatest acceleration."""

_Ramp: TypeAlias = tuple[float, float, float, float, float]
"""The direction in which an axis' velocity has to change; in this direction, the acceleration that
it begins with, jerk times the change beyond braking that, q² and jerk times T."""


def soon_there(error: float, acceleration: float, jerk: float, dt: float) -> bool:
    """Tell whether `follow` is surely through within `dt`: T <= 0.71 dt for such small values.

    `error` m/s and `acceleration` m/s² are lengths of vectors: no axis has more.
    """
    step = jerk * dt
    return 16 * jerk * error <= step * step and 8 * acceleration <= step


def follow(axes: list[Axis], jerk: float, dt: float) -> list[tuple[float, float]]:
    """Return each axis' velocity and acceleration after `dt` s of pursuing its setpoint.

    Every axis ramps its acceleration up, keeps it and ramps it down, by `jerk` m/s³. With direction
    such that the velocity must rise, initial acceleration a and velocity error e,
    q² = a²/2 + j e, an axis alone takes T = (p + q²/p - a) / j with peak p = min(q, limit). All
    take the longest T, so the peaks are the roots p of p² - (j T + a) p + q² = 0; an axis that
    already accelerates more keeps that up for as long as it may.
    """
    ramps = [_ramp(axis, jerk) for axis in axes]
    total = max([ramp[-1] for ramp in ramps])
    return [_after(axis[0], ramp, total, jerk, dt) for axis, ramp in zip(axes, ramps, strict=True)]


def _ramp(axis: Axis, jerk: float) -> _Ramp:
    velocity, acceleration, setpoint, limit = axis
    rest = setpoint - velocity - acceleration * abs(acceleration) / (2 * jerk)
    sign = 1.0 if rest >= 0 else -1.0
    start = sign * acceleration
    area = jerk * sign * rest
    q2 = _TINY + area + (start * start if start > 0 else 0.0)
    peak = sqrt(q2)
    if peak > limit:
        peak = limit
    return sign, start, area, q2, peak + q2 / peak - start


def _after(
    velocity: float, ramp: _Ramp, total: float, jerk: float, dt: float
) -> tuple[float, float]:
    """Return velocity and acceleration after `dt`; times are jerk times seconds.

    The acceleration rises until it is at its peak, falls from a later time on and has `end`ed.
    """
    sign, start, area, q2, _ = ramp
    half = (total + start) / 2
    peak = q2 / (half + sqrt(max(half * half - q2, 0.0)))
    end = total
    if peak < start:
        peak = start
        end = min(area / max(start, _TINY) + start, total)
    time = jerk * dt
    rise = start + time
    gain = time * (start + time / 2)
    if (since := time - (peak - start)) > 0:  # at its peak
        rise -= since
        gain -= since * since / 2
    if (since := time - (end - peak)) > 0:  # falling
        rise -= since
        gain -= since * since / 2
    if (since := time - end) > 0:  # over
        rise += since
        gain += since * since / 2
    return velocity + sign * gain / jerk, sign * rise
