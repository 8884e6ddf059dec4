"""A fence in the plane: what leaves it, by which of its parts, and how near something comes."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Flags, Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import Area, FreeArea, areas_of, free_area

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Shapes: TypeAlias = NDArray[np.object_]
"""Geometries of the local frame."""

_NAMED = 3
"""Parts of the fence that a way is told to break, at most. Chosen: more help nobody."""


@dataclass(frozen=True)
class FenceMap:
    """A fence in the plane of `frame`.

    `allowed` is where its `areas` let the aircraft be, their edges included. `any_inclusion`: one
    inclusion is enough, as PX4 and ArduPilot's FENCE_OPTIONS 2 have it; else all have to hold.
    """

    frame: LocalFrame
    areas: tuple[Area, ...]
    any_inclusion: bool
    allowed: FreeArea

    @classmethod
    def of(cls, fence: Fence, frame: LocalFrame | None, *, any_inclusion: bool) -> Self:
        """Return `fence`, not an empty one, about `frame`'s origin, else about its first place."""
        import shapely

        frame = frame or LocalFrame(*fence.place)
        areas = areas_of(fence, frame)
        allowed = FreeArea.of(areas, any_inclusion=any_inclusion)
        shapely.prepare(allowed.shape)
        return cls(frame, areas, any_inclusion, allowed)

    def leave(self, shapes: Shapes) -> Flags:
        """Return which of `shapes` (n,) leave the fence, (n,)."""
        import shapely

        return np.asarray(~shapely.covers(self.allowed.shape, shapes), dtype=np.bool_)

    def broken_by(self, shape: "BaseGeometry") -> list[tuple[str, float]]:
        """Return in words the first parts that `shape` breaks, and which length of it does, m."""
        return [*islice(self._broken_by(shape), _NAMED)]

    def _broken_by(self, shape: "BaseGeometry") -> Iterator[tuple[str, float]]:
        inclusions = [(f"outside {a.name}", a.shape) for a in self.areas if a.inclusion]
        if self.any_inclusion and len(inclusions) > 1:
            free = free_area(self.areas, any_inclusion=True)
            inclusions = [("outside all inclusions", free)] if free is not None else []
        for broken, area in inclusions:
            if not area.covers(shape):
                yield broken, (shape - area).length
        for each in self.areas:
            met = not each.inclusion and each.shape.intersects(shape)
            if met and not each.shape.touches(shape):
                yield f"inside {each.name}", (shape & each.shape).length

    def nearest(self, shapes: Shapes) -> tuple[int, float] | None:
        """Return which of `shapes` (n,) comes nearest to an edge, and how near, m.

        None where there is no edge: a fence that encloses nothing.
        """
        import shapely

        rings = [shapely.LinearRing(edge) for edge in self.allowed.edges()]
        if not rings:
            return None
        (_, found), margins = shapely.STRtree(shapes).query_nearest(rings, return_distance=True)
        nearest = int(np.argmin(margins))
        return int(found[nearest]), float(margins[nearest])


def lines(corners: Real) -> Shapes:
    """Return the polylines with these `corners` (n, k, 2), m; a point where all are the same."""
    import shapely

    shapes = np.asarray(shapely.linestrings(corners), dtype=object)
    still = (corners == corners[:, :1]).all(axis=(1, 2))
    shapes[still] = shapely.points(corners[still, 0])
    return shapes
