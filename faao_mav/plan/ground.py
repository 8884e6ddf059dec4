"""Ground under maps of gains: where no aircraft can be at a height, as areas to stay out of."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.mission.fence_area import Area
from faao_mav.radio.gain_map import GainMap
from faao_mav.vector import Vector

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_MOST_CORNERS = 200
"""Corners of all areas of ground above which they are made simpler. Chosen: the shortest way among
so many takes a third of a second, among 1,000 half a minute."""

_COARSER = 2
"""How often areas are made simpler, each time by twice as much as before. Chosen: once more bars a
third of a map of which a tenth is ground."""


@lru_cache(maxsize=16)
def ground_areas(
    maps: Sequence[GainMap], height: float, kept: Sequence[Vector]
) -> tuple[Area, ...]:
    """Return the ground of `maps` at a `height`, m, as areas to stay out of.

    Each barred point of a map bars the cell about it. Cells are joined over gaps of less than one
    cell, without the holes in which none of the places `kept` is, and simplified outwards by half a
    cell: by more where many corners are left and none of the `kept` would be barred by it.
    """
    import shapely

    shapes = [_cells(each, each.barred(height)) for each in maps]
    barred = shapely.union_all(shapes)
    if barred.is_empty:
        return ()
    by = max(max(_steps(each)) for each in maps) / 2
    found = _simplified(barred, by, kept)
    for _ in range(_COARSER):
        if shapely.get_num_coordinates(found) <= _MOST_CORNERS:
            break
        by *= 2
        simpler = _simplified(barred, by, kept)
        if any(
            simpler.covers(shapely.Point(p)) and not found.covers(shapely.Point(p)) for p in kept
        ):
            break
        found = simpler
    return tuple(Area("the ground", False, part) for part in shapely.get_parts(found))


def in_ground(maps: Sequence[GainMap], height: float, places: Real) -> Flags:
    """Return which of `places` (n, 2), m, are in the ground of `maps` at a `height`, m."""
    found = np.zeros(len(places), dtype=np.bool_)
    for each in maps:
        k, m = (
            np.rint((x - side[0]) / step).astype(int)
            for x, side, step in zip(places.T, (each.east, each.north), _steps(each), strict=True)
        )
        on = (k >= 0) & (k < len(each.east)) & (m >= 0) & (m < len(each.north))
        found[on] |= each.barred(height)[m[on], k[on]]
    return found


def _steps(known: GainMap) -> tuple[float, float]:
    return float(known.east[1] - known.east[0]), float(known.north[1] - known.north[0])


def _cells(known: GainMap, barred: Flags) -> "BaseGeometry":
    """Return the cells about the points of a map that are `barred` (m, k)."""
    import shapely

    dx, dy = _steps(known)
    edges = np.diff(np.pad(barred, ((0, 0), (1, 1))).astype(int), axis=1)
    (row, first), (_, last) = np.nonzero(edges > 0), np.nonzero(edges < 0)  # runs along each row
    x, y = known.east[0] - dx / 2, known.north[0] - dy / 2
    boxes = shapely.box(x + dx * first, y + dy * row, x + dx * last, y + dy * (row + 1))
    return shapely.union_all(boxes)


def _simplified(barred: "BaseGeometry", by: float, kept: Sequence[Vector]) -> "BaseGeometry":
    """Return what covers `barred`, by at most about 2 `by`, m, more."""
    import shapely

    closed = barred.buffer(by, join_style="mitre").buffer(-by, join_style="mitre")
    wide = closed.union(barred).buffer(by, join_style="mitre").simplify(by).union(barred)
    places = [shapely.Point(place) for place in kept]
    parts = []
    for part in shapely.get_parts(wide):
        holes = [
            ring for ring in part.interiors if any(shapely.Polygon(ring).covers(p) for p in places)
        ]
        parts.append(shapely.Polygon(part.exterior, holes))
    return shapely.union_all(parts)
