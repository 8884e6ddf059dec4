"""A map of a hop's gain: dB over a regular grid of east and north, at one height or several.

It is the gain itself, or what the gain is above a law. Between the points of the grid a map is
bilinear, between its heights linear: so flights are priced. The optimiser searches on a bicubic
spline, which rounds its edges over a cell.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.radio.spline import Spline

_B_SPLINE = np.array([1, 4, 1]) / 6
"""The cubic B-spline at its own point of the grid and at those beside it."""

_BEYOND = 3
"""Points of such a spline beyond the grid: at two it is level."""

_FARTHEST = 10_000.0
"""Metres between a map's own origin and the plan's at most: the meridians of both are parallel
within 3e-3 up to 60 degrees of latitude, 3 m at a kilometre from the middle of the map."""


@dataclass(frozen=True, eq=False)
class GainMap:
    """dB over the map: `db` (j, m, k) at `heights` (j,), `north` (m,) and `east` (k,), m.

    Places and heights count from the origin of the plan, or from the map's own `origin`, where it
    has one: latitude and longitude, degrees, and, for the heights, m above mean sea level.
    `heights` rise, both sides have even steps. With `above_law` the `db` are above a law, and 0 off
    the map; otherwise they are the gain, which is known on the map alone. NaN is where no aircraft
    can be, as below ground; `ground` (m, k) is how high ground and what stands on it are, m, where
    the map tells it.
    """

    east: Real
    north: Real
    heights: Real
    db: Real
    above_law: bool = False
    ground: Real | None = None
    origin: tuple[float, ...] = ()

    def about(self, latitude: float, longitude: float, elevation: float) -> "GainMap":
        """Return the map with places and heights from another origin, where it has its own.

        It is moved as a whole, its middle to where that is. Raises `InputError` for an origin that
        is too far off.
        """
        if not self.origin:
            return self
        frame, own = LocalFrame(latitude, longitude), LocalFrame(*self.origin[:2])
        away = float(np.hypot(*frame.to_local(*self.origin[:2])))
        if away > _FARTHEST:
            raise InputError(
                f"origin: {', '.join(f'{x:.7g}' for x in self.origin)} lies {away / 1000:,.1f} km "
                f"from site.origin; expected at most {_FARTHEST / 1000:g} km"
            )
        middle = np.array([self.east[[0, -1]].mean(), self.north[[0, -1]].mean()])
        east, north = frame.to_local(*own.to_geodetic(middle)) - middle
        up = sum(self.origin[2:]) - elevation if self.origin[2:] else 0.0
        return replace(
            self,
            east=self.east + east,
            north=self.north + north,
            heights=self.heights + up,
            ground=None if self.ground is None else self.ground + up,
            origin=(),
        )

    def covers(self, place: Sequence[float]) -> bool:
        """Return whether a place [east, north], m, is on the map."""
        return all(s[0] <= x <= s[-1] for x, s in zip(place, (self.east, self.north), strict=True))

    def at(self, height: float) -> "Grid":
        """Return the map at a `height`, m; at the nearest of its own where that is beyond them.

        What is not known there is as at the nearest point that is.
        """
        db = filled(self._between(height))
        if not self.above_law:
            return Grid.through(self.east, self.north, db.T)
        x, y = (_widened(side) for side in (self.east, self.north))
        return Grid.through(x, y, np.pad(db.T, 1))

    def barred(self, height: float) -> Flags:
        """Return where no aircraft can be at a `height`, m: (m, k)."""
        barred = np.isnan(self._between(height))
        return barred if self.ground is None else barred | (self.ground >= height)

    def _between(self, height: float) -> Real:
        k = np.interp(height, self.heights, np.arange(len(self.heights)))
        low, high, share = int(np.floor(k)), int(np.ceil(k)), float(k % 1)
        return np.asarray((1 - share) * self.db[low] + share * self.db[high])


@dataclass(frozen=True, slots=True, eq=False)
class Grid(Spline):
    """A bilinear function f, of `values` (k, m) on the even grids `x` (k,) and `y` (m,), m.

    Beyond them f is that of the nearest point; its derivatives are those within the cells.

    >>> side = np.array([0.0, 10.0])
    >>> grid = Grid.through(side, side, np.array([[0.0, 2.0], [4.0, 6.0]]))
    >>> float(grid.value(np.array(5.0), np.array(10.0)))
    4.0
    """

    values: Real

    @classmethod
    def through(cls, x: Real, y: Real, values: Real) -> "Grid":
        """Return the function of `values` on the grids `x` and `y`."""
        f, dy = values, y[1] - y[0]
        f_x, f_y = np.diff(f, axis=0) / (x[1] - x[0]), np.diff(f, axis=1) / dy
        cells = np.array([[np.diff(f_x, axis=1) / dy, f_y[:-1]], [f_x[:, :-1], f[:-1, :-1]]])
        return cls(x, y, cells.reshape(2, 2, -1), values)

    def most_between(self, x: Real, y: Real) -> Real:
        """Return the most of f in the boxes between rising x (i + 1,) and y (j + 1,), (i, j), m."""
        lines = [
            np.union1d(edges, grid[(grid > edges[0]) & (grid < edges[-1])])
            for edges, grid in ((x, self.x), (y, self.y))
        ]
        most = self.value(lines[0][:, None], lines[1])  # f is highest in a corner of a piece
        for axis, (edges, line) in enumerate(zip((x, y), lines, strict=True)):
            first = np.searchsorted(line, edges)
            inside = np.maximum.reduceat(most, first[:-1], axis=axis)
            most = np.maximum(inside, most.take(first[1:], axis=axis))
        return np.asarray(most)

    def smoothed(self) -> Spline:
        """Return the bicubic B-spline whose coefficients are the values: within their extremes.

        It goes on beyond the grid until it is level there.
        """
        from scipy.ndimage import correlate1d  # with the optimiser, not before

        smooth = np.pad(self.values, _BEYOND, mode="edge")
        for axis in (0, 1):
            smooth = correlate1d(smooth, _B_SPLINE, axis, mode="nearest")
        x, y = (_widened(side, _BEYOND) for side in (self.x, self.y))
        return Spline.through(x, y, smooth)


def _widened(side: Real, points: int = 1) -> Real:
    """Return an even grid with so many `points` more at both ends."""
    away = (side[1] - side[0]) * np.arange(1, points + 1)
    return np.concatenate([side[0] - away[::-1], side, side[-1] + away])


def filled(db: Real) -> Real:
    """Return `db` (m, k) with the nearest known value where it is NaN."""
    if not np.isnan(db).any():
        return db
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(np.isnan(db), return_distances=False, return_indices=True)
    return np.asarray(db[tuple(nearest)])
