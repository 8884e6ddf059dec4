"""What it is worth to be somewhere: smooth rewards of the slots, and their sums in solver units."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.cones import TINY
from faao_mav.optimizer.kinematics import LENGTH

_FLAT = 1e-9  # a gain per 100 m, relative to the reward, that is not worth a detour


@dataclass(frozen=True, slots=True)
class StageValues:
    """f, its gradient (1/m) and its Hessian (1/m^2) as xx, xy, yy.

    (J, ..., n), (2, J, ..., n) and (3, J, ..., n).
    """

    value: Real
    gradient: Real
    hessian: Real


class Stage(Protocol):
    """The rewards f_jn of being at w_n, n = 0 .. N+1."""

    def __call__(self, w: Real, /) -> StageValues:
        """Return the rewards at w (2, ..., n), m; not-a-number where there is none."""


class ScaledRewards:
    """The F_j of some flights in solver units, relative to their starts: small gains keep digits.

    `first` (J, flights, 1) are the F_j of the starts, in the unit of the rewards.
    """

    def __init__(self, stage: Stage, w: Real) -> None:
        """Take the starts w (2, flights, n), m."""
        self.stage, self.values = stage, stage(w)
        self.base = self.values.value
        self.first = self.base.mean(axis=-1, keepdims=True)
        steepest = np.abs(self.values.gradient).max(axis=(0, -1))[..., None] * LENGTH
        above = self.first - self.first.min(axis=0)
        # an F_j far above the least one has no say in the unit
        near = steepest / np.maximum(steepest + above, TINY)
        unit = (near * steepest).max(axis=0)
        self.flat: Flags = ~(unit > _FLAT * np.abs(self.first).max(axis=0))
        self.unit = np.where(self.flat, 1.0, unit)
        self.least = self.first.min(axis=0)
        self.offset = above * w.shape[-1] / self.unit
        rounding = 2 * np.finfo(float).eps * np.abs(self.base).sum(axis=-1, keepdims=True)
        self.noise = 1e-9 + rounding.max(axis=0) / self.unit

    def keep(self, flights: Flags) -> None:
        """Forget all flights but these."""
        self.base, self.offset = self.base[:, flights], self.offset[:, flights]
        self.unit, self.noise = self.unit[flights], self.noise[flights]
        self.least = self.least[flights]

    def mean(self, total: Real) -> Real:
        """Return F_j `total` (..., flights, 1) as means over the slots, in the stage's unit."""
        return np.asarray(self.least + total * self.unit / self.base.shape[-1])

    def __call__(self, w: Real) -> tuple[Real, Real, Real]:
        """Return the F_j (J, flights, 1), their gradients and Hessians at scaled w."""
        return self.scaled(self.stage(w * LENGTH))

    def scaled(self, values: StageValues) -> tuple[Real, Real, Real]:
        """Return the same for `values`."""
        total = (values.value - self.base).sum(axis=-1, keepdims=True) / self.unit + self.offset
        scaled = self.in_units(values)
        return total, scaled.gradient, scaled.hessian

    def in_units(self, values: StageValues) -> StageValues:
        """Return `values` in the unit of each flight, with derivatives by scaled w."""
        return StageValues(
            values.value / self.unit,
            values.gradient * (LENGTH / self.unit),
            values.hessian * (LENGTH**2 / self.unit),
        )
