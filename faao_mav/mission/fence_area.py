"""The fence in the plane: its areas, and where they let the aircraft be."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from faao_mav.arrays import Flags, Real
from faao_mav.errors import quote
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Circle, Fence, Polygon, kind_of
from faao_mav.mission.polygons import enclosed, polygonal, shortest_way
from faao_mav.vector import Vector

_SEGMENTS = 64  # Straights to a quarter of a circle: 0.075 mm of error a metre of radius.

OUTSIDE = 1 / math.cos(math.pi / (4 * _SEGMENTS))
"""The radius of the circle about a polygon of `_SEGMENTS`, in those of the circle inside it."""

_SIMPLER = (0.1, 0.01)
"""By how much, m, arcs may be simplified where a shortest way is searched. Chosen: with 0.1 m the
search among 40 circles takes 0.2 s in place of 7 s, and the way is 0.01 % longer."""

_LONGER = 1.005
"""How much longer a way about simplified arcs may be than one that cuts them, which no way within
the area is shorter than: beyond that it may have missed a gap. Chosen."""

_BAR, _INTO = 0.01, 5.0
"""Half the width of a bar across the area, and how far it begins inside the obstacle, m. Chosen:
the bar has to meet the obstacle, from which a way may keep some metres."""

FARTHEST = 1e6
"""Half the side, m, of the square that stands for the plane where a fence has no inclusion."""


@dataclass(frozen=True, slots=True)
class Area:
    """One part of a fence, metres of a local frame; `name` is what people may call it.

    Circles become polygons, inside the circle for inclusions and outside for exclusions, so that
    what is found to stay within the fence does so. `crosses_itself`: its outline does; what counts
    as inside is then what an odd number of turns encloses, as the autopilots count. `disc` is the
    center and the radius of a circle.
    """

    name: str
    inclusion: bool
    shape: BaseGeometry
    crosses_itself: bool = False
    disc: tuple[float, float, float] | None = None

    def rings(self) -> list[Real]:
        """Return the closed rings (k, 2), m, that bound the area."""
        return _rings(self.shape)


def _rings(shape: BaseGeometry) -> list[Real]:
    rings = shapely.get_rings(shapely.get_parts(shape))
    return [np.asarray(shapely.get_coordinates(ring)) for ring in rings]


def areas_of(fence: Fence, frame: LocalFrame) -> tuple[Area, ...]:
    """Return the parts of `fence` in `frame`: polygons, then circles.

    Each is called by its name, or by its number among those of its kind.
    """
    unnamed = Counter(kind_of(zone) for zone in fence.areas if not zone.name)
    seen: Counter[str] = Counter()
    areas = []
    for zone in fence.areas:
        name = kind = kind_of(zone)
        if zone.name:
            name = f"{kind.partition(' ')[0]} {quote(zone.name)}"
        elif unnamed[kind] > 1:
            seen[kind] += 1
            name = f"{kind} {seen[kind]}"
        areas.append(_area(name, zone, frame))
    return tuple(areas)


def _area(name: str, zone: Polygon | Circle, frame: LocalFrame) -> Area:
    if isinstance(zone, Polygon):
        outline = shapely.Polygon(frame.to_local(*np.transpose(zone.vertices)))
        crosses = not shapely.is_valid(outline)
        return Area(name, zone.inclusion, enclosed(outline) if crosses else outline, crosses)
    east, north = map(float, frame.to_local(*zone.center))
    radius = zone.radius * (1.0 if zone.inclusion else OUTSIDE)
    shape = shapely.Point(east, north).buffer(radius, quad_segs=_SEGMENTS)
    return Area(name, zone.inclusion, shape, disc=(east, north, zone.radius))


def free_area(areas: Sequence[Area], *, any_inclusion: bool) -> BaseGeometry | None:
    """Return where the aircraft may be by the inclusions of `areas`, None if there are none.

    Inside one of them with `any_inclusion`, else inside all.
    """
    shapes = [area.shape for area in areas if area.inclusion]
    if not shapes:
        return None
    joined = shapely.union_all(shapes) if any_inclusion else shapely.intersection_all(shapes)
    return polygonal(joined)


@dataclass(frozen=True)
class FreeArea:
    """Where the aircraft may be, metres of a local frame (east, north).

    `shape` is a polygon or several, with holes. A fence without inclusions leaves a square of
    2,000 km.

    >>> import shapely
    >>> area = FreeArea(shapely.box(0, 0, 100, 100) - shapely.box(40, 0, 60, 80))
    >>> area.covers(np.array([[20.0, 10.0], [50.0, 10.0]])).tolist()
    [True, False]
    >>> area.shortest_way(np.array([20.0, 10.0]), np.array([80.0, 10.0])).round().tolist()
    [[20.0, 10.0], [40.0, 80.0], [60.0, 80.0], [80.0, 10.0]]
    """

    shape: BaseGeometry

    def __post_init__(self) -> None:
        shapely.prepare(self.shape)

    @classmethod
    def of(cls, areas: Sequence[Area], *, any_inclusion: bool) -> "FreeArea":
        """Return what `areas` leave; `any_inclusion` as in `free_area`."""
        free = free_area(areas, any_inclusion=any_inclusion)
        if free is None:
            free = shapely.box(-FARTHEST, -FARTHEST, FARTHEST, FARTHEST)
        out = shapely.union_all([area.shape for area in areas if not area.inclusion])
        return cls(polygonal(free - out))

    @property
    def empty(self) -> bool:
        """Whether nothing is left."""
        return bool(self.shape.is_empty)

    def inside(self, margin: float) -> "FreeArea":
        """Return the places at least `margin` metres from the edge, but for 0.1 mm a metre."""
        return FreeArea(polygonal(self.shape.buffer(-margin * OUTSIDE, quad_segs=_SEGMENTS)))

    def within(self, low: Vector, high: Vector) -> "FreeArea":
        """Return what lies in the rectangle from the corner `low` to `high`, m."""
        if low[0] >= high[0] or low[1] >= high[1]:
            return FreeArea(shapely.Polygon())
        return FreeArea(polygonal(self.shape & shapely.box(low[0], low[1], high[0], high[1])))

    def edges(self) -> list[Real]:
        """Return the closed rings (k, 2), m, that bound the area; of the plane's square none."""
        return [ring for ring in _rings(self.shape) if np.abs(ring).max() < FARTHEST / 2]

    def covers(self, points: Real) -> Flags:
        """Return which of `points` (n, 2) lie inside or on the edge, (n,)."""
        return np.asarray(shapely.covers(self.shape, shapely.points(points)), dtype=np.bool_)

    def connected(self, points: Real) -> bool:
        """Return whether all `points` (n, 2) are in one part of the area."""
        parts = shapely.get_parts(self.shape)[:, None]
        return bool(shapely.covers(parts, shapely.points(points)).all(axis=1).any())

    def clearance(self, path: Real) -> float:
        """Return the least distance of the polyline `path` (n, 2) from the edge, m.

        Below 0 where it leaves the area: by how far it does.
        """
        line = shapely.LineString(path) if len(path) > 1 else shapely.Point(path[0])
        if shapely.covers(self.shape, line):
            return float(shapely.distance(self.shape.boundary, line))
        outside = shapely.get_coordinates((line - self.shape).segmentize(1.0))
        return -float(shapely.distance(self.shape, shapely.points(outside)).max(initial=0.0))

    def nearest(self, point: Real, start: Real) -> Real:
        """Return the place nearest to `point` in the part of the area that `start` is in."""
        parts = shapely.get_parts(self.shape)
        own = parts[shapely.covers(parts, shapely.Point(start))]
        line = shapely.shortest_line(own[0] if own.size else self.shape, shapely.Point(point))
        return np.asarray(shapely.get_coordinates(line)[0])

    @cached_property
    def holes(self) -> list[BaseGeometry]:
        """The obstacles that can be passed on two sides, as polygons."""
        rings = (ring for part in shapely.get_parts(self.shape) for ring in part.interiors)
        return [shapely.Polygon(ring) for ring in rings]

    def barred(self, corner: Real, outward: Real) -> "FreeArea | None":
        """Return the area without a bar from the obstacle at `corner` outward to the next edge.

        Ways in it pass that obstacle on its other side. `outward` is a direction (2,); None where
        the bar would have no length.
        """
        far = corner + 2 * FARTHEST * outward
        lines = shapely.get_parts(shapely.LineString([corner, far]) & self.shape)
        first = [line for line in lines if line.distance(shapely.Point(corner)) < _BAR]
        if not first or first[0].length < _BAR:
            return None
        end = shapely.get_coordinates(first[0])[-1]
        bar = shapely.LineString([corner - _INTO * outward, end]).buffer(_BAR)
        return FreeArea(polygonal(self.shape - bar))

    def shortest_way(self, start: Real, end: Real) -> Real | None:
        """Return the corners (k, 2) of the shortest way from `start` to `end`, both (2,).

        None where no way keeps inside. Round arcs have few corners: the way keeps up to twice
        `_SIMPLER` from them where both ends allow that and no gap is missed for it.
        """
        for simpler in _SIMPLER:
            inner, outer = (
                polygonal(self.shape.buffer(by, join_style="mitre").simplify(simpler))
                for by in (-simpler, simpler)
            )
            way = shortest_way(inner, start, end)
            if way is not None and self.covers_path(way):
                least = shortest_way(outer, start, end)
                if least is None:
                    continue
                longer, shorter = (shapely.LineString(each).length for each in (way, least))
                if longer <= _LONGER * shorter:
                    return way
        return shortest_way(self.shape, start, end)

    def covers_path(self, path: Real) -> bool:
        """Return whether the polyline `path` (n, 2) keeps inside."""
        return bool(shapely.covers(self.shape, shapely.LineString(path)))
