"""Cubic splines through values on an even grid, as scipy.interpolate has them.

Importing that takes a quarter of a second, a tenth of a whole job: it brings scipy's optimisers,
sparse matrices and Fourier transforms along.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Real


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A cubic spline on the even grid from `first` in steps of `step`.

    `pieces` (4, m - 1) are its polynomials, highest powers first; the outer ones go on beyond.
    """

    first: float
    step: float
    pieces: Real

    @classmethod
    def through(cls, x: Real, y: Real) -> "Spline":
        """Return the spline through `y` (m,) at the evenly spaced `x` (m,), m >= 4."""
        step = float(x[-1] - x[0]) / (len(x) - 1)
        return cls(float(x[0]), step, pieces(step, y))

    def __call__(self, x: ArrayLike, order: int = 0) -> Real:
        """Return the spline at `x` (...), or its derivative of the `order` 1 or 2."""
        away = (np.asarray(x, dtype=float) - self.first) / self.step
        k = np.clip(away.astype(np.intp), 0, self.pieces.shape[1] - 1)
        t = (away - k) * self.step
        a, b, c, d = self.pieces[:, k]
        if order == 0:
            return np.asarray(((a * t + b) * t + c) * t + d)
        return np.asarray((3 * a * t + 2 * b) * t + c if order == 1 else 6 * a * t + 2 * b)


def pieces(step: float, y: Real) -> Real:
    """Return the polynomials (4, m - 1, ...) of the splines through `y` (m, ...), m >= 4.

    Twice continuously differentiable; at the second and the last but one point the third
    derivative does not jump either (not-a-knot). With slopes s and secants d, on an even grid
    s_{k-1} + 4 s_k + s_{k+1} = 3 (d_{k-1} + d_k), and s_0 + 2 s_1 = (5 d_0 + d_1) / 2.
    """
    from scipy.linalg import solve_banded  # with the optimiser, not before

    secant = np.diff(y, axis=0) / step
    right = np.empty_like(y, dtype=float)
    right[1:-1] = 3 * (secant[:-1] + secant[1:])
    right[0], right[-1] = (5 * secant[0] + secant[1]) / 2, (5 * secant[-1] + secant[-2]) / 2
    bands = np.ones((3, len(y)))
    bands[1, 1:-1] = 4
    bands[0, 1] = bands[2, -2] = 2
    slope = solve_banded((1, 1), bands, right.reshape(len(y), -1)).reshape(right.shape)
    bend = (slope[:-1] + slope[1:] - 2 * secant) / step
    return np.stack([bend / step, (secant - slope[:-1]) / step - bend, slope[:-1], y[:-1]])
