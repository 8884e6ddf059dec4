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

from faao_mav.arrays import Integers, Real

_SHORTEST = 1e-12
"""The least length that a direction is divided by; far below a rounding error of positions."""

_FAR = 30.0
"""The distance, m, from which an obstacle is the disc about it. Chosen: forces of obstacles so far
away are next to nothing."""


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
        """The outward normals (V, 2, P) of the sides, and h there; h is infinite without a side."""
        along = np.roll(self.corners, -1, axis=1) - self.corners
        out = np.stack([along[..., 1], -along[..., 0]])
        length = np.hypot(*out)
        out = out / np.maximum(length, _SHORTEST)
        offset = np.einsum("cpv,pvc->vp", out, self.corners) + self.radius
        return out.transpose(2, 0, 1), np.where(length.T > _SHORTEST, offset, np.inf)

    @cached_property
    def _discs(self) -> tuple[Real, Real]:
        """Centers (2, P, 1, 1) and radii (P, 1, 1) of the discs about the obstacles."""
        center = (self.corners.min(axis=1) + self.corners.max(axis=1)) / 2
        radius = np.hypot(*(self.corners - center[:, None]).transpose(2, 0, 1)).max(axis=1)
        return center.T[..., None, None], (radius + self.radius)[:, None, None]

    def separation(self, a: Real, b: Real) -> tuple[Real, Real]:
        """Return directions u (2, P, flights, n) and h(u) there, of the straights from a to b.

        a and b are (2, flights, n). The directions are those of the greatest distance; of obstacles
        farther than `_FAR` both are those of a disc about them.
        """
        center, size = self._discs
        away = (a + b)[:, None] / 2 - center
        u = _unit(away)
        h = u[0] * center[0] + u[1] * center[1] + size
        least = np.minimum(u[0] * a[0] + u[1] * a[1], u[0] * b[0] + u[1] * b[1]) - h
        near = np.nonzero(least < _FAR)
        piece, a, b = near[0], a[:, near[1], near[2]], b[:, near[1], near[2]]
        best = self._best(piece, a, b)
        u[0][near], u[1][near] = best
        h[near] = self._support(piece, best)[0]
        return u, h

    def _best(self, piece: Integers, a: Real, b: Real) -> Real:
        """Return the directions (2, m) of the greatest distances.

        Of m pairs: an obstacle `piece` (m,) and the straight from a to b (2, m).
        """
        best, u = np.full(len(piece), -np.inf), np.zeros_like(a)
        for direction, far in self._candidates(piece, a, b):
            value = np.minimum(_dot(direction, a), _dot(direction, b)) - far
            better = value > best
            best, u = np.where(better, value, best), np.where(better, direction, u)
        return u

    def _candidates(self, piece: Integers, a: Real, b: Real) -> Iterator[tuple[Real, Real]]:
        for normals, offsets in zip(*self._sides, strict=True):
            yield normals[:, piece], offsets[piece]
        across = _across(_unit(b - a))
        for side in (across, -across):
            yield side, self._support(piece, side)[0]
        corners = self.corners[piece].transpose(2, 1, 0)
        for end in (a, b):
            square = (corners[0] - end[0]) ** 2 + (corners[1] - end[1]) ** 2
            nearest = square.argmin(axis=0)
            away = end - corners[:, nearest, np.arange(len(piece))]
            u = _unit(away)
            yield u, self._support(piece, u)[0]

    def _support(self, piece: Integers, u: Real) -> tuple[Real, Real]:
        """Return h(u) (m,) of obstacles `piece` and the corners p (2, m) with h = u . p + r."""
        corners = self.corners[piece].transpose(2, 1, 0)
        along = corners[0] * u[0] + corners[1] * u[1]
        farthest, every = along.argmax(axis=0), np.arange(len(piece))
        return along[farthest, every] + self.radius[piece], corners[:, farthest, every]


def _unit(vectors: Real) -> Real:
    """Return `vectors` (2, ...) divided by their lengths, and east for those without one."""
    length = np.hypot(*vectors)
    unit = vectors / np.maximum(length, _SHORTEST)
    unit[0] = np.where(length > _SHORTEST, unit[0], 1.0)
    unit[1] = np.where(length > _SHORTEST, unit[1], 0.0)
    return np.asarray(unit)


def _across(u: Real) -> Real:
    """Return u, turned left by a right angle."""
    return np.stack([-u[1], u[0]])


def _dot(x: Real, y: Real) -> Real:
    return np.asarray(x[0] * y[0] + x[1] * y[1])
