"""What of a mission and its flight leaves the fence."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import Area, FreeArea, areas_of, free_area
from faao_mav.validate.straight import Straight

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Shapes: TypeAlias = NDArray[np.object_]
"""Geometries of the local frame."""


@dataclass(frozen=True, slots=True)
class Ways:
    """Ways (n,), to the items at the indices `index` (n,), and which of them `leave` the fence."""

    index: Integers
    shapes: Shapes
    leave: Flags


@dataclass(frozen=True)
class FenceMap:
    """A fence in the plane of `frame`, with the mission's `legs`, `circles` and predicted `flight`.

    `allowed` is where the areas let the aircraft be, their edges included. `any_inclusion`: to be
    inside one of the inclusions is enough, else all have to hold.
    """

    frame: LocalFrame
    areas: tuple[Area, ...]
    any_inclusion: bool
    allowed: FreeArea
    legs: Ways
    circles: Ways
    flight: Ways

    def leave(self, shapes: Shapes) -> Flags:
        """Return which of `shapes` (n,) leave the fence."""
        return _outside(self.allowed, shapes)

    def broken_by(self, shape: "BaseGeometry") -> Iterator[tuple[str, float]]:
        """Yield in words which parts of the fence `shape` breaks, and by which length of it, m."""
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

    @cached_property
    def nearest(self) -> tuple[int, float] | None:
        """The index of the item at which legs, circles and flight come nearest, and how near, m.

        None if there are no legs, if anything leaves the fence, or if it encloses nothing.
        """
        import shapely

        ways, edges = (self.legs, self.circles, self.flight), self.allowed.edges()
        if not edges or not len(self.legs.shapes) or any(each.leave.any() for each in ways):
            return None
        index = np.concatenate([each.index for each in ways])
        tree = shapely.STRtree(np.concatenate([each.shapes for each in ways]))
        rings = [shapely.LinearRing(edge) for edge in edges]
        (_, found), margins = tree.query_nearest(rings, return_distance=True)
        nearest = int(np.argmin(margins))
        return int(index[found[nearest]]), float(margins[nearest])


def fence_map(
    fence: Fence,
    frame: LocalFrame | None,
    any_inclusion: bool,
    straights: Sequence[Straight],
    circles: dict[int, Real],
    flown: Real,
    heading_for: Integers,
) -> FenceMap:
    """Return `fence`, which has places, in the plane of `frame`, else of its own first place.

    `any_inclusion`: one inclusion is enough, as PX4 and ArduPilot's FENCE_OPTIONS 2 have it; else
    all have to hold. `circles` are outlines (k, 2), m, by the index of the item that is circled at.
    The flight is at `flown` (n, 2), m, on the way to the items at the indices `heading_for` (n,).
    """
    import shapely

    frame = frame or LocalFrame(*fence.place)
    areas = areas_of(fence, frame)
    allowed = FreeArea.of(areas, any_inclusion=any_inclusion)
    shapely.prepare(allowed.shape)
    ends = np.array([[leg.start.ground, leg.end.ground] for leg in straights]).reshape(-1, 2, 2)

    outlines = np.array([*circles.values()]) if circles else ends[:0]

    def ways(index: Any, lines: Real) -> Ways:
        shapes = np.asarray(shapely.linestrings(lines), dtype=object)
        still = (lines == lines[:, :1]).all(axis=(1, 2))
        shapes[still] = shapely.points(lines[still, 0])
        return Ways(np.array(index, dtype=int), shapes, _outside(allowed, shapes))

    return FenceMap(
        frame,
        areas,
        any_inclusion,
        allowed,
        ways([leg.index for leg in straights], ends),
        ways([*circles], outlines),
        ways(heading_for[1:], np.stack([flown[:-1], flown[1:]], axis=1)),
    )


def _outside(allowed: FreeArea, shapes: Shapes) -> Flags:
    import shapely

    return np.asarray(~shapely.covers(allowed.shape, shapes), dtype=np.bool_)
