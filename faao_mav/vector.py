"""Lengths and distances in the plane."""

import math
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real

Vector: TypeAlias = tuple[float, float]
"""East and north components, metres or m/s."""


def lengths(vectors: Real) -> Real:
    """Return the Euclidean length of each of `vectors` (..., 2), shape (...).

    >>> lengths(np.array([[3.0, 4.0], [0.0, -2.0]]))
    array([5., 2.])
    """
    result: Real = np.hypot(vectors[..., 0], vectors[..., 1])
    return result


def chord(center: tuple[float, float], radius: float, direction: Real) -> tuple[float, float]:
    """Return the least and the greatest s with s `direction` in a disc about `center`.

    The least is above the greatest where there is none. The length of `direction` (2,) is 1 or 0.

    >>> chord((-6.0, 8.0), 10.0, np.array([1.0, 0.0]))
    (-12.0, 0.0)
    >>> chord((-6.0, 8.0), 7.0, np.array([1.0, 0.0]))
    (inf, -inf)
    """
    if math.isinf(radius):
        return -math.inf, math.inf
    along = float(np.dot(center, direction))
    room = radius**2 - (math.hypot(*center) ** 2 - along**2)
    if room < 0:
        return math.inf, -math.inf
    return along - math.sqrt(room), along + math.sqrt(room)


def distances_to_segment(points: Real, begin: Real, end: Real) -> Real:
    """Return the distances (n,) of `points` (n, 2) from the segment `begin` (2,) to `end` (2,).

    >>> points = np.array([[5.0, 3.0], [-4.0, 3.0]])
    >>> distances_to_segment(points, np.array([0.0, 0.0]), np.array([10.0, 0.0]))
    array([3., 5.])
    """
    chord = end - begin
    square = float(chord @ chord)
    away = points - begin
    if square > 0:
        along = np.minimum(np.maximum(away @ chord / square, 0), 1)
        away -= along[:, None] * chord
    return lengths(away)


def distances_to_path(points: Real, path: Real) -> Real:
    """Return the distance of each of `points` (n, 2) from the polyline `path` (m, 2), (n,).

    Points that are not finite are infinitely far.

    >>> distances_to_path(np.array([[1.0, 2.0], [7.0, 4.0]]), np.array([[0.0, 0.0], [4.0, 0.0]]))
    array([2., 5.])
    """
    import shapely  # seldom needed, and slow to load

    ends = np.vstack([path, path[-1:]])  # of one leg at least
    each = np.asarray(shapely.linestrings(np.stack([ends[:-1], ends[1:]], axis=1)))
    with np.errstate(divide="ignore", invalid="ignore"):  # the length of a leg may underflow
        (found, _), distances = shapely.STRtree(each).query_nearest(
            shapely.points(points), return_distance=True, all_matches=False
        )
    result = np.full(len(points), np.inf)
    result[found] = distances
    return result
