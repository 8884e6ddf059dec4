"""What it is worth to be somewhere: smooth rewards of the slots, and their sums in solver units."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Real

LENGTH = 100.0
"""Unit of length inside the solver, m."""

_FLAT = 1e-9  # a gain per 100 m, relative to the reward, that is not worth a detour


@dataclass(frozen=True, slots=True)
class StageValues:
    """f, its gradient (1/m) and its Hessian (1/m^2): (J, n), (J, n, 2), (J, n, 2, 2)."""

    value: Real
    gradient: Real
    hessian: Real


class Stage(Protocol):
    """The rewards f_jn of being at w_n, n = 0 .. N+1."""

    def __call__(self, w: Real, /) -> StageValues:
        """Return the rewards at w (n, 2), m; not-a-number where there is none."""
        ...


class ScaledRewards:
    """The F_j in solver units, relative to the start so that small gains keep their digits."""

    def __init__(self, stage: Stage, w: Real) -> None:
        self.stage = stage
        values = stage(w)
        self.base = values.value
        self.first = self.base.mean(axis=1)
        steepest = np.abs(values.gradient).max(axis=(1, 2)) * LENGTH
        above = self.first - self.first.min()
        # an F_j far above the least one has no say in the unit
        near = steepest / np.maximum(steepest + above, np.finfo(float).tiny)
        self.unit = float((near * steepest).max())
        self.flat = not self.unit > _FLAT * float(np.abs(self.first).max())
        if not self.flat:
            self.offset = above * w.shape[0] / self.unit
            rounding = 2 * np.finfo(float).eps * float(np.abs(self.base).sum(axis=1).max())
            self.noise = 1e-9 + rounding / self.unit
            self.at_start = self.scaled(values)

    def __call__(self, w: Real) -> tuple[Real, Real, Real]:
        """Return the F_j (J,), their gradients (J, n, 2) and Hessians (J, n, 3) at scaled w."""
        return self.scaled(self.stage(w * LENGTH))

    def scaled(self, values: StageValues) -> tuple[Real, Real, Real]:
        """Return the same for `values`."""
        total = (values.value - self.base).sum(axis=1) / self.unit + self.offset
        packed = values.hessian.reshape(*values.hessian.shape[:2], 4)[:, :, [0, 1, 3]]
        return (
            total,
            values.gradient * (LENGTH / self.unit),
            packed * (LENGTH**2 / self.unit),
        )
