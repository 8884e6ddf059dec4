"""One Newton step of the interior-point method: the system of all constraints at an iterate.

With unknowns x, inequalities g(x) >= 0 of slacks s and multipliers z, which s may exceed by a
`margin`, and multipliers y of A x = 0, the step solves

    H dx + A^T y+ - J^T z+ = c          z+ + (z / s) ds = target,    ds = J dx - margin
    A dx = -A x

with + for new multipliers, J the gradients of g, c that of the objective and H the Hessian of the
Lagrangian, as much of it as leaves the model convex. Slot by slot z+ is eliminated, which adds
J^T (z / s) J to H.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.chain import Chain
from faao_mav.optimizer.interior.constraint import (
    COMMON,
    Constraint,
    Grid,
    Rows,
    StartStrategy,
    V,
    W,
)
from faao_mav.optimizer.interior.rewards import Goal

_SHARES = (0.9, 0.75, 0.5, 0.25)
"""Shares of the curvature of the wrong sign that are tried before it is cut. Chosen."""


@dataclass(frozen=True, slots=True)
class _Part:
    """A constraint with the places of its unknowns in a slot, and of its rows among all."""

    constraint: Constraint
    places: list[int]
    rows: slice


@dataclass(frozen=True, slots=True)
class Functions:
    """The goal's `worth` at x (k, n), `rows` of each part, all `values` (m,) less what is `inside`.

    The values are those of the slots where they hold.
    """

    x: Real
    worth: Rows
    rows: list[Rows]
    values: Real


class System:
    """What a search keeps and maximises, and its places among the unknowns of a slot.

    The m inequalities are those of the slots where they are `on` (rows, n); `turns` (m,) tells
    which half-planes turn. `x` (k, n) are the unknowns to begin with.
    """

    def __init__(
        self,
        grid: Grid,
        goal: Goal,
        constraints: Sequence[Constraint],
        x: Real,
        *,
        strategy: StartStrategy,
    ) -> None:
        """Take w, v and a (6, n) to begin with."""
        self.goal, self.parts, on, free = goal, list[_Part](), [], [grid.free]
        begun, first, own = [x], 0, COMMON
        for each in constraints:
            at = np.concatenate([x[list(each.of)], each.begin(x[list(each.of)], strategy)])
            count = len(each.rows(at).value)
            places = [*each.of, *range(own, own + each.own)]
            self.parts.append(_Part(each, places, slice(first, first + count)))
            on.append(each.on(grid, count))
            free.append(each.free(grid.slots))
            begun.append(at[len(each.of) :])
            first, own = first + count, own + each.own
        self.x, self.on = np.concatenate(begun), np.concatenate(on)
        self.chain = Chain(grid, constraints, np.concatenate(free))
        often = [int(self.on[part.rows].sum()) for part in self.parts]

        def of_each(value: Callable[[Constraint], float]) -> Real:
            return np.repeat([value(part.constraint) for part in self.parts], often)

        self.inside, self.headroom = of_each(lambda c: c.inside), of_each(lambda c: c.headroom)
        self.turns = of_each(lambda c: c.turns) > 0
        # positions, speeds and what else the goal says are held by the proximal term
        self.held = [*W, *V, *goal.held]

    def at(self, x: Real) -> Functions:
        """Return the inequalities at x (k, n)."""
        rows = [part.constraint.rows(x[part.places]) for part in self.parts]
        values = np.concatenate([each.value for each in rows])[self.on]
        return Functions(x, self.goal.worth(x), rows, values - self.inside)

    def spread(self, z: Real) -> Real:
        """Return z (m,) as those of slots, (rows, n)."""
        rows = np.zeros(self.on.shape)
        rows[self.on] = z
        return rows

    def pull(self, at: Functions, z: Real) -> Real:
        """Return the gradient of the goal plus J^T z, (k, n), of z (m,)."""
        per_slot, force = self.spread(z), at.worth.slope[0].copy()
        for part, rows in zip(self.parts, at.rows, strict=True):
            force[part.places] += np.einsum("mn,min->in", per_slot[part.rows], rows.slope)
        return np.asarray(force * self.chain.free)

    def along(self, at: Functions, dx: Real) -> Real:
        """Return J dx, (m,)."""
        change = np.empty(self.on.shape)
        for part, rows in zip(self.parts, at.rows, strict=True):
            change[part.rows] = np.einsum("min,in->mn", rows.slope, dx[part.places])
        return np.asarray(change[self.on])

    def stiffness(self, at: Functions, weights: Real) -> Real:
        """Return J^T diag(`weights`) J, (k, k, n)."""
        stiff, found = self.spread(weights), np.zeros((len(at.x), *at.x.shape))
        for part, rows in zip(self.parts, at.rows, strict=True):
            J = rows.slope
            block = np.einsum("min,mjn->ijn", stiff[part.rows, None] * J, J)
            found[np.ix_(part.places, part.places)] += block
        return found

    def curvature(self, at: Functions, z: Real) -> Real:
        """Return the Hessian of the Lagrangian, (k, k, n), at multipliers z."""
        per_slot, found = self.spread(z), np.zeros((len(at.x), *at.x.shape))
        if at.worth.bend is not None:
            found -= at.worth.bend[0]
        for part, rows in zip(self.parts, at.rows, strict=True):
            if rows.bend is not None:
                block = np.einsum("mn,mijn->ijn", per_slot[part.rows], rows.bend)
                found[np.ix_(part.places, part.places)] -= block
        return found

    def steepness(self, at: Functions, z: Real) -> float:
        """Return the largest gradient of the goal, or of its own row's weighted by z, by w."""
        force = np.abs(at.worth.slope[0, :2])
        if isinstance(self.goal, Constraint):  # the first one
            weights = self.spread(z)[self.parts[0].rows, None]
            force = (np.abs(at.rows[0].slope[:, :2]) * weights).sum(axis=0)
        return float(force.max())

    def bent(self, at: Functions, dx: Real) -> Real:
        """Return half the second-order change of each inequality without own unknowns along dx."""
        change = np.zeros(self.on.shape)
        for part, rows in zip(self.parts, at.rows, strict=True):
            if rows.bend is not None and not part.constraint.own:
                d = dx[part.places]
                change[part.rows] = np.einsum("in,mijn,jn->mn", d, rows.bend, d) / 2
        return np.asarray(change[self.on])


@dataclass(frozen=True, slots=True)
class Iterate:
    """Functions `at` x, multipliers y, slacks s, multipliers z and margins (m,)."""

    at: Functions
    y: Real
    s: Real
    z: Real
    margin: Real


@dataclass(frozen=True, slots=True)
class Direction:
    """Changes of an `Iterate`."""

    x: Real
    y: Real
    s: Real
    z: Real


class Newton:
    """The factored system at an iterate, with a proximal term; `curvature` (k, k, n) is its H.

    Raises `numpy.linalg.LinAlgError` where it is singular.
    """

    def __init__(self, system: System, iterate: Iterate, proximal: float) -> None:
        self.system, self.iterate = system, iterate
        at, chain = iterate.at, system.chain
        stiff = system.stiffness(at, iterate.z / iterate.s)
        held = np.zeros((len(at.x), len(at.x), 1))
        held[system.held, system.held] = proximal
        whole = system.curvature(at, iterate.z)
        self.curvature = _convex_part(chain, whole, stiff + held) + held
        solve = chain.factored(self.curvature + stiff)
        if solve is None:
            raise np.linalg.LinAlgError("singular")
        self._solve: Callable[[Real], Real] = solve

    def direction(self, target: Real) -> Direction:
        """Return the direction in which z+ + (z / s) ds is `target` (m,)."""
        system, it = self.system, self.iterate
        at, k, weights = it.at, len(it.at.x), it.z / it.s
        right = np.zeros((system.chain.size, at.x.shape[1]))
        right[:k] = system.pull(at, target + weights * it.margin)
        right[k:, :-1] = -system.chain.missed(at.x)
        both = self._solve(right)
        x, y = both[:k], both[k:, :-1]
        s = system.along(at, x) - it.margin
        return Direction(x, y - it.y, s, target - weights * s - it.z)

    def bend(self, direction: Direction) -> float:
        """Return dx^T H dx of a `direction`."""
        return float(np.einsum("in,ijn,jn->", direction.x, self.curvature, direction.x))


def _convex_part(chain: Chain, whole: Real, more: Real) -> Real:
    """Return as much of H `whole` (k, k, n) as is positive definite along A x = 0 with `more`."""
    if chain.convex(whole + more):
        return whole
    low, vectors = np.linalg.eigh(whole.transpose(2, 0, 1))
    kept = np.einsum("nia,na,nja->ijn", vectors, np.maximum(low, 0), vectors)
    for share in _SHARES:
        part = kept + share * (whole - kept)
        if chain.convex(part + more):
            return np.asarray(part)
    return np.asarray(kept)
