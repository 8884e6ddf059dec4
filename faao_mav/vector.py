"""Lengths and distances in the plane."""

import numpy as np

from faao_mav.arrays import Real


def lengths(vectors: Real) -> Real:
    """Return the Euclidean length of each of `vectors` (..., 2), shape (...)."""
    result: Real = np.hypot(vectors[..., 0], vectors[..., 1])
    return result


def distances_to_segment(points: Real, begin: Real, end: Real) -> Real:
    """Return the distance of each of `points` (n, 2) from the segment of two points (2,), (n,)."""
    chord = end - begin
    square = float(chord @ chord)
    away = points - begin
    if square > 0:
        along = np.minimum(np.maximum(away @ chord / square, 0), 1)
        away -= along[:, None] * chord
    return lengths(away)
