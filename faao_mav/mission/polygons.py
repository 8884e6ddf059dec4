"""Polygons of the plane: the shortest way within them, their convex pieces, what they enclose.

Sources: Lozano-Perez and Wesley, "An algorithm for planning collision-free paths among polyhedral
obstacles", Communications of the ACM 22 (1979); Hertel and Mehlhorn, "Fast triangulation of simple
polygons" (1983).
"""

import heapq
import math
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from faao_mav.arrays import Flags, Real

_FLAT = 1e-9  # Share of its hull's area that a piece may lack and still count as convex: rounding.


def shortest_way(area: BaseGeometry, start: Real, end: Real) -> Real | None:
    """Return the corners (k, 2) of the shortest way in `area`, a (multi)polygon, or None.

    `start` and `end` are (2,); both are corners of the way. It is found by A* over the corners that
    see each other. A shortest way turns only at corners of the area that point inward (those of an
    obstacle), and only around them: the straights before and after touch the edge there and do not
    cross it.
    """
    shapely.prepare(area)
    if not shapely.covers(area, shapely.points([start, end])).all():
        return None
    before, corners, after = _inward_corners(area)
    nodes = np.vstack([corners, end, start])
    last, first = len(nodes) - 2, len(nodes) - 1
    ahead = np.hypot(*(nodes - end).T)
    length = np.full(len(nodes), np.inf)
    length[first] = 0
    came_from = np.full(len(nodes), -1)
    done = np.zeros(len(nodes), dtype=np.bool_)
    queue = [(ahead[first], first)]
    while queue:
        _, node = heapq.heappop(queue)
        if done[node]:
            continue
        if node == last:
            break
        done[node] = True
        here = nodes[node]
        total = length[node] + np.hypot(*(nodes - here).T)
        near = ~done & (total < length)
        near[:last] &= _touches(here, corners, before, after)
        if node < last:
            near &= _touches(here, nodes, before[node], after[node])
        near[last] = total[last] < length[last]
        seen = np.flatnonzero(near)
        ends = nodes[seen]
        lines = shapely.linestrings(np.stack([np.broadcast_to(here, ends.shape), ends], axis=1))
        seen = seen[shapely.covers(area, lines)]
        length[seen], came_from[seen] = total[seen], node
        for other in seen.tolist():
            heapq.heappush(queue, (length[other] + ahead[other], other))
    if not np.isfinite(length[last]):
        return None
    way = [last]
    while way[-1] != first:
        way.append(int(came_from[way[-1]]))
    corners_of_way = nodes[way[::-1]]
    turns = np.concatenate([[True], (np.diff(corners_of_way, axis=0) != 0).any(axis=1)])
    turns[-1] = True
    return np.asarray(corners_of_way[turns])


def _inward_corners(area: BaseGeometry) -> tuple[Real, Real, Real]:
    """Return the corners before, the inward corners, and the corners after them, each (m, 2)."""
    triples = []
    for part in shapely.get_parts(area):
        for ring in shapely.get_rings(shapely.orient_polygons(part)):
            corners = shapely.get_coordinates(ring)[:-1]
            before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
            inward = _side(before, corners, after) < 0  # the area is on the left
            triples.append(np.stack([before, corners, after])[:, inward])
    before, corners, after = np.concatenate(triples, axis=1)
    return before, corners, after


def _side(a: Real, b: Real, c: Real) -> Real:
    """Return twice the area of the triangles a b c: above 0 where c is to the left of a b."""
    ab, ac = b - a, c - a
    return np.asarray(ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0])


def _touches(a: Real, b: Real, before: Real, after: Real) -> Flags:
    """Return whether the straight a b leaves both corners beside one of its ends on one side."""
    return np.asarray(_side(a, b, before) * _side(a, b, after) >= 0)


def convex_pieces(shape: BaseGeometry) -> list[Real]:
    """Return the corners (k, 2), counterclockwise, of convex polygons that together are `shape`.

    The triangles of a constrained Delaunay triangulation are joined across their common sides, the
    longest first, where the result is convex: at most four times as many pieces as need be.

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


def enclosed(outline: shapely.Polygon) -> BaseGeometry:
    """Return what an odd number of turns of `outline` encloses.

    Its edges cut the plane into faces, each enclosed or not as one of its points is. For 100
    corners that cross everywhere `shapely.make_valid` takes 50 times as long.
    """
    edges = shapely.union_all(outline.exterior)
    faces = shapely.get_parts(shapely.polygonize([edges]))
    x, y = shapely.get_coordinates(shapely.point_on_surface(faces)).T
    odd = np.zeros(len(faces), dtype=bool)
    for (x0, y0), (x1, y1) in pairwise(outline.exterior.coords):
        if y0 != y1:  # does the way east from (x, y) cross this edge?
            odd ^= ((y0 > y) != (y1 > y)) & (x < x0 + (x1 - x0) * ((y - y0) / (y1 - y0)))
    return shapely.coverage_union_all(faces[odd])


def polygonal(shape: BaseGeometry) -> BaseGeometry:
    """Return the part of `shape` that has an area."""
    parts = shapely.get_parts(shapely.get_parts(shape))
    flat = [part for part in parts if part.geom_type == "Polygon"]
    return shapely.union_all(flat) if flat else shapely.Polygon()
