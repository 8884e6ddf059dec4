"""The matrix of a Newton step: one band, factored in time and memory linear in the slots.

The k unknowns x_n of a slot, among them position, velocity and acceleration, are followed by the
multipliers y_n of the equations that lead to the next slot, all of them linear:

    w_{n+1} = w_n + advance v_n + bulge a_n,    v_{n+1} = v_n + gain a_n

and what the goal adds. Keeping a_n as an unknown keeps the matrix well conditioned where its limit
is active.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import lapack

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.constraint import COMMON, Grid
from faao_mav.optimizer.interior.rewards import Goal

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
        self.size = size = k + e
        # a multiplier is as far from an unknown of its slot, and from one of the next, as this
        self._band = band = max(
            k - 1,
            *(k + row - column for row, column in np.argwhere(self.before)),
            *(e + column - row for row, column in np.argwhere(self.after)),
        )
        self._template = np.zeros((n, size, 3 * band + 1))
        for row, column in np.argwhere(self.before):
            value = -self.before[row, column] * self.moves[column, :-1]
            self._template[:-1, column, 2 * band + k + row - column] = value
            self._template[:-1, k + row, 2 * band - k - row + column] = value
        for row, column in np.argwhere(self.after):
            value = self.after[row, column] * self.moves[column, 1:]
            self._template[:-1, k + row, 2 * band + e + column - row] = value
            self._template[1:, column, 2 * band - e - column + row] = value
        self._template[-1, k:, 2 * band] = 1

        later = self.after[:, :, None] * self.moves[:, 1:]
        now = self.before[:, :, None] * self.moves[:, :-1]
        within = np.zeros((k, k, n))
        within[..., 1:] += np.einsum("ein,ejn->ijn", later, later)
        within[..., :-1] += np.einsum("ein,ejn->ijn", now, now)
        across = np.einsum("ein,ejn->ijn", later, now)
        self._square = np.zeros((n, k, 2 * k))  # columns of A^T A, rows from the diagonal down
        for column in range(k):
            self._square[:, column, : k - column] = within[column:, column].T
            self._square[:-1, column, k - column : 2 * k - column] = -across[:, column].T
        self._square *= _PENALTY

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
        cells, k = self._square.copy(), len(H)
        masked = self._masked(H)
        for column in range(k):
            cells[:, column, : k - column] += masked[column:, column].T
        _, info = lapack.dpbtrf(cells.reshape(-1, 2 * k).T, lower=1, overwrite_ab=True)
        return bool(info == 0)

    def factored(self, H: Real) -> Callable[[Real], Real] | None:
        """Return what solves for right-hand sides (m, k + e, n); None if the matrix is singular."""
        cells, band, k = self._template.copy(), self._band, len(H)
        masked = self._masked(H)
        for column in range(k):
            first = 2 * band - column
            cells[:, column, first : first + k] += masked[:, column].T
        flat = cells.reshape(-1, cells.shape[-1]).T
        lu, pivots, info = lapack.dgbtrf(flat, band, band, overwrite_ab=True)

        def solve(right: Real) -> Real:
            count = len(right)
            columns = right.transpose(2, 1, 0).reshape(-1, count)
            solved, _ = lapack.dgbtrs(lu, band, band, columns, pivots)
            return np.asarray(solved.reshape(-1, self.size, count).transpose(2, 1, 0))

        return None if info else solve

    def _masked(self, H: Real) -> Real:
        """Return H with rows and columns of the identity where unknowns are given."""
        masked = H * self.moves * self.moves[:, None]
        diagonal = range(len(H))
        masked[diagonal, diagonal] += 1 - self.moves
        return np.asarray(masked)
