"""An iterate of the interior-point method, and a direction from there, in solver units.

Several flights stand side by side, each on its own: arrays end in (flights, slots), and what
belongs to a flight as a whole in (flights, 1).
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.cones import TINY
from faao_mav.optimizer.interior.constraint import Move, State

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Record = TypeVar("Record", bound="DataclassInstance")


def best_floor(total: Real, weight: Real) -> Real:
    """Return the t that maximises t + `weight` sum_j log(total_j - t), (flights, 1).

    `total` (J, flights, 1), `weight` (flights, 1).

    >>> float(best_floor(np.array([[[3.0]]]), np.array([[0.5]]))[0, 0])
    2.5
    """
    if not len(total):
        return np.zeros_like(weight)
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


@dataclass(frozen=True, slots=True)
class Iterate:
    """w, v (2, flights, n), the multipliers y (2, flights, n - 1) of the motion, the constraints.

    The rewards there: weights and total F_j (J, flights, 1), floor t (flights, 1), gradient
    (2, J, flights, n) and hessian (3, J, flights, n).
    """

    w: Real
    v: Real
    y: Real
    states: tuple[State, ...]
    weights: Real
    total: Real
    floor: Real
    gradient: Real
    hessian: Real

    def value(self) -> Real:
        """Return the objective: min_j F_j, or what constraints with a reward of their own say."""
        if len(self.total):
            return np.asarray(self.total.min(axis=0))
        return np.asarray(reduce(np.add, [state.reward() for state in self.states]))

    def mean_gap(self, share: Real | float = 0.0, direction: "Direction | None" = None) -> Real:
        """Return s^T z per inequality, after `share` of the `direction`, (flights, 1)."""
        steps = (None,) * len(self.states) if direction is None else direction.steps
        gaps = [state.gap(share, step) for state, step in zip(self.states, steps, strict=True)]
        return np.asarray(reduce(np.add, gaps) / sum(state.count() for state in self.states))

    def centred(self, mu: Real, barrier_share: float) -> "Iterate":
        """Return the same flights with multipliers that go with mu (flights, 1)."""
        return replace(
            self,
            states=tuple(state.centred(mu) for state in self.states),
            floor=best_floor(self.total, barrier_share * mu),
        )


@dataclass(frozen=True, slots=True)
class Direction:
    """Changes of an iterate: the `move` of its flights, `y`, the `steps` of the constraints.

    `weights` (J, flights, 1) are the changes of the weights, `total` (J, flights, 1) the
    first-order changes of the F_j and `floor` (flights, 1) that of t.
    """

    move: Move
    y: Real
    steps: tuple[Any, ...]
    weights: Real
    total: Real
    floor: Real

    def reach(self, at: Iterate) -> Real:
        """Return the share at which a slack, a multiplier or a weight vanishes, (flights, 1)."""
        falls = (-self.weights / at.weights).max(axis=0, initial=0)
        shares = [state.reach(step) for state, step in zip(at.states, self.steps, strict=True)]
        return np.asarray(reduce(np.minimum, shares, 1 / np.maximum(falls, TINY)))


def only(record: Record, flights: Flags) -> Record:
    """Return `record` with those of its flights that `flights` (flights,) marks."""
    return _each(lambda array: array[..., flights, :], record)


def merged(taken: Flags, new: Record, old: Record) -> Record:
    """Return `new` for the flights that `taken` (flights, 1) marks and `old` for the others."""
    if taken.all():
        return new
    return _each(lambda fresh, kept: np.where(taken, fresh, kept), new, old)


def _each(change: Callable[..., Any], *records: Record) -> Record:
    """Apply `change` to every array (..., flights, slots) of like records and the records in them.

    Everything else, as the description of a constraint, is that of the first record.
    """
    first = records[0]
    changed: dict[str, Any] = {}
    for field in fields(first):
        parts = [getattr(record, field.name) for record in records]
        if isinstance(parts[0], np.ndarray):
            changed[field.name] = change(*parts)
        elif isinstance(parts[0], tuple):
            changed[field.name] = tuple(
                _each(change, *each) for each in zip(*parts, strict=True) if is_dataclass(each[0])
            )
    return replace(first, **changed)
