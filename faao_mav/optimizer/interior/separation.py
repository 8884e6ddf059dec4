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

from faao_mav.arrays import Real

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

    def __len__(self) -> int:
        return len(self.corners)

    @cached_property
    def _sides(self) -> tuple[Real, Real]:
        """The outward normals (V, 2, P, 1) of the sides and h there, infinite without a side."""
        along = np.roll(self.corners, -1, axis=1) - self.corners
        out = np.stack([along[..., 1], -along[..., 0]])
        length = np.hypot(*out)
        out = out / np.maximum(length, _SHORTEST)
        offset = np.einsum("cpv,pvc->vp", out, self.corners) + self.radius
        offset = np.where(length.T > _SHORTEST, offset, np.inf)
        return out.transpose(2, 0, 1)[..., None], offset[..., None]

    def separation(self, a: Real, b: Real) -> tuple[Real, Real]:
        """Return the directions u (2, P, n) of the greatest distance, and h(u) (P, n) there.

        The straights go from a to b, (2, n) each.
        """
        best = np.full((len(self), a.shape[1]), -np.inf)
        u, h = np.zeros((2, *best.shape)), np.zeros(best.shape)
        for direction, far in self._candidates(a, b):
            value = np.minimum(_dot(direction, a), _dot(direction, b)) - far
            better = value > best
            best, u = np.where(better, value, best), np.where(better, direction, u)
            h = np.where(better, far, h)
        return u, h

    def _candidates(self, a: Real, b: Real) -> Iterator[tuple[Real, Real]]:
        """Yield directions (2, P, n) and h there; an axis of length 1 stands for any."""
        yield from zip(*self._sides, strict=True)
        east, north = _unit(b - a)
        across = np.stack([-north, east])[:, None]
        corners = self.corners.transpose(2, 1, 0)[..., None]  # (2, V, P, 1)
        away = [end[:, None, None] - corners for end in (a, b)]
        nearest = [np.argmin((each**2).sum(axis=0), axis=0)[None, None] for each in away]
        from_corners = (
            _unit(np.take_along_axis(each, at, axis=1)[:, 0])
            for each, at in zip(away, nearest, strict=True)
        )
        for u in (across, -across, *from_corners):
            yield u, _dot(u[:, None], corners).max(axis=0) + self.radius[:, None]


def _unit(vectors: Real) -> Real:
    """Return `vectors` (2, ...) divided by their lengths, and east for those without one."""
    length = np.hypot(*vectors)
    unit = vectors / np.maximum(length, _SHORTEST)
    return np.where(length > _SHORTEST, unit, np.reshape((1.0, 0.0), (2, *[1] * length.ndim)))


def _dot(x: Real, y: Real) -> Real:
    return np.asarray(x[0] * y[0] + x[1] * y[1])
