"""What of a mission and its flight leaves the fence."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Integers, Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import Area, areas_of, free_area
from faao_mav.validate.straight import Straight

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_NAMED = 3
"""Parts of the fence that a path is told to break, at most; chosen: more help nobody."""


def _lines(starts: Real, ends: Real) -> NDArray[np.object_]:
    """Return the straights from `starts` to `ends`, each (n, 2), as an array of n geometries."""
    import shapely

    paths: NDArray[np.object_] = np.asarray(
        shapely.linestrings(np.stack([starts, ends], axis=1)), dtype=object
    )
    still = (starts == ends).all(axis=1)
    paths[still] = shapely.points(starts[still])
    return paths


@dataclass(frozen=True, slots=True)
class Broken:
    """Which of n paths leave the fence, `any` (n,), and by which of its parts, up to three, `by`.

    A part of None stands for several inclusions of which one would be enough.
    """

    any: NDArray[np.bool_]
    by: tuple[tuple[Area | None, NDArray[np.bool_]], ...]

    def parts(self, k: int) -> list[Area | None]:
        """Return the parts that path `k` breaks."""
        return [part for part, broken in self.by if broken[k]]


@dataclass(frozen=True)
class FenceMap:
    """A fence in the plane, with the mission's way: `straights`, circles, the predicted flight.

    `circles` are outlines (k, 2), m, by the index of the item that is circled at.

    The flight is at `positions` (n, 3), m, on the way to the items at the indices `heading_for`
    (n,); both are None where it is not predicted. `free` is where the inclusions let the aircraft
    be, None if there are none. `any_inclusion`: one inclusion is enough, as PX4 and ArduPilot's
    FENCE_OPTIONS 2 have it; else all have to hold.
    """

    frame: LocalFrame
    areas: tuple[Area, ...]
    free: "BaseGeometry | None"
    any_inclusion: bool
    straights: tuple[Straight, ...]
    circles: dict[int, Real]
    positions: Real | None
    heading_for: Integers | None

    @cached_property
    def rings(self) -> NDArray[np.object_]:
        """The circles, in order, as geometries."""
        import shapely

        return np.array([shapely.LineString(each) for each in self.circles.values()], dtype=object)

    @cached_property
    def legs(self) -> NDArray[np.object_]:
        """The straights, in order, as geometries."""
        legs = self.straights
        starts = np.array([[leg.start.east, leg.start.north] for leg in legs]).reshape(-1, 2)
        ends = np.array([[leg.end.east, leg.end.north] for leg in legs]).reshape(-1, 2)
        return _lines(starts, ends)

    @cached_property
    def flight(self) -> NDArray[np.object_]:
        """The predicted flight from sample to sample, as geometries; none without a track."""
        positions = self.positions
        if positions is None or len(positions) < 2:
            return np.empty(0, dtype=object)
        return _lines(positions[:-1, :2], positions[1:, :2])

    @cached_property
    def flight_items(self) -> NDArray[np.int_]:
        """The index of the item of each part of `flight`."""
        if self.heading_for is None or not len(self.flight):
            return np.empty(0, dtype=int)
        return self.heading_for[1:]

    @cached_property
    def broken_legs(self) -> Broken:
        """Which legs leave the fence."""
        return self.broken(self.legs)

    @cached_property
    def broken_flight(self) -> Broken:
        """Which parts of the predicted flight leave the fence."""
        return self.broken(self.flight)

    @cached_property
    def broken_rings(self) -> Broken:
        """Which circles leave the fence."""
        return self.broken(self.rings)

    def broken(self, paths: Any) -> Broken:
        """Return which of `paths` (n,), geometries of the local frame, leave the fence.

        Of a path that breaks several parts the first `_NAMED` are told.
        """
        import shapely

        by: list[tuple[Area | None, NDArray[np.bool_]]] = []
        counts = np.zeros(len(paths), dtype=int)

        def note(part: Area | None, tried: Integers, breaks: NDArray[np.bool_]) -> None:
            broken = np.zeros(len(paths), dtype=np.bool_)
            broken[tried[breaks]] = True
            counts[broken] += 1
            by.append((part, broken))

        inclusions = [area for area in self.areas if area.inclusion]
        one_is_enough = self.any_inclusion and len(inclusions) > 1
        if one_is_enough:
            note(None, np.arange(len(paths)), ~shapely.covers(self.free, paths))
        for area in () if one_is_enough else inclusions:
            tried = np.flatnonzero(counts < _NAMED)
            note(area, tried, ~shapely.covers(area.shape, paths[tried]))
        for area in self.areas:
            if not area.inclusion:
                tried = np.flatnonzero(counts < _NAMED)
                inside = shapely.intersects(area.shape, paths[tried])
                inside[inside] = ~shapely.touches(area.shape, paths[tried[inside]])
                note(area, tried, inside)
        return Broken(counts > 0, tuple(by))

    @cached_property
    def nearest(self) -> tuple[float, int] | None:
        """The least margin of legs, circles and flight, m, and the index of its item.

        None if there are no legs, or if anything leaves the fence.
        """
        import shapely

        broken = (self.broken_legs, self.broken_rings, self.broken_flight)
        if not len(self.legs) or any(each.any.any() for each in broken):
            return None
        paths = np.concatenate([self.legs, self.rings, self.flight])
        ordered = [*(leg.index for leg in self.straights), *self.circles]
        items = [*ordered, *self.flight_items.tolist()]
        edges = [area.shape for area in self.areas if not area.inclusion]
        if self.free is not None:
            edges.append(self.free.boundary)
        (_, found), margins = shapely.STRtree(paths).query_nearest(edges, return_distance=True)
        if not len(margins):  # exclusions that enclose nothing
            return None
        nearest = int(np.argmin(margins))
        return float(margins[nearest]), items[found[nearest]]


def fence_map(
    fence: Fence,
    frame: LocalFrame | None,
    any_inclusion: bool,
    straights: tuple[Straight, ...],
    circles: dict[int, Real],
    positions: Real | None,
    heading_for: Integers | None,
) -> FenceMap | None:
    """Return `fence` in the plane of `frame`, else of its own first place; None without a fence.

    The other arguments are those of `FenceMap`.
    """
    if not fence:
        return None
    import shapely

    frame = frame or LocalFrame(*fence.place)
    areas = areas_of(fence, frame)
    free = free_area(areas, any_inclusion=any_inclusion)
    shapely.prepare([area.shape for area in areas])
    shapely.prepare(free)
    return FenceMap(frame, areas, free, any_inclusion, straights, circles, positions, heading_for)
