"""Where the interior-point method stands, and a direction from there, in solver units.

Several flights stand side by side, each on its own: arrays end in (flights, slots), and what
belongs to a flight as a whole in (flights, 1).
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior import cones
from faao_mav.optimizer.interior.banded import FlightMatrix
from faao_mav.optimizer.interior.min_speed import Slow
from faao_mav.optimizer.interior.rewards import LENGTH
from faao_mav.optimizer.kinematics import Kinematics

NONE = np.zeros((1, 1))
"""No change of any flight."""

_TINY = float(np.finfo(float).tiny)


def best_floor(total: Real, weight: Real) -> Real:
    """Return the t that maximises t + `weight` sum_j log(total_j - t), (flights, 1).

    `total` (J, flights, 1), `weight` (flights, 1).
    """
    ordered = np.sort(total, axis=0)
    if len(total) == 1:
        return np.asarray(ordered[0] - weight)
    apart = ordered[1] - ordered[0]
    floor = np.asarray(ordered[0] - weight - 2 * weight**2 / (np.hypot(2 * weight, apart) + apart))
    if len(total) == 2:
        return floor
    # the others pull it down from there; the gradient is convex, Newton's method monotone
    for _ in range(50):
        per_gap = 1 / (total - floor)
        excess = weight * per_gap.sum(axis=0) - 1
        nearer = floor - excess / (weight * (per_gap * per_gap).sum(axis=0))
        if ((np.abs(excess) < 1e-12) | (nearer == floor)).all():
            break
        floor = nearer
    return floor


class FlightScale:
    """The flight in solver units: what the limits bound as a linear map of the speeds."""

    def __init__(self, kin: Kinematics) -> None:
        self.matrix = FlightMatrix(
            kin.slots,
            kin.max_speed * kin.time_step / LENGTH / 2,
            (kin.start_velocity is not None, kin.end_velocity is not None),
        )
        self.gain = kin.max_speed / (kin.max_acceleration * kin.time_step)
        bounded = np.arange(kin.slots - 1) >= kin.first_bounded_acceleration
        self.gains = self.gain * bounded
        """k, or 0 where the acceleration is not bounded, (n - 1,)."""
        self.per_gain = bounded / -self.gain
        """-1 / k, or 0: the multipliers of the accelerations in terms of q."""

    def enter(self, s: Real, first: Real | float, v: Real) -> None:
        """Enter s_0 = `first` and D v, free speeds and bounded accelerations, into s."""
        n = self.matrix.slots
        s[0] = first
        s[1:, :, :n] = v * self.matrix.moves_v
        s[1:, :, n:] = self.gains * (v[..., 1:] - v[..., :-1])

    def left_over(self, y: Real, on_a: Real) -> Real:
        """Return A_v^T y less D^T of forces on the accelerations alone, (2, flights, n).

        That is what the forces on the speeds have to be. `on_a` (2, flights, n - 1).
        """
        drawn, pushed = -self.matrix.half_step * y, self.gains * on_a
        found = np.zeros((*y.shape[:-1], self.matrix.slots))
        found[..., 1:] = drawn - pushed
        found[..., :-1] += drawn + pushed
        found *= self.matrix.moves_v
        return found


@dataclass(frozen=True, slots=True)
class Point:
    """An iterate: w, v (2, flights, n), y (2, flights, n - 1), s and z as one (3, 2, flights, m).

    margin (flights, m) = s_0 - 1: how far the limits are still widened. weights, total (J,
    flights, 1), floor t (flights, 1), gradient (2, J, flights, n), hessian (3, J, flights, n).
    """

    w: Real
    v: Real
    y: Real
    pair: Real
    margin: Real
    slow: Slow | None
    weights: Real
    total: Real
    floor: Real
    gradient: Real
    hessian: Real

    @property
    def s(self) -> Real:
        """The slacks, (3, flights, m)."""
        return self.pair[:, 0]

    @property
    def z(self) -> Real:
        """The multipliers, (3, flights, m)."""
        return self.pair[:, 1]

    def gap(self, length: Real | float = 0.0, step: "Step | None" = None) -> Real:
        """Return the mean of s^T z over the cones, after the share `length` of `step`."""
        pair = self.pair if step is None else self.pair + length * step.moves
        both = np.einsum("cbm,cbm->b", pair[:, 0], pair[:, 1])[:, None]
        if self.slow is None:
            return np.asarray(both / pair.shape[-1])
        both += self.slow.gap(length, *((NONE, NONE) if step is None else step.slow))
        return np.asarray(both / (pair.shape[-1] + self.slow.held()))

    def centred(self, mu: Real, share: float) -> "Point":
        """Return the same flights with z = mu s^-1."""
        return replace(
            self,
            pair=np.stack([self.s, mu * cones.inverse(self.s)], axis=1),
            slow=self.slow and self.slow.centred(mu),
            floor=best_floor(self.total, share * mu),
        )


@dataclass(frozen=True, slots=True)
class Step:
    """A direction; dtotal (J, flights, 1) is the first-order change of the F_j, rise that of t.

    `moves` are ds and dz as one (3, 2, flights, m).

    `slow` has the changes of s and z of `Slow`, zero without a least speed.
    """

    dw: Real
    dv: Real
    dy: Real
    moves: Real
    slow: tuple[Real, Real]
    dweights: Real
    dtotal: Real
    rise: Real

    @property
    def ds(self) -> Real:
        """The changes of the slacks, (3, flights, m)."""
        return self.moves[:, 0]

    @property
    def dz(self) -> Real:
        """The changes of the multipliers, (3, flights, m)."""
        return self.moves[:, 1]

    def reach(self, point: Point) -> Real:
        """Return the share of the step at which a slack or a multiplier vanishes, (flights, 1)."""
        falls = (-self.dweights / point.weights).max(axis=0)
        found = cones.reach(point.pair, self.moves).min(axis=0)
        if point.slow is not None:
            found = np.minimum(found, point.slow.reach(*self.slow))
        return np.asarray(np.minimum(found, 1 / np.maximum(falls, _TINY)))
