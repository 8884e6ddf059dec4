"""Fences and rally points as items: of the mission protocol, and as ground stations save them."""

import math
from collections.abc import Sequence

from faao_mav.errors import InputError
from faao_mav.mission.command import CIRCLE, FENCE_RETURN_POINT, POLYGON, RALLY_POINT, Frame
from faao_mav.mission.fence import Circle, Fence, LatLon, Polygon, RallyPoint
from faao_mav.mission.item import MissionItem


def fence_items(fence: Fence) -> tuple[MissionItem, ...]:
    """Return `fence` as items: return point, polygons vertex by vertex, circles."""
    items = []
    if fence.breach_return is not None:
        point = fence.breach_return
        up = 0.0 if math.isnan(point.altitude) else point.altitude  # no autopilot keeps it
        place = (point.latitude, point.longitude, up)
        items.append(_place_item(FENCE_RETURN_POINT, Frame.GLOBAL_RELATIVE_ALT, 0.0, *place))
    for polygon in fence.polygons:
        command, count = POLYGON[polygon.inclusion], float(len(polygon.vertices))
        items += [_place_item(command, Frame.GLOBAL, count, *v) for v in polygon.vertices]
    for circle in fence.circles:
        command = CIRCLE[circle.inclusion]
        items.append(_place_item(command, Frame.GLOBAL, circle.radius, *circle.center))
    return tuple(items)


def rally_items(points: Sequence[RallyPoint]) -> tuple[MissionItem, ...]:
    """Return rally points as items; raise `InputError` for one whose altitude is not known."""
    for number, point in enumerate(points, start=1):
        if math.isnan(point.altitude):
            raise InputError(
                f"rally point {number}: its altitude is not set, and 0 m would be the ground; "
                "give metres above home"
            )
    frame = Frame.GLOBAL_RELATIVE_ALT
    return tuple(
        _place_item(RALLY_POINT, frame, 0.0, point.latitude, point.longitude, point.altitude)
        for point in points
    )


def fence_of(items: Sequence[MissionItem]) -> Fence:
    """Return the fence that `items` make: the reverse of `fence_items`.

    Raises `InputError` for other items, and for a polygon of fewer vertices than its items say.
    """
    polygons, circles, breach_return = [], [], None
    vertices: list[LatLon] = []
    for number, item in enumerate(items):
        if item.command in POLYGON.values():
            vertices.append((item.x, item.y))
            if len(vertices) == item.params[0]:
                polygons.append(Polygon(tuple(vertices), item.command == POLYGON[True]))
                vertices = []
            continue
        if vertices:
            break
        if item.command in CIRCLE.values():
            inclusion = item.command == CIRCLE[True]
            circles.append(Circle((item.x, item.y), item.params[0], inclusion))
        elif item.command == FENCE_RETURN_POINT:
            breach_return = RallyPoint(item.x, item.y, item.z)
        else:
            raise InputError(f"fence item {number}: command {item.command}; expected 5000 to 5004")
    if vertices:
        raise InputError(
            f"fence: a polygon stops after {len(vertices)} of its vertices; expected as many as "
            "its items say"
        )
    return Fence(tuple(polygons), tuple(circles), breach_return)


def _place_item(
    command: int, frame: int, param1: float, x: float, y: float, z: float = 0.0
) -> MissionItem:
    return MissionItem(command, frame, (param1, 0.0, 0.0, 0.0), x, y, z)
