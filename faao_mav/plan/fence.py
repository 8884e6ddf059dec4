"""The fence of a plan: its zones in degrees, and whether a flight can keep inside."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from faao_mav.errors import InputError, PlanError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Circle, Fence, LatLon, Polygon
from faao_mav.plan.fields import MAX_LOCAL_DISTANCE, Problem, wrong
from faao_mav.plan.model import PlanContents
from faao_mav.plan.sections import CircleZone, FenceOptions, PolygonZone
from faao_mav.vector import Vector

_SHORTER_WAY = 2e-3
"""By how much of its length a way may be longer than the shortest, which is found to 0.01 %."""


def geofence(plan: PlanContents, source: str) -> Fence:
    """Return the zones of `fence` and of its file, which lies beside the plan's file `source`.

    Raises `PlanError` for a fence without zones and a file that cannot be read.
    """
    options = plan.fence
    if options is None:
        return Fence()
    frame = plan.origin.frame
    of_file = _read(options, source, frame)
    zones = [(zone, True) for zone in options.inclusion]
    zones += [(zone, False) for zone in options.exclusion]
    polygons, circles = [], []
    for zone, inclusion in zones:
        if isinstance(zone, PolygonZone):
            polygons.append(Polygon(_degrees(frame, zone.polygon), inclusion))
        elif isinstance(zone, CircleZone):
            (center,) = _degrees(frame, [zone.center])
            circles.append(Circle(center, zone.radius, inclusion))
    try:
        areas = (*polygons, *of_file.polygons), (*circles, *of_file.circles)
        fence = Fence(*areas, notes=of_file.notes)
    except InputError as error:
        raise PlanError(f"{source}: {error}") from None
    if not fence:
        raise PlanError(f"{source}: fence: has no zones; give inclusion, exclusion or file")
    return fence


def written_out(fence: Fence, margin: float) -> dict[str, Any]:
    """Return the section `fence` of a plan that has the zones of `fence` itself."""
    zones: dict[str, Any] = {"margin": margin, "inclusion": [], "exclusion": []}
    for polygon in fence.polygons:
        zone: dict[str, Any] = {"polygon": [_place(vertex) for vertex in polygon.vertices]}
        zones["inclusion" if polygon.inclusion else "exclusion"].append(zone)
    for circle in fence.circles:
        zone = {"center": _place(circle.center), "radius": circle.radius}
        zones["inclusion" if circle.inclusion else "exclusion"].append(zone)
    return {key: value for key, value in zones.items() if value != []}


def _place(place: LatLon) -> dict[str, float]:
    return {"latitude": place[0], "longitude": place[1]}


def _read(options: FenceOptions, source: str, frame: LocalFrame) -> Fence:
    """Return the fence in `fence.file`; raise `PlanError` where it lies far from the origin."""
    if options.file is None:
        return Fence()
    from faao_mav.mission.formats.fence_file import read_fence  # plans rarely have one

    path = Path(source).parent / options.file
    try:
        fence = read_fence(path)
    except InputError as error:
        raise PlanError(f"{source}: fence.file: {error}") from None
    places = [vertex for polygon in fence.polygons for vertex in polygon.vertices]
    places += [circle.center for circle in fence.circles]
    away = frame.to_local(*np.transpose(places))
    farthest = int(np.abs(away).max(axis=1).argmax())
    distance = float(np.abs(away[farthest]).max())
    if not distance <= MAX_LOCAL_DISTANCE:
        raise PlanError(
            f"{source}: fence.file: {path}: {places[farthest]} lies {distance / 1000:,.0f} km from "
            f"site.origin; at most {MAX_LOCAL_DISTANCE / 1000:.0f} km is accepted"
        )
    return fence


def _degrees(frame: LocalFrame, places: Sequence[Vector]) -> tuple[LatLon, ...]:
    latitude, longitude = frame.to_geodetic(places)
    return tuple(zip(latitude.tolist(), longitude.tolist(), strict=True))


def fence_problems(plan: PlanContents) -> Iterator[Problem]:
    """Yield why no flight of `plan` can keep its margin from the edge of fence, ground and maps."""
    area = plan.keep_in
    if area is None:
        return
    for part in plan.zones:
        if part.crosses_itself:
            yield wrong("fence-crosses", part=part.name)
    if area.empty:
        yield wrong("fence-empty")
    kept = area.inside(plan.margin)
    if kept.empty:
        yield wrong("fence-margin", key=margin_key(plan))
    ends = {"start": plan.flight.start, "end": plan.flight.end}
    for name, place in ends.items():
        if not kept.covers(np.array([place])).all() and all(
            known.above_law or known.covers(place) for known in plan.maps
        ):
            yield wrong("fence-end", end=name, place=list(place), trouble=trouble(plan, place))
    flight, edge, straight = plan.flight, edge_of(plan), np.array([*ends.values()])
    # among the many corners of ground the shortest way takes long
    way = straight if plan.ground else kept.shortest_way(*straight)
    if way is None or not kept.connected(straight):
        asked = {name: list(place) for name, place in ends.items()}
        yield wrong("fence-way", edge=edge, key=margin_key(plan), **asked)
        return
    length = float(np.hypot(*np.diff(way, axis=0).T).sum())
    most = plan.max_ground_speed * (flight.duration - flight.time_step)
    if length > most * (1 + _SHORTER_WAY):
        yield wrong("fence-long", edge=edge, length=length, most=most)


def trouble(plan: PlanContents, place: Vector) -> str:
    """Return where a `place`, m, is that `keep_in` of `plan` leaves out, or near its edge."""
    import shapely

    area, point = plan.keep_in, shapely.Point(place)
    assert area is not None
    distance, what = area.clearance(np.array([place])), f"the edge of the {edge_of(plan)}"
    out = [each for each in (*plan.zones, *plan.ground) if not each.inclusion]
    near = [each for each in out if each.shape.distance(point) < plan.margin]
    if near:
        distance, what = near[0].shape.boundary.distance(point), near[0].name
        if near[0].shape.contains(point):
            whose = "under the map" if near[0] in plan.ground else "of the fence"
            return f"{distance:.1f} m inside {what} {whose}; move it out"
    elif distance < 0:
        return f"{-distance:.1f} m outside the inclusions of the fence; move it inside"
    return (
        f"{distance:.1f} m from {what}, less than {margin_key(plan)} ({plan.margin:g} m); "
        "move it, or give a smaller margin"
    )


def margin_key(plan: PlanContents) -> str:
    """Return the key that the margin of `plan` is of."""
    return "mission.path_tolerance" if plan.fence is None else "fence.margin"


def edge_of(plan: PlanContents) -> str:
    """Return what the path of `plan` keeps inside of, in a word."""
    return "map" if plan.fence is None else "fence"
