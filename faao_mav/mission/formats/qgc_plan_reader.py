"""QGroundControl's `.plan` files, read.

JSON with a mission, a geofence and rally points. Sources: QGroundControl's developer guide, "Plan
File Format", and what QGroundControl and MAVSDK accept.
"""

import math
from dataclasses import replace

from faao_mav.errors import MissionFileError
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.formats.json_tree import Node, parse_json
from faao_mav.mission.formats.mission_file import MissionFile
from faao_mav.mission.item import Home, Mission, MissionItem

FIRMWARE: dict[str, int] = {"ardupilot": 3, "px4": 12}
"""MAV_AUTOPILOT of each autopilot."""

VEHICLE_TYPES: dict[str, tuple[int, ...]] = {"copter": (2, 3, 4, 13, 14, 15), "plane": (1,)}
"""MAV_TYPE of each kind of vehicle; the first is the one to write."""

EXPANDED = ("survey", "CorridorScan")
"""Complex items whose simple items are in the file."""

_MAX_INTEGER = 2**31 - 1


def read_qgc_plan(text: str, source: str) -> MissionFile:
    """Return what `text`, the content of a `.plan` file, describes.

    A null parameter is NaN, not set. Surveys and corridor scans become the simple items that the
    file holds for them; the targets of DO_JUMP, written as a `doJumpId`, become the place of that
    item in the mission, counted from 1. A planned home of zeros, and none, mean no home; a plan
    without a `geoFence` or `rallyPoints` has none. Keys that are not known are passed over.
    `source` is the file's name, for messages. Raises `MissionFileError` for anything else; it
    names key, value and what is expected.
    """
    root = parse_json(text, source)
    _check_equal(root["fileType"], root["fileType"].text(), "Plan")
    _check_version(root, 1)
    mission = root["mission"]
    _check_version(mission, 2)
    return MissionFile(
        Mission(_items(mission), _home(mission), _fence(root), _rally(root)),
        _first(FIRMWARE, _type_of(mission, "firmwareType")),
        _first_of(VEHICLE_TYPES, _type_of(mission, "vehicleType")),
    )


def _check_version(node: Node, version: int) -> None:
    _check_equal(node["version"], node["version"].integer(_MAX_INTEGER), version)


def _check_equal(node: Node, value: str | int, expected: str | int) -> None:
    if value != expected:
        raise node.error(
            f'"{expected}"'
            if isinstance(expected, str)
            else f"{expected}: open the file in a current QGroundControl and save it again"
        )


def _type_of(mission: Node, key: str) -> int | None:
    return mission[key].integer(255) if key in mission else None


def _first(numbers: dict[str, int], number: int | None) -> str | None:
    return next((name for name, own in numbers.items() if own == number), None)


def _first_of(numbers: dict[str, tuple[int, ...]], number: int | None) -> str | None:
    return next((name for name, own in numbers.items() if number in own), None)


def _home(mission: Node) -> Home | None:
    if "plannedHomePosition" not in mission:
        return None
    node = mission["plannedHomePosition"]
    latitude, longitude, altitude = (value.number() for value in node.items(3))
    if latitude == longitude == altitude == 0:
        return None
    return node.make(lambda: Home(latitude, longitude, altitude))


def _items(mission: Node) -> tuple[MissionItem, ...]:
    nodes = [simple for node in mission["items"].items() for simple in _simple(node)]
    places: dict[int, int] = {}
    for place, node in enumerate(nodes, start=1):
        if "doJumpId" in node:
            places.setdefault(node["doJumpId"].integer(_MAX_INTEGER), place)
    return tuple(_item(node, places) for node in nodes)


def _simple(node: Node) -> list[Node]:
    """Return the simple items that an item of the file stands for."""
    kind = node["type"].text()
    if kind == "SimpleItem":
        return [node]
    if kind != "ComplexItem":
        raise node["type"].error('"SimpleItem" or "ComplexItem"')
    name = node["complexItemType"]
    if name.text() not in EXPANDED:
        raise name.error(
            f"simple items, {' or '.join(EXPANDED)}: replace the pattern by waypoints, or upload "
            "the plan from QGroundControl, read it back from the vehicle and save it"
        )
    style = node["TransectStyleComplexItem"]
    if "Items" not in style:
        raise MissionFileError(
            f"{node.source}: {style.place}.Items: is missing: the {name.text()} was saved "
            "without its waypoints; open the file in a current QGroundControl and save it again"
        )
    nodes = style["Items"].items()
    for inner in nodes:
        _check_equal(inner["type"], inner["type"].text(), "SimpleItem")
    return nodes


def _item(node: Node, places: dict[int, int]) -> MissionItem:
    command, frame = node["command"].integer(65_535), node["frame"].integer(255)
    values = node["params"].items(7)
    param1, param2, param3, param4, x, y, z = (value.number_or_null() for value in values)
    if frame != Frame.MISSION:
        # In the mission frame the three coordinates are plain parameters.
        for value, number, limit in ((values[4], x, 90), (values[5], y, 180)):
            if abs(number) > limit:
                raise value.error(f"null or degrees from {-limit} to {limit}")
    item = MissionItem(
        command,
        frame,
        (param1, param2, param3, param4),
        *(x, y, z),
        autocontinue=node["autoContinue"].boolean(),
    )
    if command != Command.DO_JUMP:
        return item
    if math.isnan(param1) or param1 not in places:
        raise values[0].error("the doJumpId of an item of the mission")
    return replace(item, params=(float(places[int(param1)]), param2, param3, param4))


def _fence(root: Node) -> Fence:
    fence = _section(root, "geoFence")
    if fence is None:
        return Fence()
    breach_return = None
    if "breachReturn" in fence:
        breach_return = _rally_point(fence["breachReturn"])
    return Fence(
        tuple(map(_polygon, fence["polygons"].items())),
        tuple(map(_circle, fence["circles"].items())),
        breach_return,
    )


def _rally(root: Node) -> tuple[RallyPoint, ...]:
    rally = _section(root, "rallyPoints")
    return () if rally is None else tuple(map(_rally_point, rally["points"].items()))


def _section(root: Node, key: str) -> Node | None:
    """Return a part of the plan that older files do not have, or have empty in version 1."""
    if key not in root:
        return None
    node = root[key]
    if node["version"].value == 1 and not any(v for k, v in node.value.items() if k != "version"):
        return None
    _check_version(node, 2)
    return node


def _polygon(node: Node) -> Polygon:
    _check_version(node, 1)
    vertices = tuple(_place(vertex) for vertex in node["polygon"].items())
    inclusion = node["inclusion"].boolean()
    return node["polygon"].make(lambda: Polygon(vertices, inclusion))


def _circle(node: Node) -> Circle:
    _check_version(node, 1)
    center, radius = _place(node["circle"]["center"]), node["circle"]["radius"].number()
    inclusion = node["inclusion"].boolean()
    return node["circle"].make(lambda: Circle(center, radius, inclusion))


def _place(node: Node) -> tuple[float, float]:
    latitude, longitude = (value.number() for value in node.items(2))
    return latitude, longitude


def _rally_point(node: Node) -> RallyPoint:
    latitude, longitude, altitude = (value.number() for value in node.items(3))
    return node.make(lambda: RallyPoint(latitude, longitude, altitude))
