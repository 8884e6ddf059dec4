"""Following a velocity within limits of acceleration and jerk, several axes in step."""

import numpy as np

from faao_mav.arrays import Complex, Real

_TINY = 1e-16


def follow(
    velocity: Complex, acceleration: Complex, setpoint: Complex, limit: Real, jerk: float, dt: Real
) -> tuple[Complex, Complex, Complex]:
    """Return displacement m, velocity and acceleration after `dt` (B,) s of pursuing `setpoint`.

    Velocities, accelerations and setpoints are (n, B), complex: real and imaginary parts are axes
    of their own, each within `limit` (n, B) m/s² and `jerk` m/s³. Every axis ramps its
    acceleration up, keeps it and ramps it down. With direction such that the velocity must rise,
    initial acceleration a and velocity error e, q² = a²/2 + j e, an axis alone takes
    T = (p + q²/p - a) / j with peak p = min(q, limit). All take the longest T of their variant, so
    the peaks are the roots p of p² - (j T + a) p + q² = 0; an axis that already accelerates more
    keeps that up for as long as it may.
    """
    v, a, target = _axes(velocity), _axes(acceleration), _axes(setpoint)
    most, time = limit[..., None], dt[:, None]
    error = target - v
    rest = error - a * np.abs(a) / (2 * jerk)
    sign = np.copysign(1.0, rest)
    start = sign * a
    q2 = np.maximum(start * start / 2 + jerk * sign * error, _TINY)
    peak = np.minimum(np.sqrt(q2), most)
    total = ((peak + q2 / peak - start) / jerk).max(axis=(0, 2), keepdims=True)
    reach = jerk * total + start
    peak = 2 * q2 / (reach + np.sqrt(np.maximum(reach * reach - 4 * q2, 0.0)))
    coast = np.abs(rest) / np.maximum(start, _TINY) + start / jerk
    end = np.where(peak < start, np.minimum(coast, total), total)
    peak = np.minimum(np.maximum(peak, start), most)
    rising = np.minimum(time, (peak - start) / jerk)
    falling_from = np.maximum(np.minimum(time, end - peak / jerk), rising)
    falling = np.maximum(np.minimum(time, end), falling_from) - falling_from
    drop = np.minimum(falling * jerk, peak)
    gain = rising * (start + jerk * rising / 2) + peak * (falling_from - rising)
    after = _complex(v + sign * (gain + falling * (peak - drop / 2)))
    left = np.where(time >= end, 0.0, np.minimum(start + jerk * time, peak) - drop)
    acceleration_after = _complex(sign * left)
    change = acceleration_after - acceleration
    return dt / 2 * (velocity + after) - dt * dt / 12 * change, after, acceleration_after


def _axes(values: Complex) -> Real:
    """Return (n, B) complex as (n, B, 2) real."""
    return values.view(np.float64).reshape(*values.shape, 2)


def _complex(axes: Real) -> Complex:
    return np.ascontiguousarray(axes).view(np.complex128)[..., 0]
