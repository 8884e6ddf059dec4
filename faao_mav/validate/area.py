"""Fences as plane areas, and how far a path stays from their edges."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_SEGMENTS = 64
"""Straights to a quarter of a circle: 0.075 mm of error a metre of radius."""


@dataclass(frozen=True, slots=True)
class Area:
    """One part of a fence, metres of a local frame; `name` is what people may call it.

    Circles become polygons, inside the circle for inclusions and outside for exclusions, so that
    what is found to stay within the fence does so. `crosses_itself`: its outline does; what counts
    as inside is then what an odd number of outlines encloses, as the autopilots count.
    """

    name: str
    inclusion: bool
    shape: "BaseGeometry"
    crosses_itself: bool = False


def areas_of(fence: Fence, frame: LocalFrame) -> tuple[Area, ...]:
    """Return the parts of `fence` in `frame`: polygons, then circles."""
    import shapely

    areas = []
    for n, polygon in enumerate(fence.polygons, start=1):
        outline = shapely.Polygon(frame.to_local(*np.transpose(polygon.vertices)))
        kind = "inclusion" if polygon.inclusion else "exclusion"
        shape = _polygonal(shapely.make_valid(outline))
        areas.append(
            Area(f"{kind} polygon {n}", polygon.inclusion, shape, not shapely.is_valid(outline))
        )
    for n, circle in enumerate(fence.circles, start=1):
        kind = "inclusion" if circle.inclusion else "exclusion"
        radius = circle.radius
        if not circle.inclusion:
            radius /= math.cos(math.pi / (4 * _SEGMENTS))
        center = shapely.Point(frame.to_local(*circle.center))
        shape = center.buffer(radius, quad_segs=_SEGMENTS)
        areas.append(Area(f"{kind} circle {n}", circle.inclusion, shape))
    return tuple(areas)


def free_area(areas: Sequence[Area], *, any_inclusion: bool) -> "BaseGeometry | None":
    """Return where the aircraft may be by the inclusions of `areas`, None if there are none.

    Inside one of them with `any_inclusion`, else inside all.
    """
    import shapely

    shapes = [area.shape for area in areas if area.inclusion]
    if not shapes:
        return None
    joined = shapely.union_all(shapes) if any_inclusion else shapely.intersection_all(shapes)
    return _polygonal(joined)


def lines(starts: Real, ends: Real) -> NDArray[np.object_]:
    """Return the straights from `starts` to `ends`, each (n, 2), as an array of n geometries."""
    import shapely

    paths: NDArray[np.object_] = np.asarray(
        shapely.linestrings(np.stack([starts, ends], axis=1)), dtype=object
    )
    still = (starts == ends).all(axis=1)
    paths[still] = shapely.points(starts[still])
    return paths


def _polygonal(shape: "BaseGeometry") -> "BaseGeometry":
    """Return the part of `shape` that has an area."""
    import shapely

    parts = shapely.get_parts(shapely.get_parts(shape))
    flat = [part for part in parts if part.geom_type == "Polygon"]
    return shapely.union_all(flat) if flat else shapely.Polygon()
