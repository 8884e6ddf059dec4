"""The Newton system of a flight: one band matrix, factored in time and memory linear in the slots.

Per slot n the unknowns are (w_n, v_n, q_n, y_n), two each: scaled position and velocity, the
force q_n of the limit on v_{n+1} - v_n, and the multiplier y_n of the step
w_{n+1} - w_n = (h / 2)(v_n + v_{n+1}), which with a_n = k (v_{n+1} - v_n) is (11) and (12).
Keeping q_n as an unknown, rather than eliminating it, keeps the matrix well conditioned where the
limit is active. Flights stand one after the other in the band and do not touch.

Vectors are (2, flights, slots), symmetric 2x2 matrices (3, flights, slots): xx, xy, yy.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from faao_mav.arrays import Flags, Real

SIZE = 8
"""Unknowns per slot."""

W, V, Q, Y = (slice(2 * part, 2 * part + 2) for part in range(4))
"""Where the unknowns of a slot are."""

_BAND = 6  # y_n meets w_n six places earlier, q_n meets v_{n+1} six places later
_DIAGONAL = 2 * _BAND
_ROWS = 3 * _BAND + 1
_EAST, _NORTH = slice(0, Y.start, 2), slice(1, Y.start, 2)  # of w, v and q
_UNIT = np.array([1.0, 0.0, 1.0])[:, None, None]


@dataclass(frozen=True, slots=True)
class Factors:
    """The LU factors of the Newton matrices; `sound` (flights, 1) tells which are not singular."""

    lu: Real
    pivots: Real
    sound: Flags

    def solve(self, right: Real) -> Real:
        """Return K⁻¹ applied to each of m right-hand sides (m, flights, n, 8), overwritten."""
        flat = right.reshape(right.shape[0], -1)
        found, _ = lapack.dgbtrs(self.lu, _BAND, _BAND, flat.T, self.pivots, overwrite_b=True)
        return np.asarray(found.T).reshape(right.shape)


class FlightMatrix:
    """K = [[M, Dᵀ, Aᵀ], [D, -C, 0], [A, 0, 0]]: curvature M, differences D, dynamics A.

    `half_step` is h / 2. w(0) and w(N+1) are fixed, v(0) and v(N+1) where asked: rows and columns
    of fixed unknowns, and of the multipliers that the last slot lacks, are those of the identity.
    `moves_w`, `moves_v` (n,) are 0 where fixed and 1 elsewhere.
    """

    def __init__(self, slots: int, half_step: float, fixed: tuple[bool, bool]) -> None:
        self.slots, self.half_step = slots, half_step
        self.moves_w, self.moves_v = np.ones((2, slots))
        self.moves_w[[0, -1]] = 0
        self.moves_v[[0, -1]] = [not is_fixed for is_fixed in fixed]
        followed = np.arange(slots) < slots - 1
        self._free = np.stack([self.moves_w, self.moves_v, followed])[:, None, None] > 0
        self._template = self._constants()

    def dynamics(self, w: Real, v: Real) -> Real:
        """Return A (w, v): w_{n+1} - w_n - (h / 2)(v_n + v_{n+1}), (2, flights, n - 1)."""
        found = w[..., 1:] - w[..., :-1]
        found -= self.half_step * (v[..., 1:] + v[..., :-1])
        return np.asarray(found)

    def pull(self, y: Real) -> Real:
        """Return the part of Aᵀ y for w, (2, flights, n), from y (2, flights, n - 1)."""
        found = np.zeros((*y.shape[:-1], self.slots))
        found[..., 1:] = y
        found[..., :-1] -= y
        found *= self.moves_w
        return found

    def factor(self, at_w: Real, at_v: Real, give: Real) -> Factors:
        """Factor K with M = diag(`at_w`, `at_v`) and C = diag(`give`), (3, flights, n) each."""
        blocks = np.empty((3, *at_w.shape))
        blocks[0], blocks[1] = at_w, at_v
        np.negative(give, out=blocks[2])
        blocks = np.where(self._free, blocks, _UNIT)
        sound = np.isfinite(np.einsum("kcbn->b", blocks))[:, None]
        while True:
            if not sound.all():
                blocks = np.where(sound, blocks, _UNIT)
            lu, pivots, info = lapack.dgbtrf(self._band(blocks), _BAND, _BAND, overwrite_ab=True)
            if info == 0:
                return Factors(lu, pivots, sound)
            sound[(info - 1) // (SIZE * self.slots)] = False

    def _band(self, blocks: Real) -> Real:
        """Return K in LAPACK's band storage, from (w v q, xx xy yy, flights, n)."""
        cells = np.empty((blocks.shape[2], *self._template.shape))
        cells[:] = self._template
        xx, xy, yy = blocks.transpose(1, 2, 3, 0)
        cells[:, :, _EAST, _DIAGONAL] = xx
        cells[:, :, _NORTH, _DIAGONAL] = yy
        cells[:, :, _EAST, _DIAGONAL + 1] = xy
        cells[:, :, _NORTH, _DIAGONAL - 1] = xy
        return cells.reshape(-1, _ROWS).T

    def _constants(self) -> Real:
        """The entries that never change, (n, 8, rows of the band)."""
        cells = np.zeros((self.slots, SIZE, _ROWS))
        for later in (0, 1):
            here, there = slice(0, self.slots - 1), slice(later, self.slots - 1 + later)
            sign = 2.0 * later - 1
            for multiplier, moved, value, moves in (
                (Y, W, sign, self.moves_w),
                (Y, V, -self.half_step, self.moves_v),
                (Q, V, sign, self.moves_v),
            ):
                below = multiplier.start - moved.start - SIZE * later
                for axis in (0, 1):
                    entries = value * moves[there]
                    cells[there, moved.start + axis, _DIAGONAL + below] = entries
                    cells[here, multiplier.start + axis, _DIAGONAL - below] = entries
        cells[-1, Q.start :, _DIAGONAL] = 1
        return cells
