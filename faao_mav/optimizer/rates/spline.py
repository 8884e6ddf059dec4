"""Cubic and bicubic splines on even grids, equal to those of scipy.interpolate.

They are the project's own because they measure better: for 600 slots, value and all first and
second derivatives take 57 µs along a curve (scipy's CubicSpline: 72 µs) and 84 µs on a surface
(RectBivariateSpline: 540 µs; 3,000 slots: 220 µs and 2,500 µs), and importing scipy.interpolate
takes 0.12 s more, a tenth of a short job. Measured on two shared cores.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Integers, Real


@dataclass(frozen=True, slots=True, eq=False)
class CubicSpline:
    """A cubic spline on the even grid `first`, `first` + `step`, ....

    `pieces` (4, m - 1) are its polynomials, highest powers first. Beyond the grid the outermost
    polynomials are continued.

    >>> x = np.arange(5.0)
    >>> spline = CubicSpline.through(x, x**3)
    >>> [float(part.round(6)) for part in spline.partials(1.5)]
    [3.375, 6.75, 9.0]
    """

    first: float
    step: float
    pieces: Real

    @classmethod
    def through(cls, x: Real, y: Real) -> "CubicSpline":
        """Return the spline through `y` (m,) at the evenly spaced `x` (m,), m >= 4."""
        step = float(x[-1] - x[0]) / (len(x) - 1)
        return cls(float(x[0]), step, cubic_pieces(step, y))

    def __call__(self, x: ArrayLike) -> Real:
        """Return the spline at `x` (...)."""
        return _value(*self._piece(x))

    def partials(self, x: ArrayLike) -> tuple[Real, Real, Real]:
        """Return the spline and both derivatives at `x` (...)."""
        piece, t = self._piece(x)
        return _value(piece, t), _first(piece, t), _second(piece, t)

    def _piece(self, x: ArrayLike) -> tuple[Real, Real]:
        """Return the polynomials (4, ...) at `x` (...), and how far into them that is."""
        steps = (np.asarray(x, dtype=float) - self.first) / self.step
        k = np.minimum(np.maximum(steps.astype(np.intp), 0), self.pieces.shape[1] - 1)
        return self.pieces.take(k, axis=1), (steps - k) * self.step


@dataclass(frozen=True, slots=True, eq=False)
class GridPosition:
    """Where numbers lie on an even grid: the index of the cell, and the offset into it."""

    cell: Integers
    offset: Real

    @classmethod
    def on(cls, grid: Real, x: Real) -> "GridPosition":
        """Return the position of x (...) on `grid`; numbers beyond it are moved to its ends."""
        step = grid[1] - grid[0]
        inside = np.minimum(np.maximum(x, grid[0]), grid[-1]) - grid[0]
        cell = np.minimum((inside / step).astype(np.intp), len(grid) - 2)
        return cls(cell, inside - cell * step)


@dataclass(frozen=True, slots=True, eq=False)
class BicubicSpline:
    """A bicubic spline f(x, y) on even grids: twice continuously differentiable, not-a-knot.

    `cells` (4, 4, (m - 1) (k - 1)) are the polynomials of the cells, highest powers first. Beyond
    the grid, f is that of the nearest point on it. Callers locate y by `locate` first: where y
    stays the same from call to call, that is done once.

    >>> x = y = np.arange(5.0)
    >>> spline = BicubicSpline.through(x, y, np.outer(x**2, y))
    >>> [float(part.round(6)) for part in spline.by_x(np.array(1.5), spline.locate(np.array(2.0)))]
    [4.5, 6.0, 4.0]
    """

    x: Real
    y: Real
    cells: Real

    @classmethod
    def through(cls, x: Real, y: Real, values: Real) -> "BicubicSpline":
        """Return the spline through `values` (m, k) on the even grids `x` (m,) and `y` (k,)."""
        along = cubic_pieces(float(x[1] - x[0]), values)  # (4, m - 1, k)
        both = cubic_pieces(float(y[1] - y[0]), np.moveaxis(along, 2, 0))  # (4, k - 1, 4, m - 1)
        return cls(x, y, both.transpose(2, 0, 3, 1).reshape(4, 4, -1))

    def locate(self, y: Real) -> GridPosition:
        """Return the position of y (...) on the grid, the second argument of the methods below."""
        return GridPosition.on(self.y, y)

    def value(self, x: Real, y: GridPosition) -> Real:
        """Return f at x (...) and y (...)."""
        s, cell = self._cell(x, y)
        return _value(_value(cell, y.offset), s)

    def by_x(self, x: Real, y: GridPosition) -> tuple[Real, Real, Real]:
        """Return f, f_x and f_xx."""
        s, cell = self._cell(x, y)
        along = _value(cell, y.offset)
        return _value(along, s), _first(along, s), _second(along, s)

    def by_both(self, x: Real, y: GridPosition) -> tuple[Real, Real, Real, Real, Real, Real]:
        """Return f, f_x, f_y, f_xx, f_xy and f_yy."""
        s, cell = self._cell(x, y)
        f, f_y, f_yy = (part(cell, y.offset) for part in (_value, _first, _second))
        return (
            _value(f, s),
            _first(f, s),
            _value(f_y, s),
            _second(f, s),
            _first(f_y, s),
            _value(f_yy, s),
        )

    def _cell(self, x: Real, y: GridPosition) -> tuple[Real, Real]:
        """Return the offsets of x in their cells (...), and the polynomials there, (4, 4, ...)."""
        at = GridPosition.on(self.x, x)
        cell = self.cells.take(at.cell * (len(self.y) - 1) + y.cell, axis=2)
        return at.offset, cell.swapaxes(0, 1)


def _value(c: Real, t: Real) -> Real:
    """Return the cubics c (4, ..., points) at t (points)."""
    return np.asarray(((c[0] * t + c[1]) * t + c[2]) * t + c[3])


def _first(c: Real, t: Real) -> Real:
    """Return the first derivatives of the cubics c at t."""
    return np.asarray((3 * t * c[0] + 2 * c[1]) * t + c[2])


def _second(c: Real, t: Real) -> Real:
    """Return the second derivatives of the cubics c at t."""
    return np.asarray(6 * t * c[0] + 2 * c[1])


def cubic_pieces(step: float, y: Real) -> Real:
    """Return the polynomials (4, m - 1, ...) of the splines through `y` (m, ...), m >= 4.

    Twice continuously differentiable; at the second and the last but one point the third
    derivative is continuous too (not-a-knot). With slopes s and secants d on an even grid,
    s_{k-1} + 4 s_k + s_{k+1} = 3 (d_{k-1} + d_k), and s_0 + 2 s_1 = (5 d_0 + d_1) / 2.

    >>> cubic_pieces(1.0, np.arange(4.0) ** 2)[:, 1].round(6).tolist()  # (1 + t)²
    [0.0, 1.0, 2.0, 1.0]
    """
    from scipy.linalg import lapack  # with the optimiser, not before

    secant = np.diff(y, axis=0) / step
    right = np.empty_like(y, dtype=float)
    right[1:-1] = 3 * (secant[:-1] + secant[1:])
    right[0], right[-1] = (5 * secant[0] + secant[1]) / 2, (5 * secant[-1] + secant[-2]) / 2
    diagonal, (below, above) = np.ones(len(y)), np.ones((2, len(y) - 1))
    diagonal[1:-1] = 4
    above[0] = below[-1] = 2
    slope = lapack.dgtsv(below, diagonal, above, right.reshape(len(y), -1))[3].reshape(right.shape)
    bend = (slope[:-1] + slope[1:] - 2 * secant) / step
    return np.stack([bend / step, (secant - slope[:-1]) / step - bend, slope[:-1], y[:-1]])
