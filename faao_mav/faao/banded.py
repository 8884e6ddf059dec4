"""The Newton system of a flight: one band matrix, factored in time and memory linear in the slots.

Per slot n the unknowns are (w_n, v_n, q_n, y_n), two each: scaled position and velocity, the
force q_n of the limit on v_{n+1} - v_n, and the multiplier y_n of the step
w_{n+1} - w_n = (h / 2)(v_n + v_{n+1}), which with a_n = k (v_{n+1} - v_n) is (11) and (12).
Keeping q_n as an unknown, rather than eliminating it, keeps the matrix well conditioned where the
limit is active. A symmetric 2x2 matrix is stored as its entries (xx, xy, yy), last axis.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from faao_mav.arrays import Real

SIZE = 8
"""Unknowns per slot."""

W, V, Q, Y = (slice(2 * part, 2 * part + 2) for part in range(4))
"""Where the unknowns of a slot are."""

_BAND = 6  # y_n meets w_n six places earlier, q_n meets v_{n+1} six places later
_DIAGONAL = 2 * _BAND


@dataclass(frozen=True, slots=True)
class Factors:
    """The LU factors of one Newton matrix."""

    lu: Real
    pivots: Real

    def solve(self, right: Real) -> Real:
        """Return K⁻¹ applied to each of m right-hand sides (m, n, 8)."""
        flat = right.reshape(right.shape[0], -1)
        found, _ = lapack.dgbtrs(self.lu, _BAND, _BAND, flat.T, self.pivots)
        return np.asarray(found.T).reshape(right.shape)


class FlightMatrix:
    """K = [[M, Dᵀ, Aᵀ], [D, -C, 0], [A, 0, 0]]: curvature M, differences D, dynamics A.

    `half_step` is h / 2. w(0) and w(N+1) are fixed, v(0) and v(N+1) where asked: rows and columns
    of fixed unknowns, and of the multipliers that the last slot lacks, are those of the identity.
    """

    def __init__(self, slots: int, half_step: float, fixed: tuple[bool, bool]) -> None:
        self.slots, self.half_step = slots, half_step
        self.moves_w = np.ones((slots, 1))
        self.moves_w[[0, -1]] = 0
        self.moves_v = np.ones((slots, 1))
        self.moves_v[[0, -1], 0] = [not is_fixed for is_fixed in fixed]
        self._template = self._constants()

    def dynamics(self, w: Real, v: Real) -> Real:
        """Return A (w, v): w_{n+1} - w_n - (h / 2)(v_n + v_{n+1}), (n - 1, 2)."""
        return np.asarray(w[1:] - w[:-1] - self.half_step * (v[1:] + v[:-1]))

    def pull(self, y: Real) -> tuple[Real, Real]:
        """Return Aᵀ y as the parts for w and v, (n, 2) each, from y (n - 1, 2)."""
        on_w, on_v = np.zeros((2, self.slots, 2))
        on_w[1:] = y
        on_w[:-1] -= y
        on_v[1:] = y
        on_v[:-1] += y
        on_v *= -self.half_step
        return on_w * self.moves_w, on_v * self.moves_v

    def factor(self, at_w: Real, at_v: Real, give: Real) -> Factors | None:
        """Factor K with M = diag(`at_w`, `at_v`) and C = diag(`give`); None if it is singular.

        at_w, at_v are (n, 3), give (n - 1, 3).
        """
        band = self._template.copy(order="F")
        for offset, block, moves in (
            (W.start, at_w, self.moves_w),
            (V.start, at_v, self.moves_v),
        ):
            moving = moves[:, 0]
            band[_DIAGONAL, offset::SIZE] = block[:, 0] * moving + (1 - moving)
            band[_DIAGONAL, offset + 1 :: SIZE] = block[:, 2] * moving + (1 - moving)
            across = block[:, 1] * moving
            band[_DIAGONAL + 1, offset::SIZE] = across
            band[_DIAGONAL - 1, offset + 1 :: SIZE] = across
        inner = slice(Q.start, -SIZE, SIZE), slice(Q.start + 1, -SIZE, SIZE)
        band[_DIAGONAL, inner[0]] = -give[:, 0]
        band[_DIAGONAL, inner[1]] = -give[:, 2]
        band[_DIAGONAL + 1, inner[0]] = -give[:, 1]
        band[_DIAGONAL - 1, inner[1]] = -give[:, 1]
        lu, pivots, info = lapack.dgbtrf(band, _BAND, _BAND, overwrite_ab=True)
        return Factors(lu, pivots) if info == 0 else None

    def _constants(self) -> Real:
        band = np.zeros((3 * _BAND + 1, SIZE * self.slots), order="F")
        slot = np.arange(self.slots - 1)
        for later in (0, 1):
            sign = 2.0 * later - 1
            for multiplier, moved, value, moves in (
                (Y, W, sign, self.moves_w),
                (Y, V, -self.half_step, self.moves_v),
                (Q, V, sign, self.moves_v),
            ):
                entries = value * moves[later : self.slots - 1 + later, 0]
                for axis in (0, 1):
                    row = SIZE * slot + multiplier.start + axis
                    column = SIZE * (slot + later) + moved.start + axis
                    band[_DIAGONAL + row - column, column] = entries
                    band[_DIAGONAL + column - row, row] = entries
        band[_DIAGONAL, Q.start - SIZE :] = 1
        return band
