"""What a flight has to keep: smooth functions of a slot's unknowns that are to be at least zero.

A constraint is one class that says of which unknowns, and what its functions, their gradients and
their Hessians are:

    class NorthOf(Constraint):
        of = W
        def rows(self, x):
            return Rows(x[1:] - self.northing / LENGTH, np.array([[[0.0], [1.0]]]) + 0 * x)
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory

W, V, A = (0, 1), (2, 3), (4, 5)
"""Which unknowns of a slot position, velocity and acceleration are."""

COMMON = 6
"""Unknowns of a slot without those that constraints bring."""

ALLOWED = 1e-9
"""The violation of a limit, in solver units, that counts as none: rounding of 1,000s of slots."""

TINY = float(np.finfo(float).tiny)
"""The smallest normal number: keeps a quotient finite where its denominator may be zero."""


@dataclass(frozen=True, slots=True)
class Rows:
    """m functions of k unknowns in each of n slots.

    `value` (m, n), `slope` (m, k, n) its gradients, `bend` (m, k, k, n) its Hessians, None if
    there are none.
    """

    value: Real
    slope: Real
    bend: Real | None = None


@dataclass(frozen=True, slots=True)
class Grid:
    """The slots of a flight in solver units: lengths in `LENGTH`, speeds in v_max, a in a_max.

    In a slot the position goes on by `advance` v + `bulge` a, and the velocity by `gain` a. `free`
    (6, n) tells which of w, v and a are not given, `bounded` (n,) where a_max holds.
    """

    slots: int
    advance: float
    bulge: float
    gain: float
    free: Flags
    bounded: Flags

    @classmethod
    def of(cls, kin: Kinematics) -> "Grid":
        """Return the grid of the flights of `kin`."""
        n, dt = kin.slots, kin.time_step
        free = np.ones((COMMON, n), dtype=np.bool_)
        free[:2, [0, -1]] = False
        free[2:4, 0], free[2:4, -1] = kin.start_velocity is None, kin.end_velocity is None
        free[4:, -1] = False
        slot = np.arange(n)
        return cls(
            slots=n,
            advance=kin.max_speed * dt / LENGTH,
            bulge=kin.max_acceleration * dt**2 / 2 / LENGTH,
            gain=kin.max_acceleration * dt / kin.max_speed,
            free=free,
            bounded=(slot >= kin.first_bounded_acceleration) & (slot < n - 1),
        )


class Constraint(ABC):
    """Functions g of the unknowns `of` of a slot that are to be at least 0.

    `total` tells that their sums over the slots are to be so instead; `turns`, that g is taken as
    linear although its gradient turns from step to step. Searches keep g at least `inside`, so that
    they end within the limit, and begin with at least `headroom`, by a limit that is widened.
    """

    of: ClassVar[tuple[int, ...]]
    total: ClassVar[bool] = False
    turns: ClassVar[bool] = False
    inside: ClassVar[float] = 1e-5
    headroom: ClassVar[float] = 0.1

    @abstractmethod
    def rows(self, x: Real) -> Rows:
        """Return g at the unknowns x (k, n), in solver units."""

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest violation by `flight`, in solver units; 0 where the limit holds.

        That of a sum is its mean over the slots.
        """
        value = self.rows(unknowns(kin, flight)[list(self.of)]).value
        if self.total:
            return max(0.0, -float(value.mean(axis=1).min()))
        on = self.on(Grid.of(kin), len(value))
        return max(0.0, -float(value.min(initial=np.inf, where=on)))

    def on(self, grid: Grid, rows: int) -> Flags:
        """Return where each of the `rows` of g holds, (rows, n): where an unknown of it is free."""
        accelerated = bool(set(self.of) & set(A))
        on = grid.bounded if accelerated else grid.free[list(self.of)].any(axis=0)
        return np.broadcast_to(on, (rows, grid.slots))


def unknowns(kin: Kinematics, flight: Trajectory) -> Real:
    """Return w, v and a of `flight` in solver units, (6, n)."""
    parts = flight.w / LENGTH, flight.v / kin.max_speed, flight.a / kin.max_acceleration
    return np.concatenate(parts, axis=1).T


def every_excess(kin: Kinematics, constraints: Sequence[Constraint], flight: Trajectory) -> float:
    """Return the largest excess of `flight` over `constraints`."""
    return max(constraint.excess(kin, flight) for constraint in constraints)
