"""One Newton step of the interior-point method: the system of all constraints at an iterate.

With unknowns x, inequalities g(x) >= 0 of slacks s and multipliers z, which s may exceed by a
`margin`, and multipliers y of A x = 0, the step solves

    H dx + A^T y+ - J^T z+ = c          z+ + (z / s) ds = target,    ds = J dx - margin
    A dx = -A x

with + for new multipliers, J the gradients of g, c that of the objective and H the Hessian of the
Lagrangian, as much of it as leaves the model convex. Slot by slot z+ is eliminated, which adds
J^T (z / s) J to H. Sums over all slots, as of energy, are a border of the banded matrix.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.constraint import COMMON, Constraint, Grid, Rows, V, W
from faao_mav.optimizer.interior.rewards import Goal

_SHARES = (0.9, 0.75, 0.5, 0.25)
"""Shares of the curvature of the wrong sign that are tried before it is cut. Chosen."""

_PENALTY = 1e8
"""What a squared miss of the equations weighs where signs of curvature are told: far more than any
curvature of a reward, which are of the order of one. With 1e6 a flight of 400 s that circles does
not converge to 1e-6; 1e10 does as well."""


class Chain:
    """[[H, A^T], [A, 0]] of a block-diagonal H and the equations A x = 0.

    `after` x_{n+1} = `before` x_n are the equations, (e, k) each; `free` (k, n) tells which
    unknowns are not given: rows and columns of the others are those of the identity.
    """

    def __init__(self, grid: Grid, goal: Goal, free: Flags) -> None:
        self.free, self.moves = free, free * 1.0
        k, n = free.shape
        e = 4 + len(goal.after)
        self.after, self.before = np.zeros((2, e, k))
        for axis in (0, 1):
            self.after[axis, axis] = self.after[2 + axis, 2 + axis] = 1
            self.before[axis, [axis, 2 + axis, 4 + axis]] = 1, grid.advance, grid.bulge
            self.before[2 + axis, [2 + axis, 4 + axis]] = 1, grid.gain
        self.after[4:, COMMON:], self.before[4:, COMMON:] = goal.after, goal.before
        # A by the unknowns of both slots, (e, 2 k, n - 1): in the matrix the unknowns of a slot
        # come before the multipliers of its equations
        now, later = (-self.before, self.moves[:, :-1]), (self.after, self.moves[:, 1:])
        A = np.concatenate([each[..., None] * moves for each, moves in (now, later)], axis=1)
        self.size = size = k + e
        equation, unknown, slot = np.nonzero(A)
        row = slot * size + k + equation
        column = (slot + unknown // k) * size + unknown % k
        self._band = band = max(k - 1, int(np.abs(row - column).max(initial=0)))
        self._template = np.zeros((n * size, 3 * band + 1))
        self._template[column, 2 * band + row - column] = A[equation, unknown, slot]
        self._template[row, 2 * band + column - row] = A[equation, unknown, slot]
        self._template[-e:, 2 * band] = 1
        square = _PENALTY * np.einsum("ein,ejn->ijn", A, A)
        self._square = np.zeros((n, k, 2 * k))  # columns of A^T A, rows from the diagonal down
        for c in range(k):
            self._square[:-1, c, : 2 * k - c] += square[c:, c].T
            self._square[1:, c, : k - c] += square[k + c :, k + c].T

    def missed(self, x: Real) -> Real:
        """Return A x, (e, n - 1), of unknowns x (k, n)."""
        return np.asarray(self.after @ x[:, 1:] - self.before @ x[:, :-1])

    def pull(self, y: Real) -> Real:
        """Return A^T y, (k, n), of multipliers y (e, n - 1), 0 where unknowns are given."""
        force = np.zeros(self.moves.shape)
        force[:, 1:] = self.after.T @ y
        force[:, :-1] -= self.before.T @ y
        return force * self.moves

    def convex(self, H: Real) -> bool:
        """Tell whether H (k, k, n) is positive definite where A x = 0.

        With a large multiple of A^T A added it is so for every x, which Cholesky's factors tell.
        """
        from scipy.linalg import lapack  # with a search, not before: pages do without SciPy

        cells, k = self._square.copy(), len(H)
        masked = self._masked(H)
        for column in range(k):
            cells[:, column, : k - column] += masked[column:, column].T
        _, info = lapack.dpbtrf(cells.reshape(-1, 2 * k).T, lower=1, overwrite_ab=True)
        return bool(info == 0)

    def solved(self, H: Real, right: Real) -> Real:
        """Return what solves the system for right-hand sides (m, k + e, n).

        Raises `numpy.linalg.LinAlgError` where it is singular.
        """
        from scipy.linalg import lapack

        cells, band = self._template.copy(), self._band
        columns, masked = cells.reshape(-1, self.size, cells.shape[1]), self._masked(H)
        for c in range(len(H)):
            columns[:, c, 2 * band - c : 2 * band - c + len(H)] += masked[:, c].T
        sides = right.transpose(2, 1, 0).reshape(-1, len(right))
        _, _, found, info = lapack.dgbsv(band, band, cells.T, sides, overwrite_ab=True)
        if info:
            raise np.linalg.LinAlgError("singular")
        return np.asarray(found.reshape(-1, self.size, len(right)).transpose(2, 1, 0))

    def _masked(self, H: Real) -> Real:
        """Return H with rows and columns of the identity where unknowns are given."""
        masked = H * self.moves * self.moves[:, None]
        diagonal = range(len(H))
        masked[diagonal, diagonal] += 1 - self.moves
        return np.asarray(masked)


@dataclass(frozen=True, slots=True)
class _Part:
    """A constraint with the places of its unknowns in a slot, and of its rows among all."""

    constraint: Constraint
    places: list[int]
    rows: slice


@dataclass(frozen=True, slots=True)
class Functions:
    """The inequalities at x (k, n): `rows` of each part, all `values` (m,) less what is `inside`.

    First those of the slots where they hold, then the sums, with gradients `slopes` (T, k, n).
    """

    x: Real
    rows: list[Rows]
    values: Real
    slopes: Real


class System:
    """What a search keeps and maximises, and its places among the unknowns of a slot.

    The m inequalities are those of the slots where they are `on` (rows, n), then the sums, from
    `first_sum` on. `each` (m,) is one, for sums one per slot; `turns` (m,) tells which half-planes
    turn.
    """

    def __init__(self, grid: Grid, goal: Goal, constraints: Sequence[Constraint], x: Real) -> None:
        """Take unknowns x (k, n) to count the inequalities at."""
        self.goal, n = goal, grid.slots
        self.free = np.concatenate([grid.free, goal.free(n)])
        self.chain = Chain(grid, goal, self.free)
        self.objective = np.zeros(x.shape)
        self.objective[COMMON:] = goal.slope[:, None] * self.free[COMMON:]
        self.parts, on = list[_Part](), [np.zeros((0, n), dtype=np.bool_)]
        # each constraint, the goal first: as often as it has inequalities, of so many slots each
        often, first = list[tuple[Constraint, int, int]](), 0
        for each in sorted((goal, *constraints), key=lambda each: each.total):
            places = [*each.of, *(range(COMMON, len(x)) if each is goal else ())]
            count = len(each.rows(x[places]).value)
            self.parts.append(_Part(each, places, slice(first, first + count)))
            first += count
            if each.total:
                often.append((each, count, n))
            else:
                on.append(each.on(grid, count))
                often.append((each, int(on[-1].sum()), 1))
        self.on, self._slotwise = np.concatenate(on), len(on) - 1
        self.first_sum = int(self.on.sum())

        def of_each(value: Callable[[Constraint, int], float]) -> Real:
            return np.repeat([value(each, s) for each, _, s in often], [k for _, k, _ in often])

        self.inside = of_each(lambda each, slots: slots * each.inside)
        self.headroom = of_each(lambda each, slots: slots * each.headroom)
        self.each = of_each(lambda _, slots: 1 / slots)
        self.turns = of_each(lambda each, _: each.turns) > 0
        # positions, speeds and what else the goal says are held by the proximal term
        self.held = [*W, *V, *(COMMON + place for place in goal.held)]

    def at(self, x: Real) -> Functions:
        """Return the inequalities at x (k, n)."""
        rows = [part.constraint.rows(x[part.places]) for part in self.parts]
        g, first = np.concatenate([each.value for each in rows]), len(self.on)
        values = np.append(g[:first][self.on], g[first:].sum(axis=1))
        slopes = np.zeros((len(g) - first, *x.shape))
        for part, each in zip(self.parts[self._slotwise :], rows[self._slotwise :], strict=True):
            slopes[part.rows.start - first : part.rows.stop - first, part.places] = each.slope
        return Functions(x, rows, values - self.inside, slopes * self.free)

    def spread(self, z: Real, reward: float = 1.0) -> Real:
        """Return z (m,) as those of all rows in all slots, those of sums the same in each.

        A goal that is one `reward` has that multiplier.
        """
        rows = np.zeros(self.on.shape)
        if not self.goal.own:
            rows[self.parts[0].rows] = reward
        rows[self.on] = z[: self.first_sum]
        sums = np.outer(z[self.first_sum :], np.ones(self.on.shape[-1]))
        return np.concatenate([rows, sums])

    def pull(self, at: Functions, z: Real) -> Real:
        """Return J^T z, (k, n), of z (m,)."""
        weights, force = self.spread(z), np.zeros(at.x.shape)
        for part, rows in zip(self.parts, at.rows, strict=True):
            force[part.places] += np.einsum("mn,min->in", weights[part.rows], rows.slope)
        return np.asarray(force * self.free)

    def along(self, at: Functions, dx: Real) -> Real:
        """Return J dx, (m,)."""
        change = np.empty(self.on.shape)
        for part, rows in self._in_slots(at):
            change[part.rows] = np.einsum("min,in->mn", rows.slope, dx[part.places])
        return np.concatenate([change[self.on], np.einsum("tkn,kn->t", at.slopes, dx)])

    def stiffness(self, at: Functions, weights: Real) -> Real:
        """Return J^T diag(`weights`) J of the inequalities in slots, (k, k, n)."""
        stiff = self.spread(weights, 0.0)
        found = np.zeros((len(at.x), *at.x.shape))
        for part, rows in self._in_slots(at):
            J = rows.slope
            block = np.einsum("min,mjn->ijn", stiff[part.rows, None] * J, J)
            found[np.ix_(part.places, part.places)] += block
        return found

    def curvature(self, at: Functions, z: Real) -> Real:
        """Return the Hessian of the Lagrangian, (k, k, n), at multipliers z."""
        weights = self.spread(z)
        found = np.zeros((len(at.x), *at.x.shape))
        for part, rows in zip(self.parts, at.rows, strict=True):
            if rows.bend is not None:
                block = np.einsum("mn,mijn->ijn", weights[part.rows], rows.bend)
                found[np.ix_(part.places, part.places)] -= block
        return found

    def reward(self, at: Functions) -> float:
        """Return the goal where it is one reward, else 0."""
        return 0.0 if self.goal.own else float(at.rows[0].value.sum())

    def steepness(self, at: Functions, z: Real) -> float:
        """Return the largest gradient of what the goal has of w, weighted by z."""
        slope, rows = at.rows[0].slope[:, :2], self.parts[0].rows
        return float((np.abs(slope) * self.spread(z)[rows, None]).sum(axis=0).max())

    def bent(self, at: Functions, dx: Real) -> Real:
        """Return half the second-order change of each inequality along dx in its slot, (m,)."""
        change = np.zeros(self.on.shape)
        for part, rows in self._in_slots(at):
            if rows.bend is not None and part.constraint is not self.goal:
                d = dx[part.places]
                change[part.rows] = np.einsum("in,mijn,jn->mn", d, rows.bend, d) / 2
        return np.append(change[self.on], np.zeros(len(at.slopes)))

    def _in_slots(self, at: Functions) -> list[tuple[_Part, Rows]]:
        return list(zip(self.parts, at.rows, strict=True))[: self._slotwise]


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
    """Changes of an `Iterate`, and `bend`, dx^T H dx."""

    x: Real
    y: Real
    s: Real
    z: Real
    bend: float


def newton_direction(system: System, iterate: Iterate, mu: float, proximal: float) -> Direction:
    """Return the direction to complementarities of mu, held back by a `proximal` term.

    Raises `numpy.linalg.LinAlgError` where the system is singular.
    """
    at, chain, first = iterate.at, system.chain, system.first_sum
    (k, n), sums = at.x.shape, len(at.slopes)
    weights = iterate.z / iterate.s
    target = mu / iterate.s
    stiff = system.stiffness(at, weights)
    held = np.zeros((k, k, 1))
    held[system.held, system.held] = proximal
    H = _convex_part(chain, system.curvature(at, iterate.z), stiff + held) + held
    # columns of the sums, then what is moved without them
    right = np.zeros((sums + 1, k + len(chain.after), n))
    right[:sums, :k] = at.slopes
    pushed = target + weights * iterate.margin
    pushed[first:] = 0.0
    right[sums, :k] = system.objective + system.pull(at, pushed)
    right[sums, k:, :-1] = -chain.missed(at.x)
    solved = chain.solved(H + stiff, right)
    columns, alone = solved[:sums], solved[sums]
    border = np.einsum("ikn,jkn->ij", at.slopes, columns[:, :k]) + np.diag(1 / weights[first:])
    missing = (target / weights + iterate.margin)[first:]
    of_sums = np.linalg.solve(border, missing - np.einsum("tkn,kn->t", at.slopes, alone[:k]))
    both = alone + np.einsum("t,tkn->kn", of_sums, columns)
    x, y = both[:k], both[k:, :-1]
    s = system.along(at, x) - iterate.margin
    z = target - weights * s
    z[first:] = of_sums
    bend = float(np.einsum("in,ijn,jn->", x, H, x))
    return Direction(x, y - iterate.y, s, z - iterate.z, bend)


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
