"""A table of a smooth function of two numbers, read with all its derivatives at once."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.optimizer.rates.spline import pieces


@dataclass(frozen=True, slots=True, eq=False)
class Bicubic:
    """A bicubic spline on even grids: twice continuously differentiable, not-a-knot at the edges.

    `cells` (4, 4, (m - 1) (k - 1)) are the polynomials of the cells, highest powers first. Beyond
    the grid the function is that of the nearest place on it.
    """

    x: Real
    y: Real
    cells: Real

    @classmethod
    def through(cls, x: Real, y: Real, values: Real) -> "Bicubic":
        """Return the spline through `values` (m, k) on the even grids `x` (m,) and `y` (k,)."""
        along = pieces(float(x[1] - x[0]), values)  # (4, m - 1, k)
        both = pieces(float(y[1] - y[0]), np.moveaxis(along, 2, 0))  # (4, k - 1, 4, m - 1)
        return cls(x, y, both.transpose(2, 0, 3, 1).reshape(4, 4, -1))

    def rows(self, y: Real) -> "Rows":
        """Return what is to be known of y (...): once, where it stays."""
        j, t = _place(self.y, y)
        return Rows(j, t)

    def value(self, x: Real, rows: "Rows") -> Real:
        """Return the function at x (...) and the y of `rows`."""
        s, cell = self._at(x, rows)
        return _value(_value(cell, rows.into), s)

    def by_x(self, x: Real, rows: "Rows") -> tuple[Real, Real, Real]:
        """Return the function and its first two derivatives by x."""
        s, cell = self._at(x, rows)
        along = _value(cell, rows.into)
        return _value(along, s), _slope(along, s), _bend(along, s)

    def by_both(self, x: Real, rows: "Rows") -> tuple[Real, Real, Real, Real, Real, Real]:
        """Return the function and its derivatives by x, y, xx, xy and yy."""
        s, cell = self._at(x, rows)
        t = rows.into
        along, slope, bend = _value(cell, t), _slope(cell, t), _bend(cell, t)
        return (
            _value(along, s),
            _slope(along, s),
            _value(slope, s),
            _bend(along, s),
            _slope(slope, s),
            _value(bend, s),
        )

    def _at(self, x: Real, rows: "Rows") -> tuple[Real, Real]:
        """Return how far into their cells x are, and the polynomials there, 4 by 4."""
        i, s = _place(self.x, x)
        cell = self.cells.take(i * (len(self.y) - 1) + rows.cell, axis=2)
        return s, cell.swapaxes(0, 1)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The cells of some y and how far into them y is."""

    cell: Integers
    into: Real


def _place(grid: Real, x: Real) -> tuple[Integers, Real]:
    """Return the cells of x and how far into them x is."""
    step = grid[1] - grid[0]
    inside = np.minimum(np.maximum(x, grid[0]), grid[-1]) - grid[0]
    cell = np.minimum((inside / step).astype(np.intp), len(grid) - 2)
    return cell, inside - cell * step


def _value(c: Real, t: Real) -> Real:
    """Evaluate the cubics c (4, ..., points) at t (points)."""
    return np.asarray(((c[0] * t + c[1]) * t + c[2]) * t + c[3])


def _slope(c: Real, t: Real) -> Real:
    return np.asarray((3 * t * c[0] + 2 * c[1]) * t + c[2])


def _bend(c: Real, t: Real) -> Real:
    return np.asarray(6 * t * c[0] + 2 * c[1])
