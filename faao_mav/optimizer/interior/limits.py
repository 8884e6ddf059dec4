"""The limits of an aircraft: speed, acceleration, airspeed, their changes, turns and energy.

    (1 - ||v_n||^2) / 2 >= 0,  (1 - ||a_n||^2) / 2 >= 0,  (||v_n - u||^2 - least^2) / 2 >= 0

in the wind u, and the greatest airspeed as the first. Thrust and drag limit how the airspeed
s_n = ||v_n - u|| changes, guidance how fast the path turns over ground: see `Kinematics`. A battery
limits sum_n P(v_n, a_n) delta_t <= E, one inequality for it all. P is smooth but not convex: a
copter that hovers takes more than one that flies slowly.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import PACKED, Real
from faao_mav.optimizer.interior.constraint import TINY, A, Constraint, Rows, V
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.plan import Vector
from faao_mav.power import PowerModel, PowerPartials

_SAME = np.eye(2)[:, :, None]
"""The Hessian of half a squared length, in every slot."""


@dataclass(frozen=True)
class Disc(Constraint):
    """g(x) = `side` (||x - wind||^2 - `radius`^2) / 2 of a velocity or acceleration x.

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
        bend = np.broadcast_to(self.side * _SAME, (2, 2, x.shape[1]))
        return Rows(value[None], self.side * away[None], bend[None])


def _by_slot(gain: float, slope: Real, bend: Real) -> tuple[Real, Real]:
    """Return gradient (4, n) and Hessian (4, 4, n) by v_n and a_n of a function of both its speeds.

    `slope` (2, 2, n) and `bend` (2, 2, 2, n) are those by v_n and by v_{n+1} = v_n + `gain` a_n,
    of a function without mixed terms.
    """
    (before, after), (bend_before, bend_after) = slope, bend
    first = np.concatenate([bend_before + bend_after, gain * bend_after], axis=1)
    then = np.concatenate([gain * bend_after, gain**2 * bend_after], axis=1)
    return np.concatenate([before + after, gain * after]), np.concatenate([first, then])


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
        across = (_SAME - unit[:, :, None] * unit[:, None]) / speed[:, None, None]
        same = np.broadcast_to(_SAME, across.shape)
        value, slope, bend = [], [], []
        for scale, size, by_v, by_vv in (
            (1 / self.fall, speed, unit, across),
            (-1 / self.rise, speed**2 / 2, ends, same),
        ):
            sign = np.array([-scale, scale])[:, None, None]
            of_slot = _by_slot(self.gain, sign * by_v, sign[..., None] * by_vv)
            value.append(1 + scale * (size[1] - size[0]))
            slope.append(of_slot[0])
            bend.append(of_slot[1])
        return Rows(np.stack(value), np.stack(slope), np.stack(bend))


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
        ends, half = np.stack([v, v + self.gain * a]), self.per_speed**2 / 2
        value = (half * ((ends**2).sum(axis=(0, 1)) + 2 * self.wind) - (a * a).sum(axis=0)) / 2
        same = np.broadcast_to(_SAME, (2, 2, 2, x.shape[1]))
        slope, bend = _by_slot(self.gain, half * ends, half * same)
        slope[2:] -= a
        bend[2:, 2:] -= _SAME
        return Rows(value[None], slope[None], bend[None])


@dataclass(frozen=True)
class EnergyLimit(Constraint):
    """At most `most` J for a flight of `kin`: by `model`, of speeds through the air.

    g is what is left in shares of a slot's even part. The method leaves a share `inside` unused.
    """

    model: PowerModel
    most: float
    kin: Kinematics
    of = V + A
    total = True

    def rows(self, x: Real) -> Rows:
        """Return what each slot takes less than its even part."""
        scale = np.repeat([self.kin.max_speed, self.kin.max_acceleration], 2)
        power = self.partials(*np.split(scale[:, None] * x, 2))
        unit = self.kin.time_step * x.shape[1] / self.most
        slope = np.concatenate([power.by_v, power.by_a]) * scale[:, None]
        bend = np.empty((4, 4, x.shape[1]))
        bend[:2, :2], bend[2:, 2:] = power.by_vv[PACKED], power.by_aa[PACKED]
        bend[:2, 2:], bend[2:, :2] = power.by_va, power.by_va.swapaxes(0, 1)
        bend *= scale[:, None, None] * scale[:, None]
        return Rows((1 - unit * power.value)[None], -unit * slope[None], -unit * bend[None])

    def partials(self, v: Real, a: Real) -> PowerPartials:
        """Return the power, W, at v over ground and a, (2, ...), m/s, m/s^2, with derivatives."""
        return self.model.partials(v - np.reshape(self.kin.wind, (2, *[1] * (v.ndim - 1))), a)

    def used(self, flight: Trajectory) -> float:
        """Return what `flight` takes, J."""
        return self.kin.time_step * float(self.partials(flight.v.T, flight.a.T).value.sum())
