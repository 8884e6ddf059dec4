"""What a flight maximises: the smallest of the sums of some rewards of its slots."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.constraint import TINY, Constraint, Rows, W
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory

_FLAT = 1e-9
"""A gain per 100 m, relative to the reward, that is not worth a detour. Chosen."""

_PACKED = np.array([[0, 1], [1, 2]])


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


class Goal(Constraint):
    """What is maximised, with the `own` unknowns per slot that it takes beside `of`.

    `slope` (own,) is the objective's. The unknowns of a slot and the next one keep
    `after` x_{n+1} = `before` x_n, both (k, own).
    """

    of = W
    inside = 0.0
    noise: float
    held: tuple[int, ...] = ()
    slope: Real = np.zeros(0)
    before: Real = np.zeros((0, 0))
    after: Real = np.zeros((0, 0))

    @abstractmethod
    def begin(self, *, cold: bool) -> Real:
        """Return its unknowns (own, n) to begin with."""

    def free(self, slots: int) -> Flags:
        """Return which of its unknowns are not given, (own, `slots`)."""
        return np.ones((len(self.slope), slots), dtype=np.bool_)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:  # noqa: ARG002
        """Return 0: every flight has its rewards."""
        return 0.0


class Rewards(Goal):
    """min_j F_j, the sums of `stage` over the slots, relative to a start: small gains keep digits.

    The unit is the largest gradient at the start w (2, n), m. `flat` tells that there is none.
    """

    total = True
    headroom = 0.0

    def __init__(self, stage: Stage, w: Real) -> None:
        self.stage, self.values = stage, stage(w)
        self.base = self.values.value
        first = self.base.mean(axis=-1, keepdims=True)
        steepest = np.abs(self.values.gradient).max(axis=(0, -1))[:, None] * LENGTH
        self.above = first - first.min(axis=0)
        # an F_j far above the least one has no say in the unit
        unit = float((steepest**2 / np.maximum(steepest + self.above, TINY)).max())
        self.flat = not unit > _FLAT * np.abs(first).max()
        self.unit = 1.0 if self.flat else unit
        rounding = 2 * np.finfo(float).eps * np.abs(self.base).sum(axis=-1).max()
        self.noise = 1e-9 + rounding / self.unit

    def begin(self, *, cold: bool) -> Real:  # noqa: ARG002
        """Return no unknowns."""
        return np.zeros((0, self.base.shape[-1]))

    def scaled(self, w: Real, base: Real | float = 0.0) -> tuple[Real, Real, Real]:
        """Return rewards above `base` at scaled w (2, n), with derivatives as `Rows` has them."""
        at = self.stage(w * LENGTH)
        return (
            (at.value - base) / self.unit,
            at.gradient.swapaxes(0, 1) * (LENGTH / self.unit),
            at.hessian[_PACKED].transpose(2, 0, 1, 3) * (LENGTH**2 / self.unit),
        )

    def rows(self, x: Real) -> Rows:
        """Return the rewards relative to those of the start."""
        return Rows(*self.scaled(x, self.base - self.above))
