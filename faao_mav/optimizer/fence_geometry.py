"""The fence of a plan as convex pieces: what a path keeps its distance from, and how far it is."""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.fence_area import OUTSIDE, free_area
from faao_mav.mission.polygons import convex_pieces
from faao_mav.optimizer.interior.separation import ConvexObstacles
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.plan import Plan

_SIDES = 64
"""Sides of the polygon inside a circle that stands for an inclusion: 0.12 % of the radius is lost.
Chosen."""

_SIMPLER = 0.05
"""By how much, m, arcs are simplified where one of several inclusions is enough. Chosen."""


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

        shapes = [shapely.MultiPoint(each).convex_hull for each in self.obstacles.corners]
        away = shapely.distance(shapes, shapely.LineString(path)) - self.obstacles.radius
        kept = away <= distance + self.margin
        return replace(self, obstacles=self.obstacles.only(kept))

    def clearance(self, flight: Trajectory, time_step: float) -> float:
        """Return a lower bound of the distance of the continuous path of `flight`, m.

        It is the distance itself but where a path that bends around a corner is nearest between
        samples.
        """
        least = np.inf
        w, v, a = flight.w.T, flight.v.T, flight.a.T
        if len(self.obstacles):
            u, h = self.obstacles.separation(w[:, :-1], w[:, 1:])
            nearest = _least_along(u, w, v, a, time_step) - h
            least = min(least, float(nearest.min()))
        if len(self.offsets):
            inward = -self.normals.T[:, :, None]
            nearest = _least_along(inward, w, v, a, time_step) + self.offsets[:, None]
            least = min(least, float(nearest.min()))
        return least

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return by how much the path of `flight` comes too near, in solver units; 0 if nowhere."""
        return max(0.0, self.margin - self.clearance(flight, kin.time_step)) / LENGTH


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
    pieces: list[Real] = []
    radii: list[float] = []
    sides: list[tuple[Real, Real]] = []
    for shape in inclusions:
        hull = shapely.orient_polygons(shape.convex_hull)
        sides.append(_sides(shapely.get_coordinates(hull)))
        pieces += convex_pieces(hull - shape)
    radii += [0.0] * len(pieces)
    for zone in zones:
        if zone.inclusion or (inside is not None and not zone.shape.intersects(inside)):
            continue
        if zone.disc is not None:
            east, north, radius = zone.disc
            pieces.append(np.array([[east, north]]))
            radii.append(radius * OUTSIDE)
        else:
            parts = convex_pieces(zone.shape)
            pieces += parts
            radii += [0.0] * len(parts)
    ends = shapely.points([plan.flight.start, plan.flight.end])
    if plan.map_edge is not None:
        (west, south), (east, north) = plan.map_edge
        sides.append(_sides(shapely.get_coordinates(shapely.box(west, south, east, north))))
    most = plan.max_ground_speed * plan.flight.duration + 2 * plan.margin
    near = [
        k
        for k, (piece, radius) in enumerate(zip(pieces, radii, strict=True))
        if shapely.distance(shapely.MultiPoint(piece).convex_hull, ends).sum() - 2 * radius <= most
    ]
    normals = np.concatenate([normal for normal, _ in sides]) if sides else np.empty((0, 2))
    offsets = np.concatenate([offset for _, offset in sides]) if sides else np.empty(0)
    obstacles = ConvexObstacles.of([pieces[k] for k in near], [radii[k] for k in near])
    return FenceGeometry(obstacles, normals, offsets, plan.margin)


def _sides(corners: Real) -> tuple[Real, Real]:
    """Return outward normals (k, 2) and offsets (k,) of a closed outline that is convex."""
    along = np.diff(corners, axis=0)
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normals /= np.hypot(*normals.T)[:, None]
    return normals, np.einsum("kc,kc->k", normals, corners[:-1])
