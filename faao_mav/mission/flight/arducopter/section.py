"""What ArduCopter flies as one leg: a straight, or a run of spline waypoints.

A spline leg is the cubic Hermite curve between its ends with tangents (next - previous), zero
where the aircraft rests. A run of them is flown through at nearly constant speed.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real

_POINTS = 24  # of a curve, per spline leg


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """From point `first` to point `last` along `curve` (n, 3) m, at way `way` (n,) m.

    `passed` (last - first,) m is the way at each point after the first. `spline` tells the kinds
    apart.
    """

    first: int
    last: int
    curve: Real
    way: Real
    passed: Real
    spline: bool

    @property
    def length(self) -> float:
        """The whole way, m."""
        return float(self.way[-1])

    @property
    def turn(self) -> float:
        """The mean turn of the polyline at the points in between, rad; at most 1."""
        knots = self.at(np.concatenate([[0.0], self.passed]))
        steps = np.diff(knots, axis=0)
        if len(steps) < 2:
            return 0.0
        sizes = np.sqrt(np.sum(steps**2, axis=1))
        cosines = np.sum(steps[1:] * steps[:-1], axis=1) / np.maximum(sizes[1:] * sizes[:-1], 1e-12)
        return min(1.0, float(np.arccos(np.clip(cosines, -1.0, 1.0)).mean()))

    def at(self, way: Real) -> Real:
        """Return the places (..., 3) at `way` (...), m."""
        return np.stack([np.interp(way, self.way, x) for x in self.curve.T], axis=-1)

    def direction(self, way: Real) -> Real:
        """Return unit tangents (..., 3) at `way` (...), m; zero for a section of no length."""
        steps = np.diff(self.curve, axis=0)
        sizes = np.sqrt(np.sum(steps**2, axis=1))[:, None]
        units = np.divide(steps, sizes, out=np.zeros_like(steps), where=sizes > 0)
        k = np.clip(np.searchsorted(self.way, way, side="right") - 1, 0, len(units) - 1)
        result: Real = units[k]
        return result


def sections(
    points: Real, splines: NDArray[np.bool_], stops: NDArray[np.bool_]
) -> Iterator[Section]:
    """Yield the sections of the path through `points` (m, 3), in order."""
    first, end = 0, len(points) - 1
    while first < end:
        last = first + 1
        spline = bool(splines[last])
        while spline and last < end and splines[last + 1] and not stops[last]:
            last += 1
        if spline:
            parts = [_hermite(points, k, splines, stops) for k in range(first, last)]
            curve = np.concatenate([points[first : first + 1], *parts])
            knots = np.arange(1, last - first + 1) * _POINTS
        else:
            curve, knots = points[first : last + 1], np.array([1])
        steps = np.sqrt(np.sum(np.diff(curve, axis=0) ** 2, axis=1))
        way = np.concatenate([[0.0], np.cumsum(steps)])
        yield Section(first, last, curve, way, way[knots], spline)
        first = last


def _hermite(points: Real, k: int, splines: NDArray[np.bool_], stops: NDArray[np.bool_]) -> Real:
    """Return the curve from point k, which is left out, to point k + 1."""
    begin, end = points[k], points[k + 1]
    leaving = np.zeros(3) if stops[k] else end - points[k - 1]
    ends = stops[k + 1] or not splines[k + 2]
    arriving = np.zeros(3) if ends else points[k + 2] - begin
    t = np.linspace(0.0, 1.0, _POINTS + 1)[1:, None]
    result: Real = (
        (2 * t**3 - 3 * t**2 + 1) * begin
        + (t**3 - 2 * t**2 + t) * leaving
        + (3 * t**2 - 2 * t**3) * end
        + (t**3 - t**2) * arriving
    )
    return result
