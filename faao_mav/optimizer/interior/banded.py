"""The Newton system of a flight: one band matrix, factored in time and memory linear in the slots.

Per slot n the unknowns are (w_n, v_n, q_n, y_n), two each: scaled position and velocity, the
force q_n of the limit on v_{n+1} - v_n, and the multiplier y_n of the equation of motion
w_{n+1} - w_n = (h / 2)(v_n + v_{n+1}), which with a_n = k (v_{n+1} - v_n) is (11) and (12).
Keeping q_n as an unknown, rather than eliminating it, keeps the matrix well conditioned where the
limit is active. Unknowns that a constraint brings follow in the slot, and widen the band by as
many. Flights stand one after the other in the band and do not touch.

Vectors are (2, flights, slots), symmetric 2x2 matrices (3, flights, slots): xx, xy, yy.

Measured on one core, a flight: 0.18 ms a factorisation at 250 slots, 1.9 ms at 2,500.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from faao_mav.arrays import Flags, Real

SIZE = 8
"""Unknowns per slot without those of constraints."""

W, V, Q, Y = (slice(2 * part, 2 * part + 2) for part in range(4))
"""Where the unknowns of a slot are."""

_PENALTY = 1e6
"""What a squared miss of the equations of motion weighs where signs of curvature are told: far more
than any curvature of a reward, which are of the order of one. 1e4 and 1e8 do as well."""

_EAST, _NORTH = slice(0, Y.start, 2), slice(1, Y.start, 2)  # of w, v and q
_UNIT = np.array([1.0, 0.0, 1.0])[:, None, None]


@dataclass(frozen=True, slots=True)
class Entry:
    """Values of the matrix in row `row` of slot n + `ahead` and column `column` of slot n.

    The matrix is symmetric: the mirrored entry is meant too. Rows and columns count the unknowns
    of a slot; `ahead` is 0 or 1; `values` (..., slots - ahead).
    """

    row: int
    column: int
    values: Real
    ahead: int = 0


@dataclass(frozen=True, slots=True)
class Factors:
    """The LU factors of the Newton matrices; `sound` (flights, 1) tells which are not singular."""

    lu: Real
    pivots: Real
    band: int
    sound: Flags

    def solve(self, right: Real) -> Real:
        """Return K⁻¹ `right` for m right-hand sides (m, flights, n, size), which is overwritten."""
        flat = right.reshape(right.shape[0], -1)
        band = self.band
        solved, _ = lapack.dgbtrs(self.lu, band, band, flat.T, self.pivots, overwrite_b=True)
        return np.asarray(solved.T).reshape(right.shape)


class FlightMatrix:
    """K = [[M, Dᵀ, Aᵀ], [D, -C, 0], [A, 0, 0]]: stiffness M, differences D, dynamics A.

    C is the compliance of the limit on the accelerations, `half_step` is h / 2. w(0) and w(N+1)
    are fixed, v(0) and v(N+1) where `fixed` says so: rows and columns of fixed unknowns, and of
    the multipliers that the last slot lacks, are those of the identity. `moves_w`, `moves_v` (n,)
    are 0 where fixed and 1 elsewhere. `more` unknowns per slot belong to constraints, which fill
    their rows by `Entry`: `constant` ones here, changing ones with `factor`.
    """

    def __init__(
        self,
        slots: int,
        half_step: float,
        fixed: tuple[bool, bool],
        more: int = 0,
        constant: Sequence[Entry] = (),
    ) -> None:
        self.slots, self.half_step, self.size = slots, half_step, SIZE + more
        # y_n meets w_n six places earlier, q_n meets v_{n+1} six and `more` places later, and the
        # last unknown of a slot may meet the first one
        nearest = [SIZE - 2 + more, *(self._below(entry) for entry in constant)]
        self._band_width = max(nearest + [self.size - 1] * bool(more))
        self._diagonal = 2 * self._band_width
        self.moves_w, self.moves_v = np.ones((2, slots))
        self.moves_w[[0, -1]] = 0
        self.moves_v[[0, -1]] = [not is_fixed for is_fixed in fixed]
        self._moves = [self.moves_w] * 2 + [self.moves_v] * 2 + [np.ones(slots)] * (4 + more)
        has_next = np.arange(slots) < slots - 1
        self._free = np.stack([self.moves_w, self.moves_v, has_next])[:, None, None] > 0
        self._template = self._constants(constant)

    def dynamics(self, w: Real, v: Real) -> Real:
        """Return A (w, v): w_{n+1} - w_n - (h / 2)(v_n + v_{n+1}), (2, flights, n - 1)."""
        moved = w[..., 1:] - w[..., :-1]
        moved -= self.half_step * (v[..., 1:] + v[..., :-1])
        return np.asarray(moved)

    def pull(self, y: Real) -> Real:
        """Return the part of Aᵀ y for w, (2, flights, n), from y (2, flights, n - 1)."""
        force = np.zeros((*y.shape[:-1], self.slots))
        force[..., 1:] = y
        force[..., :-1] -= y
        force *= self.moves_w
        return force

    def factor(
        self, at_w: Real, at_v: Real, compliance: Real, entries: Sequence[Entry] = ()
    ) -> Factors:
        """Factor K with M = diag(`at_w`, `at_v`) and C = diag(`compliance`), (3, flights, n) each.

        The values of `entries` are (flights, n - ahead).
        """
        blocks = np.empty((3, *at_w.shape))
        blocks[0], blocks[1] = at_w, at_v
        np.negative(compliance, out=blocks[2])
        blocks = np.where(self._free, blocks, _UNIT)
        total = np.einsum("kcbn->b", blocks)
        for entry in entries:
            total += entry.values.sum(axis=-1)
        sound = np.isfinite(total)[:, None]
        band = self._band_width
        while True:
            matrix = self._band(blocks, entries, sound[:, 0])
            lu, pivots, info = lapack.dgbtrf(matrix, band, band, overwrite_ab=True)
            if info == 0:
                return Factors(lu, pivots, band, sound)
            sound[(info - 1) // (self.size * self.slots)] = False

    def positive(self, at_w: Real, at_v: Real, at_a: Real, across: Real | float = 0.0) -> Flags:
        """Tell whether M + Dᵀ C⁻¹ D is positive definite where A (w, v) = 0, (flights, 1).

        M is as in `factor`; `at_a` (3, flights, n) is C⁻¹, its last slot unused; `across`
        (2, 2, flights, n - 1) is what more there is between v_n and v_{n+1}. With a large
        multiple of AᵀA added it is so for every (w, v), which Cholesky's factors tell.
        """
        flights, n = at_w.shape[1:]
        h, rho, size = self.half_step, _PENALTY, V.stop
        one, moves = np.ones(n - 1), self._moves[:size]
        cells = np.zeros((flights, n, size, 2 * size))  # the lower band: columns, rows below

        def add(row: int, column: int, values: Real, ahead: int = 0) -> None:
            """Add `values` in slots n + `ahead` (rows) and n (columns)."""
            later, count = slice(ahead, None), n - ahead
            moved = values * moves[row][later] * moves[column][:count]
            cells[:, :count, column, row - column + size * ahead] += moved

        stiff = at_a[..., :-1]
        pairs = np.zeros_like(at_v)
        pairs[..., :-1] += stiff
        pairs[..., 1:] += stiff
        inner = np.append(one, 0) + np.append(0, one)
        ends = np.append(one, 0) - np.append(0, one)
        for block, first in ((at_w, W.start), (at_v + pairs, V.start)):
            for k, (row, column) in enumerate(((0, 0), (1, 0), (1, 1))):
                add(first + row, first + column, block[k])
        for k, (row, column) in ((0, (0, 0)), (1, (1, 0)), (1, (0, 1)), (2, (1, 1))):
            add(V.start + row, V.start + column, -stiff[k], 1)
        if np.ndim(across) == 4:
            for i, each in enumerate(np.asarray(across)):
                for j, values in enumerate(each):
                    add(V.start + j, V.start + i, values, 1)
        for w, v in ((0, 2), (1, 3)):
            add(w, w, rho * inner)
            add(v, v, rho * h * h * inner)
            add(v, w, rho * h * ends)
            add(w, w, -rho * one, 1)
            add(v, v, rho * h * h * one, 1)
            add(v, w, rho * h * one, 1)
            add(w, v, -rho * h * one, 1)
        for column, moving in enumerate(moves):
            cells[:, moving == 0, column, 0] = 1
        sound = np.asarray(np.isfinite(cells).all(axis=(1, 2, 3)))
        while True:
            cells[~sound] = 0
            cells[~sound, :, :, 0] = 1
            _, info = lapack.dpbtrf(cells.reshape(-1, 2 * size).T, lower=1)
            if info == 0:
                return np.asarray(sound[:, None])
            sound[(info - 1) // (size * n)] = False

    def _band(self, blocks: Real, entries: Sequence[Entry], sound: Flags) -> Real:
        """Return K in LAPACK's band storage, from (w v q, xx xy yy, flights, n).

        Where not `sound` (flights,) it is the identity.
        """
        cells = np.empty((blocks.shape[2], *self._template.shape))
        cells[:] = self._template
        xx, xy, yy = blocks.transpose(1, 2, 3, 0)
        diagonal = self._diagonal
        cells[:, :, _EAST, diagonal] = xx
        cells[:, :, _NORTH, diagonal] = yy
        cells[:, :, _EAST, diagonal + 1] = xy
        cells[:, :, _NORTH, diagonal - 1] = xy
        for entry in entries:
            self._add(cells, entry)
        if not sound.all():
            cells[~sound] = 0
            cells[~sound, :, :, diagonal] = 1
        return cells.reshape(-1, cells.shape[-1]).T

    def _constants(self, constant: Sequence[Entry]) -> Real:
        """Return the entries that never change, (n, size, rows of the band)."""
        slots = self.slots
        cells = np.zeros((slots, self.size, 3 * self._band_width + 1))
        one = np.ones(slots - 1)
        motion = [
            Entry(row.start + axis, column.start + axis, value * one, ahead)
            for row, column, value, ahead in (
                (Y, W, -1.0, 0),
                (W, Y, 1.0, 1),
                (Y, V, -self.half_step, 0),
                (V, Y, -self.half_step, 1),
                (Q, V, -1.0, 0),
                (V, Q, 1.0, 1),
            )
            for axis in (0, 1)
        ]
        for entry in (*motion, *constant):
            self._add(cells, entry)
        cells[-1, Q.start : SIZE, self._diagonal] = 1
        return cells

    def _add(self, cells: Real, entry: Entry) -> None:
        """Add the values of `entry` and of its mirror image, but for fixed unknowns, to `cells`."""
        below, count = self._below(entry), entry.values.shape[-1]
        later = slice(entry.ahead, entry.ahead + count)
        values = entry.values * self._moves[entry.row][later] * self._moves[entry.column][:count]
        cells[..., :count, entry.column, self._diagonal + below] += values
        if below:
            cells[..., later, entry.row, self._diagonal - below] += values

    def _below(self, entry: Entry) -> int:
        """Return by how many rows `entry` is below the diagonal."""
        return entry.row - entry.column + self.size * entry.ahead
