"""Following a velocity within limits of acceleration and jerk, several axes in step."""

import numpy as np

from faao_mav.arrays import Complex, Real

_TINY = 1e-16


def follow(
    velocity: Complex,
    acceleration: Complex,
    setpoint: Complex,
    limit: Real | float,
    jerk: float,
    dt: Real,
) -> tuple[Complex, Complex, Complex]:
    """Return displacement m, velocity and acceleration after `dt` (B,) s of pursuing `setpoint`.

    Velocities, accelerations and setpoints are (n, B), complex: real and imaginary parts are axes
    of their own, each within `limit` ((n, B) or one) m/s² and `jerk` m/s³. Every axis ramps its
    acceleration up, keeps it and ramps it down. With direction such that the velocity must rise,
    initial acceleration a and velocity error e, q² = a²/2 + j e, an axis alone takes
    T = (p + q²/p - a) / j with peak p = min(q, limit). All take the longest T of their variant, so
    the peaks are the roots p of p² - (j T + a) p + q² = 0; an axis that already accelerates more
    keeps that up for as long as it may.
    """
    if _soon(velocity, acceleration, setpoint, jerk, dt):
        after, acceleration_after = setpoint, np.zeros_like(acceleration)
    else:
        after, acceleration_after = _ramped(velocity, acceleration, setpoint, limit, jerk, dt)
    change = acceleration_after - acceleration
    return dt / 2 * (velocity + after) - dt * dt / 12 * change, after, acceleration_after


def _soon(
    velocity: Complex, acceleration: Complex, setpoint: Complex, jerk: float, dt: Real
) -> bool:
    """Tell whether every axis is surely through with its ramps within `dt`: T <= 0.71 dt."""
    shortest = float(dt.min())
    return (
        float(np.abs(acceleration).max()) <= jerk * shortest / 8
        and float(np.abs(setpoint - velocity).max()) <= jerk * shortest * shortest / 16
    )


def _ramped(
    velocity: Complex,
    acceleration: Complex,
    setpoint: Complex,
    limit: Real | float,
    jerk: float,
    dt: Real,
) -> tuple[Complex, Complex]:
    """Return velocity and acceleration after `dt`; times are multiplied by the jerk.

    The acceleration's slope is 1, then 0 from `lasts[0]`, -1 from `lasts[1]` and 0 from
    `lasts[2]`: what is added to or taken off a slope of 1 since then is summed up.
    """
    v, a, target = _axes(velocity), _axes(acceleration), _axes(setpoint)
    most = limit[..., None] if isinstance(limit, np.ndarray) else limit
    time = jerk * dt[:, None]
    rest = target - v - a * np.abs(a) / (2 * jerk)
    sign = np.copysign(1.0, rest)
    start = sign * a
    area = jerk * np.abs(rest)
    ahead = np.maximum(start, 0.0)
    q2 = np.maximum(area + ahead * ahead, _TINY)
    peak = np.minimum(np.sqrt(q2), most)
    total = (peak + q2 / peak - start).max(axis=(0, 2), keepdims=True)
    half = (total + start) / 2
    peak = q2 / (half + np.sqrt(np.maximum(half * half - q2, 0.0)))
    lasts = np.empty((3, *v.shape))
    keeping = peak < start
    if keeping.any():
        coast = np.minimum(area / np.maximum(start, _TINY) + start, total)
        lasts[2] = np.where(keeping, coast, total)
        peak = np.maximum(peak, start)
    else:
        lasts[2] = total
    np.subtract(peak, start, out=lasts[0])
    np.subtract(lasts[2], peak, out=lasts[1])
    level, falling, over = np.maximum(time - lasts, 0.0)
    rise = start + time - level - falling + over
    gain = start * time + (time * time - level * level - falling * falling + over * over) / 2
    return _complex(v + sign * gain / jerk), _complex(sign * rise)


def _axes(values: Complex) -> Real:
    """Return (n, B) complex as (n, B, 2) real."""
    return values.view(np.float64).reshape(*values.shape, 2)


def _complex(axes: Real) -> Complex:
    return np.ascontiguousarray(axes).view(np.complex128)[..., 0]
