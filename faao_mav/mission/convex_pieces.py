"""Polygons cut into convex ones: a flight keeps out of a convex piece by half-planes.

The triangles of a constrained Delaunay triangulation are joined across their common sides, the
longest first, where the result is convex (Hertel and Mehlhorn, 1983: at most four times as many
pieces as need be).
"""

import math
from itertools import pairwise

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
    pieces: dict[int, BaseGeometry] = {}
    sides: dict[tuple[tuple[float, ...], ...], list[int]] = {}
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
    for number, triangle in enumerate(triangles):
        pieces[number] = triangle
        corners = [tuple(corner) for corner in shapely.get_coordinates(triangle)]
        for a, b in pairwise(corners):
            sides.setdefault((min(a, b), max(a, b)), []).append(number)
    part_of = {number: number for number in pieces}

    def root(number: int) -> int:
        while part_of[number] != number:
            number = part_of[number]
        return number

    common = [(side, both) for side, both in sides.items() if len(both) == 2]
    common.sort(key=lambda each: -float(math.dist(*each[0])))
    for _, both in common:
        first, second = map(root, both)
        if first == second:
            continue
        joined = shapely.union(pieces[first], pieces[second])
        hull = joined.convex_hull
        if hull.area - joined.area <= _FLAT * hull.area:
            pieces[first] = hull
            part_of[second] = first
            del pieces[second]
    return [
        shapely.get_coordinates(shapely.orient_polygons(piece))[:-1] for piece in pieces.values()
    ]
