"""How far a straight is from convex obstacles, and in which direction: vectorised.

The distance of the straight from a to b and a convex obstacle O is the largest

    d(u) = min(u . a, u . b) - h(u),   h(u) = max u . p over p in O,   over the directions |u| = 1

and where they overlap that maximum is below 0: minus the least way by which they come apart. It is
attained at the normal of a side of O, at one of the straight, or from a corner of O to a or b.
Source: Boyd and Vandenberghe, "Convex Optimization", 2004, 8.2; Gottschalk's separating axes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Flags, Real

_SHORTEST = 1e-12
"""The least length that a direction is divided by; far below a rounding error of positions."""


@dataclass(frozen=True)
class ConvexObstacles:
    """P convex polygons, each with all that is nearer than its `radius` (P,).

    `corners` (P, V, 2) go around counterclockwise; where there are fewer than V the last is
    repeated. A disc is one corner with a radius. Lengths are in m.
    """

    corners: Real
    radius: Real

    @classmethod
    def of(cls, pieces: Sequence[Real], radii: Sequence[float]) -> "ConvexObstacles":
        """Return the obstacles with these corners, (k, 2) each, and radii, m."""
        most = max(map(len, pieces), default=1)
        padded = [np.vstack([p, np.repeat(p[-1:], most - len(p), axis=0)]) for p in pieces]
        return cls(np.array(padded).reshape(-1, most, 2), np.array(radii, dtype=np.float64))

    def only(self, kept: Flags) -> "ConvexObstacles":
        """Return those obstacles that are `kept` (P,)."""
        return ConvexObstacles(self.corners[kept], self.radius[kept])

    def __len__(self) -> int:
        return len(self.corners)

    @cached_property
    def _sides(self) -> tuple[Real, Real]:
        """The outward normals (P, V, 2) of the sides and h there, infinite without a side."""
        along = np.roll(self.corners, -1, axis=1) - self.corners
        out = _unit(np.stack([along[..., 1], -along[..., 0]], axis=-1), axis=-1)
        offset = (out * self.corners).sum(axis=-1) + self.radius[:, None]
        return out, np.where((along != 0).any(axis=-1), offset, np.inf)[..., None]

    def separation(self, a: Real, b: Real) -> tuple[Real, Real]:
        """Return the directions u (2, P, n) of the greatest distance, and h(u) (P, n) there.

        The straights go from a to b, (2, n) each.
        """
        normals, offsets = self._sides
        values = np.minimum(normals @ a, normals @ b) - offsets
        piece, side = np.arange(len(self))[:, None], values.argmax(axis=1)
        best, h = values.max(axis=1), offsets[piece, side, 0]
        u = normals[piece, side].swapaxes(1, 2)
        for direction in self._between(a, b):
            far = (self.corners @ direction).max(axis=1) + self.radius[:, None]
            value = np.minimum(_dot(direction, a), _dot(direction, b)) - far
            better = (value > best) & direction.any(axis=1)
            best, h = np.where(better, value, best), np.where(better, far, h)
            u = np.where(better[:, None], direction, u)
        return u.swapaxes(0, 1), h

    def _between(self, a: Real, b: Real) -> Iterator[Real]:
        """Yield directions (P or 1, 2, n): across the straights, and from the nearest corners."""
        east, north = b - a
        across = _unit(np.stack([-north, east]), axis=0)[None]
        yield from (across, -across)
        squares = (self.corners**2).sum(axis=-1)[..., None] / 2
        for end in (a, b):
            nearest = (squares - self.corners @ end).argmin(axis=1)
            corner = self.corners[np.arange(len(self))[:, None], nearest]
            yield _unit(end - corner.swapaxes(1, 2), axis=1)


def _unit(vectors: Real, axis: int) -> Real:
    """Return `vectors` divided by their lengths; those without one are zero, no direction."""
    length = np.sqrt((vectors**2).sum(axis=axis, keepdims=True))
    return np.asarray(vectors / np.maximum(length, _SHORTEST))


def _dot(x: Real, y: Real) -> Real:
    """Return the products (P or 1, n) of x (P or 1, 2, n) and y (2, n)."""
    return np.asarray(x[:, 0] * y[0] + x[:, 1] * y[1])
