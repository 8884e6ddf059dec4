"""The fence of a plan as convex pieces: what a path keeps its distance from, and how far it is.

The distance of the straight from a to b and a convex obstacle O is the largest

    d(u) = min(u . a, u . b) - h(u),   h(u) = max u . p over p in O,   over the directions |u| = 1

and where they overlap that maximum is below 0: minus the least way by which they come apart. It is
attained at the normal of a side of O, at one of the straight, or from a corner of O to a or b.
Source: Boyd and Vandenberghe, "Convex Optimization", 2004, 8.2; Gottschalk's separating axes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.fence_area import OUTSIDE, free_area
from faao_mav.mission.polygons import convex_pieces
from faao_mav.optimizer.interior.constraint import TINY
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.plan import Plan

_SIDES = 64
"""Sides of the polygon inside a circle that stands for an inclusion: 0.12 % of the radius is lost.
Chosen."""

_SIMPLER = 0.05
"""By how much, m, arcs are simplified where one of several inclusions is enough. Chosen."""


@dataclass(frozen=True)
class ConvexObstacles:
    """P convex polygons, each with all that is nearer than its `radius` (P,).

    `corners` (P, V, 2) go around counterclockwise; where there are fewer than V the last is
    repeated. A disc is one corner with a radius. Lengths are in m.
    """

    corners: Real
    radius: Real

    @classmethod
    def of(cls, pieces: Sequence[tuple[Real, float]]) -> "ConvexObstacles":
        """Return the obstacles with these corners, (k, 2) each, and radii, m."""
        most = max((len(piece) for piece, _ in pieces), default=1)
        padded = [np.pad(piece, ((0, most - len(piece)), (0, 0)), "edge") for piece, _ in pieces]
        radii = np.array([radius for _, radius in pieces], dtype=np.float64)
        return cls(np.array(padded).reshape(-1, most, 2), radii)

    def __len__(self) -> int:
        return len(self.corners)

    @cached_property
    def sides(self) -> tuple[Real, Real]:
        """The outward normals (P, V, 2) of the sides and h there, infinite without a side."""
        along = np.roll(self.corners, -1, axis=1) - self.corners
        out = _unit(np.stack([along[..., 1], -along[..., 0]], axis=-1), axis=-1)
        offset = (out * self.corners).sum(axis=-1) + self.radius[:, None]
        return out, np.where((along != 0).any(axis=-1), offset, np.inf)[..., None]

    def separation(self, a: Real, b: Real) -> tuple[Real, Real]:
        """Return the directions u (2, P, n) of the greatest distance, and h(u) (P, n) there.

        The straights go from a to b, (2, n) each.
        """
        normals, offsets = self.sides
        values = np.minimum(normals @ a, normals @ b) - offsets
        piece, side = np.arange(len(self))[:, None], values.argmax(axis=1)
        best, h = values.max(axis=1), offsets[piece, side, 0]
        u = normals[piece, side].swapaxes(1, 2)
        for direction in self._between(a, b):
            far = (self.corners @ direction).max(axis=1) + self.radius[:, None]
            value = np.minimum(_dot(direction, a), _dot(direction, b)) - far
            better = (value > best) & direction.any(axis=1)
            best, h = np.where(better, value, best), np.where(better, far, h)
            u = np.where(better[:, None], direction, u)
        return u.swapaxes(0, 1), h

    def _between(self, a: Real, b: Real) -> Iterator[Real]:
        """Yield directions (P or 1, 2, n): across the straights, and from the nearest corners."""
        east, north = b - a
        across = _unit(np.stack([-north, east]), axis=0)[None]
        yield from (across, -across)
        squares = (self.corners**2).sum(axis=-1)[..., None] / 2
        for end in (a, b):
            nearest = (squares - self.corners @ end).argmin(axis=1)
            corner = self.corners[np.arange(len(self))[:, None], nearest]
            yield _unit(end - corner.swapaxes(1, 2), axis=1)


def _unit(vectors: Real, axis: int) -> Real:
    """Return `vectors` divided by their lengths; those without one are zero, no direction."""
    length = np.sqrt((vectors**2).sum(axis=axis, keepdims=True))
    return np.asarray(vectors / np.maximum(length, TINY))


def _dot(x: Real, y: Real) -> Real:
    """Return the products (P or 1, n) of x (P or 1, 2, n) and y (2, n)."""
    return np.asarray(x[:, 0] * y[0] + x[:, 1] * y[1])


@dataclass(frozen=True)
class FenceGeometry:
    """What a flight keeps its distance from: metres of the plan's local frame.

    `obstacles` are convex; `normals` (m, 2) and `offsets` (m,) are sides of convex areas to stay
    in, normal . w <= offset. `margin` is the distance kept.
    """

    obstacles: ConvexObstacles
    normals: Real
    offsets: Real
    margin: float

    def room(self, kin: Kinematics) -> Real:
        """Return margin and bulge (n - 1,) of the intervals of flights of `kin`, m."""
        bulge = kin.max_acceleration * kin.time_step**2 / 8
        bulges = np.full(kin.slots - 1, bulge)
        if not kin.bound_first_acceleration:  # both of its speeds are at most v_max
            bulges[0] = max(bulge, kin.max_speed * kin.time_step / 4)
        return self.margin + bulges

    def near(self, path: Real, distance: float) -> "FenceGeometry":
        """Return it with the obstacles within a `distance`, m, of a `path` (n, 2) alone."""
        import shapely

        corners, radius = self.obstacles.corners, self.obstacles.radius
        shapes = [shapely.MultiPoint(each).convex_hull for each in corners]
        away = shapely.distance(shapes, shapely.LineString(path)) - radius
        kept = away <= distance + self.margin
        return replace(self, obstacles=ConvexObstacles(corners[kept], radius[kept]))

    def clearance(self, flight: Trajectory, time_step: float) -> float:
        """Return a lower bound of the distance of the continuous path of `flight`, m.

        It is the distance itself but where a path that bends around a corner is nearest between
        samples.
        """
        inward, w = (-self.normals.T[:, :, None], -self.offsets[:, None]), flight.w.T
        sides = [self.obstacles.separation(w[:, :-1], w[:, 1:])] if len(self.obstacles) else []
        away = (
            _least_along(u, w, flight.v.T, flight.a.T, time_step) - h for u, h in (*sides, inward)
        )
        return min(float(each.min(initial=np.inf)) for each in away)


def _least_along(u: Real, w: Real, v: Real, a: Real, dt: float) -> Real:
    """Return the least u . w(t) on the parabola of every interval, exactly."""
    place, speed, bend = (u[0] * x[0, :-1] + u[1] * x[1, :-1] for x in (w, v, a))
    end = u[0] * w[0, 1:] + u[1] * w[1, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.where(bend > 0, -speed / bend, -1.0)
    inside = (turn > 0) & (turn < dt)
    turn = np.where(inside, turn, 0.0)
    lowest = place + speed * turn + bend * turn * turn / 2
    return np.asarray(np.minimum(np.minimum(place, end), lowest))


def fence_geometry(plan: Plan) -> FenceGeometry | None:
    """Return what the path of `plan` keeps its margin from; None where it may be anywhere.

    Exclusions, and ground under maps, are cut into convex pieces; circles are discs, as large as
    the polygons that other checks have for them. Areas to stay in are their convex hulls, and what
    the hulls have beyond the areas is more pieces. Pieces that the flight cannot reach in the time
    it has are left out.
    """
    import shapely

    if plan.keep_in is None:
        return None
    zones = (*plan.zones, *plan.ground)
    inside = free_area(zones, any_inclusion=plan.any_inclusion)
    inclusions = [
        zone.shape
        if zone.disc is None
        else shapely.Point(zone.disc[:2]).buffer(zone.disc[2], quad_segs=_SIDES // 4)
        for zone in zones
        if zone.inclusion
    ]
    if len(inclusions) > 1 and inside is not None and plan.any_inclusion:
        inclusions = [inside.buffer(-_SIMPLER).simplify(_SIMPLER)]
    pieces = list[tuple[Real, float]]()  # corners and radius
    hulls = [shape.convex_hull for shape in inclusions]
    for hull, shape in zip(hulls, inclusions, strict=True):
        pieces += [(piece, 0.0) for piece in convex_pieces(hull - shape)]
    for zone in zones:
        if zone.inclusion or (inside is not None and not zone.shape.intersects(inside)):
            continue
        if zone.disc is None:
            pieces += [(piece, 0.0) for piece in convex_pieces(zone.shape)]
        else:
            pieces.append((np.array([zone.disc[:2]]), zone.disc[2] * OUTSIDE))
    if plan.map_edge is not None:
        (west, south), (east, north) = plan.map_edge
        hulls.append(shapely.box(west, south, east, north))
    sides = [(np.empty((0, 2)), np.empty((0, 1)))]
    for hull in hulls:
        corners = shapely.get_coordinates(shapely.orient_polygons(hull))[:-1]
        normals, offsets = ConvexObstacles.of([(corners, 0.0)]).sides
        sides.append((normals[0], offsets[0]))
    normals, offsets = (np.concatenate(each) for each in zip(*sides, strict=True))
    fence = FenceGeometry(ConvexObstacles.of(pieces), normals, offsets[:, 0], plan.margin)
    ends = np.array([plan.flight.start, plan.flight.end])
    return fence.near(ends, plan.max_ground_speed * plan.flight.duration / 2)
