"""Lengths and distances in the plane."""

import numpy as np

from faao_mav.arrays import Real


def lengths(vectors: Real) -> Real:
    """Return the Euclidean length of each of `vectors` (..., 2), shape (...).

    >>> lengths(np.array([[3.0, 4.0], [0.0, -2.0]]))
    array([5., 2.])
    """
    result: Real = np.hypot(vectors[..., 0], vectors[..., 1])
    return result


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
