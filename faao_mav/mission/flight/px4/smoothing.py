"""Following a velocity within limits of acceleration and jerk, several axes in step."""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

_TINY = 1e-16


class Axis(NamedTuple):
    """What one axis moves with and is to reach, m/s and m/s², and its limit, m/s²."""

    velocity: float
    acceleration: float
    setpoint: float
    limit: float


class _Ramp(NamedTuple):
    """An axis seen in the direction in which its velocity has to change; times are times jerk."""

    sign: float
    start: float
    area: float
    q2: float
    lasting: float


def soon_there(error: float, acceleration: float, jerk: float, dt: float) -> bool:
    """Tell whether `follow` is surely through within `dt`: T <= 0.71 dt for such small values.

    `error` m/s and `acceleration` m/s² are lengths of vectors: each axis has no more.
    """
    step = jerk * dt
    return 16 * jerk * error <= step * step and 8 * acceleration <= step


def follow(axes: Sequence[Axis], jerk: float, dt: float) -> list[tuple[float, float]]:
    """Return each axis' velocity and acceleration after `dt` s of pursuing its setpoint.

    Every axis ramps its acceleration up, keeps it and ramps it down, by `jerk` m/s³. With direction
    such that the velocity must rise, initial acceleration a and velocity error e,
    q² = a²/2 + j e, an axis alone takes T = (p + q²/p - a) / j with peak p = min(q, limit). All
    take the longest T, so the peaks are the roots p of p² - (j T + a) p + q² = 0; an axis that
    already accelerates more keeps that up for as long as it may.
    """
    ramps = [_ramp(axis, jerk) for axis in axes]
    total = max([ramp.lasting for ramp in ramps])
    return [_after(axis, ramp, total, jerk, dt) for axis, ramp in zip(axes, ramps, strict=True)]


def _ramp(axis: Axis, jerk: float) -> _Ramp:
    velocity, acceleration, setpoint, limit = axis
    rest = setpoint - velocity - acceleration * abs(acceleration) / (2 * jerk)
    sign = 1.0 if rest >= 0 else -1.0
    start = sign * acceleration
    area = q2 = jerk * abs(rest)
    if start > 0:
        q2 += start * start
    q2 = max(q2, _TINY)
    peak = min(sqrt(q2), limit)
    return _Ramp(sign, start, area, q2, peak + q2 / peak - start)


def _after(axis: Axis, ramp: _Ramp, total: float, jerk: float, dt: float) -> tuple[float, float]:
    """Return velocity and acceleration after `dt`.

    The acceleration's slope is 1; from `level`, `falling` and `over` ago on 1 less, 1 less, 1 more.
    """
    sign, start, area, q2, _ = ramp
    half = (total + start) / 2
    peak = q2 / (half + sqrt(max(half * half - q2, 0.0)))
    end = total
    if peak < start:
        end = min(area / max(start, _TINY) + start, total)
        peak = start
    time = jerk * dt
    level = max(time - peak + start, 0.0)
    falling = max(time - end + peak, 0.0)
    over = max(time - end, 0.0)
    rise = start + time - level - falling + over
    gain = start * time + (time * time - level * level - falling * falling + over * over) / 2
    return axis.velocity + sign * gain / jerk, sign * rise
