"""The limits of an aircraft: speed, acceleration, airspeed, their changes and turns.

    (1 - ||v_n||^2) / 2 >= 0,  (1 - ||a_n||^2) / 2 >= 0,  (||v_n - u||^2 - least^2) / 2 >= 0

in the wind u, and the greatest airspeed as the first. Thrust and drag limit how the airspeed
s_n = ||v_n - u|| changes, guidance how fast the path turns over ground: see `Kinematics`.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import TINY, A, Constraint, Rows, V
from faao_mav.plan import Vector


@dataclass(frozen=True)
class Disc(Constraint):
    """g(x) = `side` (||x - wind||^2 - `radius`^2) / 2 of a velocity or an acceleration x.

    With a `side` of -1 x stays in the disc, with 1 outside.
    """

    of: tuple[int, ...]  # type: ignore[misc]
    radius: float = 1.0
    wind: Vector = (0.0, 0.0)
    side: float = -1.0

    def rows(self, x: Real) -> Rows:
        """Return g."""
        away = x - np.reshape(self.wind, (2, 1))
        value = self.side * ((away * away).sum(axis=0) - self.radius**2) / 2
        bend = np.broadcast_to(self.side * np.eye(2)[None, :, :, None], (1, 2, 2, x.shape[1]))
        return Rows(value[None], self.side * away[None], bend)


@dataclass(frozen=True)
class SpeedChange(Constraint):
    """In a slot the airspeed falls by at most `fall`, and half its square rises by `rise`.

    In v_max and its square; so is `wind`. `gain` is what a_max changes in a slot.
    """

    gain: float
    fall: float
    rise: float
    wind: Vector
    of = V + A

    def rows(self, x: Real) -> Rows:
        """Return 1 - (s_n - s_{n+1}) / fall and 1 - (s_{n+1}^2 - s_n^2) / (2 rise)."""
        v = x[:2] - np.reshape(self.wind, (2, 1))
        ends = np.stack([v, v + self.gain * x[2:]])
        speed = np.maximum(np.hypot(*ends.swapaxes(0, 1)), TINY)
        unit = ends / speed[:, None]
        value = [
            1 + (speed[1] - speed[0]) / self.fall,
            1 - (speed[1] ** 2 - speed[0] ** 2) / (2 * self.rise),
        ]
        across = (np.eye(2)[:, :, None] - unit[:, :, None] * unit[:, None]) / speed[:, None, None]
        same = np.broadcast_to(np.eye(2)[:, :, None], across.shape)
        both = [
            (_chained(-unit[0], unit[1], self.gain), _bent(-across[0], across[1], self.gain)),
            (_chained(-ends[0], ends[1], self.gain), _bent(-same[0], same[1], self.gain)),
        ]
        scale = np.array([1 / self.fall, -1 / self.rise])
        return Rows(
            np.stack(value),
            scale[:, None, None] * np.stack([slope for slope, _ in both]),
            scale[:, None, None, None] * np.stack([bend for _, bend in both]),
        )


def _chained(before: Real, after: Real, gain: float) -> Real:
    """Return the gradient (4, n) by v_n and a_n of one by v_n and v_{n+1} = v_n + gain a_n."""
    return np.concatenate([before + after, gain * after])


def _bent(before: Real, after: Real, gain: float) -> Real:
    """Return the Hessian (4, 4, n) by v_n and a_n of Hessians (2, 2, n) by v_n and by v_{n+1}."""
    top = np.concatenate([before + after, gain * after], axis=1)
    return np.concatenate([top, np.concatenate([gain * after, gain**2 * after], axis=1)])


@dataclass(frozen=True)
class TurnRate(Constraint):
    """(`per_speed`^2 c_n^2 - ||a_n||^2) / 2 >= 0 of the speed c_n that counts in turns.

    c_n^2 = (||v_n||^2 + ||v_{n+1}||^2) / 2 + `wind`, in v_max^2; `gain` is as in `SpeedChange`.
    """

    gain: float
    per_speed: float
    wind: float
    of = V + A

    def rows(self, x: Real) -> Rows:
        """Return g."""
        v, a = x[:2], x[2:]
        then, half = v + self.gain * a, self.per_speed**2 / 2
        square = (v * v + then * then).sum(axis=0)
        value = (half * (square + 2 * self.wind) - (a * a).sum(axis=0)) / 2
        slope = half * _chained(v, then, self.gain)
        slope[2:] -= a
        same = np.broadcast_to(np.eye(2)[:, :, None], (2, 2, x.shape[1]))
        bend = half * _bent(same, same, self.gain)
        bend[2:, 2:] -= same
        return Rows(value[None], slope[None], bend[None])
