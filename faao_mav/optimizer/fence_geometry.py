"""The fence of a plan as convex pieces, for the interior-point method to keep out of."""

from typing import TYPE_CHECKING

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.convex_pieces import convex_pieces
from faao_mav.mission.fence_area import OUTSIDE, free_area
from faao_mav.optimizer.interior.fence import FenceGeometry
from faao_mav.optimizer.interior.separation import ConvexObstacles
from faao_mav.plan import Plan
from faao_mav.plan.autopilots import VEHICLES

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_SIDES = 64
"""Sides of the polygon inside a circle that stands for an inclusion: 0.12 % of the radius is lost.
Chosen."""


def fence_geometry(plan: Plan) -> FenceGeometry | None:
    """Return what the path of `plan` keeps `fence.margin` from; None without a fence.

    Exclusions are cut into convex pieces; circles are discs, as large as the polygons that other
    checks have for them. Areas to stay in are their convex
    hulls, and what the hulls have beyond the areas is more pieces. Pieces that the flight cannot
    reach in the time it has are left out.
    """
    import shapely

    if plan.fence is None or not plan.geofence:
        return None
    zones = plan.zones
    inside = free_area(zones, any_inclusion=_any_inclusion(plan))
    inclusions = [
        zone.shape if zone.disc is None else _disc(*zone.disc) for zone in zones if zone.inclusion
    ]
    if _any_inclusion(plan) and inside is not None:
        inclusions = [inside.simplify(0.05)]
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
    most = plan.vehicle.max_speed * plan.flight.duration + 2 * plan.fence.margin
    near = [
        k
        for k, (piece, radius) in enumerate(zip(pieces, radii, strict=True))
        if shapely.distance(shapely.MultiPoint(piece).convex_hull, ends).sum() - 2 * radius <= most
    ]
    normals = np.concatenate([normal for normal, _ in sides]) if sides else np.empty((0, 2))
    offsets = np.concatenate([offset for _, offset in sides]) if sides else np.empty(0)
    obstacles = ConvexObstacles.of([pieces[k] for k in near], [radii[k] for k in near])
    return FenceGeometry(obstacles, normals, offsets, plan.fence.margin)


def _disc(east: float, north: float, radius: float) -> "BaseGeometry":
    import shapely

    return shapely.Point(east, north).buffer(radius, quad_segs=_SIDES // 4)


def _any_inclusion(plan: Plan) -> bool:
    return VEHICLES[plan.vehicle.autopilot, plan.vehicle.type].any_inclusion


def _sides(corners: Real) -> tuple[Real, Real]:
    """Return outward normals (k, 2) and offsets (k,) of a closed outline that is convex."""
    along = np.diff(corners, axis=0)
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normals /= np.hypot(*normals.T)[:, None]
    return normals, np.einsum("kc,kc->k", normals, corners[:-1])
