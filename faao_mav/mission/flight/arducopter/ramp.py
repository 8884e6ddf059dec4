"""Changes of speed within limits of acceleration and jerk, for many flights at once.

The acceleration of a ramp is a trapezoid: it rises for r = a / J + t_j, stays at a, and falls for
r. t_j is what ArduCopter takes beyond the ideal jerk-limited change, for the jerk itself has to
be built up. A change dv that is large enough takes D = dv / A + r; a smaller one never reaches A:
its peak a follows from a²/J + a t_j = dv, and D = 2 r.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real

JERK_LAG = 0.30
"""t_j, s: measured on ArduCopter 4.7."""

_NEWTON = 8
_TINY = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Ramp:
    """Speeds from `v0` to `v1`, m/s, with peak acceleration `a`, m/s², rise `r` and duration, s."""

    v0: Real
    v1: Real
    a: Real
    r: Real
    duration: Real

    @classmethod
    def between(cls, v0: Real, v1: Real, acceleration: float, jerk: float) -> "Ramp":
        """Return the quickest ramp; all arguments broadcast."""
        change = np.abs(v1 - v0)
        peak = jerk * (np.sqrt(JERK_LAG**2 + 4 * change / jerk) - JERK_LAG) / 2
        a = np.minimum(peak, acceleration)
        r = a / jerk + JERK_LAG
        duration = np.where(peak >= acceleration, change / acceleration + r, 2 * r)
        return cls(v0, v1, a, r, np.where(change > _TINY, duration, 0.0))

    @property
    def length(self) -> Real:
        """The way that the ramp takes, m: the mean speed times the duration, by symmetry."""
        return (self.v0 + self.v1) / 2 * self.duration

    def at(self, t: Real) -> tuple[Real, Real]:
        """Return way (m) and speed (m/s) `t` seconds after the beginning; t (..., k).

        Before it the way is 0, after it that of the whole ramp.
        """
        v0, a, r, duration = (x[..., None] for x in (self.v0, self.a, self.r, self.duration))
        sign = np.where(self.v1 >= self.v0, 1.0, -1.0)[..., None]
        t = np.clip(t, 0.0, duration)
        rise = np.minimum(t, r)
        flat = np.clip(t - r, 0.0, np.maximum(duration - 2 * r, 0.0))
        fall = np.clip(t - (duration - r), 0.0, r)
        first, second = a * r / 2, a * (r / 2 + np.maximum(duration - 2 * r, 0.0))
        way = a * rise**3 / (6 * r) + (first + a * flat / 2) * flat
        way += second * fall + a * fall**2 / 2 - a * fall**3 / (6 * r)
        gain = a * rise**2 / (2 * r) + a * flat + a * fall - a * fall**2 / (2 * r)
        return v0 * t + sign * way, v0 + sign * gain

    def time_to(self, way: Real) -> Real:
        """Return how long a ramp from rest takes for `way` (m), at most half its duration, s."""
        a, r = self.a, np.maximum(self.r, _TINY)
        rising = np.cbrt(6 * r * way / np.maximum(a, _TINY))
        beyond = np.maximum(way - a * r**2 / 6, 0.0) / np.maximum(a, _TINY)
        flat = r - r / 2 + np.sqrt(r**2 / 4 + 2 * beyond)
        return np.minimum(np.where(rising <= r, rising, flat), self.duration / 2)


def top_speed(length: Real, speed: Real, acceleration: float, jerk: float) -> Real:
    """Return the speed, at most `speed`, that a leg of `length` (m) reaches from rest to rest.

    The leg has to hold both ramps: v D(v) <= length.
    """
    lag = acceleration / jerk + JERK_LAG
    long = acceleration * (np.sqrt(lag**2 + 4 * length / acceleration) - lag) / 2
    # 2 a (a / J + t_j)² = length for the peak a of ramps that do not reach the limit; from above
    # this cubic is convex, and Newton's method falls on its root
    a = np.cbrt(length * jerk**2 / 2)
    for _ in range(_NEWTON):
        r = a / jerk + JERK_LAG
        a = a - (2 * a * r**2 - length) / (2 * r**2 + 4 * a * r / jerk)
    short = a * (a / jerk + JERK_LAG)
    return np.minimum(speed, np.where(long >= acceleration * lag, long, short))
