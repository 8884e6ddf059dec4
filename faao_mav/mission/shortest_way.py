"""The shortest way within an area: A* over the corners that see each other.

A shortest way turns only at corners of the area that point inward (those of an obstacle), and only
around them: at a corner the straights before and after touch the edge and do not cross it.
Source: Lozano-Perez and Wesley, "An algorithm for planning collision-free paths among polyhedral
obstacles", Communications of the ACM 22 (1979).
"""

import heapq

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from faao_mav.arrays import Flags, Real


def shortest_way(area: BaseGeometry, start: Real, end: Real) -> Real | None:
    """Return the corners (k, 2) of the shortest way in `area`, a prepared (multi)polygon, or None.

    `start` and `end` are (2,); both are corners of the way.
    """
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
