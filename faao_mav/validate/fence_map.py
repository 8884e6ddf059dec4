"""What of a mission and its flight leaves the fence."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import Area, areas_of, free_area
from faao_mav.validate.straight import Straight

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Shapes: TypeAlias = NDArray[np.object_]
"""Geometries of the local frame."""

_NAMED = 3
"""Parts of the fence that a way is told to break, at most; chosen: more help nobody."""


@dataclass(frozen=True, slots=True)
class _Part:
    """What of a fence is not to be left, an `inclusion`, or not to be entered.

    `broken` is what who breaks it is, as in "inside exclusion circle".
    """

    broken: str
    inclusion: bool
    shape: "BaseGeometry"

    def broken_by(self, ways: Shapes) -> Flags:
        """Return which of `ways` (n,) break it; to touch its edge does not."""
        import shapely

        if self.inclusion:
            return np.asarray(~shapely.covers(self.shape, ways))
        inside = shapely.intersects(self.shape, ways)
        inside[inside] = ~shapely.touches(self.shape, ways[inside])
        return np.asarray(inside)


@dataclass(frozen=True, slots=True)
class Ways:
    """Ways (n,), to the items at the indices `index` (n,), and which of them `leave` the fence."""

    index: Integers
    shapes: Shapes
    leave: Flags


@dataclass(frozen=True)
class FenceMap:
    """A fence in the plane of `frame`, with the mission's `legs`, `circles` and predicted `flight`.

    `free` is where the inclusions let the aircraft be, None if there are none.
    """

    frame: LocalFrame
    areas: tuple[Area, ...]
    free: "BaseGeometry | None"
    parts: tuple[_Part, ...]
    legs: Ways
    circles: Ways
    flight: Ways

    def leave(self, shapes: Shapes) -> Flags:
        """Return which of `shapes` (n,) leave the fence."""
        return _leaving(self.parts, shapes)

    def broken_by(self, shape: "BaseGeometry") -> list[tuple[str, float]]:
        """Return the first parts of the fence that `shape` breaks, and by which length of it, m."""
        import shapely

        broken = (part for part in self.parts if part.broken_by(np.array([shape])).any())
        return [
            (
                part.broken,
                shapely.length(shape - part.shape if part.inclusion else shape & part.shape),
            )
            for part in islice(broken, _NAMED)
        ]

    @cached_property
    def nearest(self) -> tuple[int, float] | None:
        """The index of the item at which legs, circles and flight come nearest, and how near, m.

        None if there are no legs, or if anything leaves the fence.
        """
        import shapely

        ways = (self.legs, self.circles, self.flight)
        if not len(self.legs.shapes) or any(each.leave.any() for each in ways):
            return None
        index = np.concatenate([each.index for each in ways])
        edges = [part.shape for part in self.parts if not part.inclusion]
        if self.free is not None:
            edges.append(self.free.boundary)
        tree = shapely.STRtree(np.concatenate([each.shapes for each in ways]))
        (_, found), margins = tree.query_nearest(edges, return_distance=True)
        if not len(margins):  # exclusions that enclose nothing
            return None
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
    free = free_area(areas, any_inclusion=any_inclusion)
    inclusions = [_Part(f"outside {a.name}", True, a.shape) for a in areas if a.inclusion]
    if free is not None and any_inclusion and len(inclusions) > 1:
        inclusions = [_Part("outside all inclusions", True, free)]
    exclusions = [_Part(f"inside {a.name}", False, a.shape) for a in areas if not a.inclusion]
    parts = (*inclusions, *exclusions)
    shapely.prepare([part.shape for part in parts])
    ends = np.array([[leg.start.ground, leg.end.ground] for leg in straights]).reshape(-1, 2, 2)

    def ways(index: Any, shapes: Any) -> Ways:
        shapes = np.array([*shapes], dtype=object)
        return Ways(np.array(index, dtype=int), shapes, _leaving(parts, shapes))

    return FenceMap(
        frame,
        areas,
        free,
        parts,
        ways([leg.index for leg in straights], _lines(ends)),
        ways([*circles], map(shapely.LineString, circles.values())),
        ways(heading_for[1:], _lines(np.stack([flown[:-1], flown[1:]], axis=1))),
    )


def _leaving(parts: Sequence[_Part], ways: Shapes) -> Flags:
    """Return which of `ways` (n,) break any of `parts`."""
    broken = np.zeros(len(ways), dtype=np.bool_)
    for part in parts:
        broken |= part.broken_by(ways)
    return broken


def _lines(ends: Real) -> Shapes:
    """Return the straights between `ends` (n, 2, 2), m; a point where both are the same."""
    import shapely

    lines = np.asarray(shapely.linestrings(ends), dtype=object)
    still = (ends[:, 0] == ends[:, 1]).all(axis=1)
    lines[still] = shapely.points(ends[still, 0])
    return lines
