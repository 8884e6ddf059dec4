"""Polygons cut into convex ones: a flight keeps out of a convex piece by half-planes.

The triangles of a constrained Delaunay triangulation are joined across their common sides, the
longest first, where the result is convex (Hertel and Mehlhorn, 1983: at most four times as many
pieces as need be).
"""

import math
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from faao_mav.arrays import Real

_FLAT = 1e-9
"""Share of its hull's area that a piece may lack and still count as convex: rounding."""


def convex_pieces(shape: BaseGeometry) -> list[Real]:
    """Return the corners (k, 2), counterclockwise, of convex polygons that together are `shape`.

    >>> import shapely
    >>> corner = shapely.Polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
    >>> [len(piece) for piece in convex_pieces(corner)]
    [4, 4]
    """
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
    sides: dict[tuple[tuple[float, ...], ...], list[int]] = {}
    for number, triangle in enumerate(pieces):
        for side in pairwise(map(tuple, shapely.get_coordinates(triangle).tolist())):
            sides.setdefault(tuple(sorted(side)), []).append(number)
    common = [(side, both) for side, both in sides.items() if len(both) == 2]
    common.sort(key=lambda each: -math.dist(*each[0]))
    owners = np.arange(len(pieces))  # the piece that each triangle is of
    for _, both in common:
        first, second = owners[both]
        hull = shapely.MultiPolygon([pieces[first], pieces[second]]).convex_hull
        lacks = hull.area - pieces[first].area - pieces[second].area
        if first != second and lacks <= _FLAT * hull.area:
            pieces[first] = hull
            owners[owners == second] = first
    whole = shapely.orient_polygons(pieces[np.unique(owners)])
    return [shapely.get_coordinates(piece)[:-1] for piece in whole]
