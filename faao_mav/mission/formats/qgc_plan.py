"""QGroundControl's `.plan` files, each part's reader beside its writer.

JSON with a mission, a geofence and rally points. Sources: QGroundControl's developer guide, "Plan
File Format", and what QGroundControl and MAVSDK accept.
"""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from faao_mav.errors import MissionFileError
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, ABOVE_TERRAIN, Command, Frame
from faao_mav.mission.fence import MAX_CORNERS, Circle, Fence, LatLon, Polygon, RallyPoint
from faao_mav.mission.formats.json_value import Json
from faao_mav.mission.formats.mission_file import MissionFile, PlanTarget, not_read, zeros
from faao_mav.mission.item import BESIDE, MAX_ITEMS, Home, Mission, MissionItem

_AGAIN = "open the file in a current QGroundControl and save it again"

_SIMPLER = (
    "or simple items: replace the pattern by waypoints, or upload the plan from QGroundControl, "
    "read it back from the vehicle and save it"
)

_CRUISE_SPEED, _HOVER_SPEED = 15.0, 5.0
"""Speeds in m/s that QGroundControl assumes before the first DO_CHANGE_SPEED: its own defaults."""

_ALTITUDE_MODES = {
    int(frame): mode
    for mode, frames in ((1, ABOVE_HOME), (2, ABOVE_SEA), (4, ABOVE_TERRAIN))
    for frame in frames
}
"""QGroundControl's altitude modes by the frames of items; the plan has mode 0: each its own."""

Place = TypeVar("Place", Home, RallyPoint)


def read_qgc_plan(text: str) -> MissionFile:
    """Return what `text`, the content of a `.plan` file, describes.

    A null parameter is NaN, not set; a null altitude of home or of a rally point is one that is not
    known. Surveys and corridor scans become the simple items that the file holds for them; the
    targets of DO_JUMP, written as a `doJumpId`, become the place of that item in the mission,
    counted from 1. A planned home of zeros, and none, mean no home; a plan without a `geoFence` or
    `rallyPoints` has none. Keys that are not known are passed over. Raises `MissionFileError` for
    anything else; it names key, value and what is expected.
    """
    file = Json.parsed(text)
    file["fileType"].one_of("Plan")
    _check_version(file, 1)
    plan = file["mission"]
    _check_version(plan, 2)
    home = plan.get("plannedHomePosition")
    fence, rally = _part(file, "geoFence"), _part(file, "rallyPoints")
    points = rally["points"].each(MAX_CORNERS) if rally else []
    whom = plan.get("firmwareType"), plan.get("vehicleType")
    firmware, vehicle_type = (None if each is None else each.whole(255) for each in whom)
    unread = file.members.get("unread")
    mission = Mission(
        _read_items(plan["items"]),
        _read_place(home, Home) if home and any(home.numbers(3, "not known")) else None,
        _read_fence(fence) if fence else Fence(),
        tuple(_read_place(point, RallyPoint) for point in points),
        tuple(part for part in BESIDE if isinstance(unread, list) and part in unread),
    )
    return MissionFile(mission, firmware, vehicle_type, tuple(not_read(mission)))


def write_qgc_plan(mission: Mission, target: PlanTarget | None = None) -> str:
    """Return `mission` as the text of a `.plan` file for `target`, a generic one if None.

    NaN is written as null, except for a target that refuses it: there it is 0. A mission without
    home has a planned home of zeros, because QGroundControl asks for one. What the mission has
    `unread` is told under a key of that name, which QGroundControl passes over. Raises
    `MissionFileError` for a DO_JUMP to no item of the mission.
    """
    whom = target or PlanTarget(0, 0)
    plan = {
        "fileType": "Plan",
        "geoFence": _write_fence(mission.fence),
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": _CRUISE_SPEED,
            "firmwareType": whom.firmware,
            "globalPlanAltitudeMode": 0,
            "hoverSpeed": _HOVER_SPEED,
            "items": list(_write_items(mission, whom)),
            "plannedHomePosition": _write_place(mission.home or Home(0.0, 0.0, 0.0)),
            "vehicleType": whom.vehicle_type,
            "version": 2,
        },
        "rallyPoints": {"points": list(map(_write_place, mission.rally)), "version": 2},
        "version": 1,
    }
    plan |= {"unread": mission.unread} if mission.unread else {}
    return json.dumps(plan, indent=4, allow_nan=False, sort_keys=True) + "\n"


def plan_losses(mission: Mission, target: PlanTarget | None) -> Iterator[str]:
    """Yield what of `mission` a `.plan` file for `target` does not hold."""
    yield from not_read(mission, "; QGroundControl clears it there when it uploads this plan")
    if target is None:
        yield "no autopilot is known: the plan is for a generic one"
    yield from zeros(mission, for_nan=target is not None and not target.takes_null)


def _check_version(part: Json, version: int) -> None:
    told = part["version"]
    if isinstance(told.value, bool) or told.value != version:  # true equals 1
        raise told.wrong(f"{version}: {_AGAIN}")


def _part(file: Json, key: str) -> Json | None:
    """Return a part of version 2; None for one with nothing in it, which may be of version 1."""
    part = file.get(key)
    if part is None or not any(value for name, value in part.members.items() if name != "version"):
        return None
    _check_version(part, 2)
    return part


def _read_items(items: Json) -> tuple[MissionItem, ...]:
    """Return the items; the target of a DO_JUMP is counted from 1."""
    parts, numbers = list(_simple_items(items)), dict[float, int]()
    for number, part in enumerate(parts, start=1):
        if (own := part.get("doJumpId")) is not None:
            numbers.setdefault(own.whole(2**31 - 1), number)
    return tuple(_read_item(part, numbers) for part in parts)


def _simple_items(items: Json) -> Iterator[Json]:
    """Yield the simple items, those of patterns that have them in the file in their place."""
    for item in items.each(MAX_ITEMS):
        if item["type"].one_of("SimpleItem", "ComplexItem") == "SimpleItem":
            yield item
            continue
        kind, pattern = item["complexItemType"], item.get("TransectStyleComplexItem")
        if kind.value not in ("survey", "CorridorScan"):
            raise kind.wrong(f"'survey' or 'CorridorScan', {_SIMPLER}")
        found = pattern and pattern.get("Items")
        if not found:
            raise MissionFileError(
                f"{item.place}.TransectStyleComplexItem.Items: is missing: the pattern was saved "
                f"without its waypoints; {_AGAIN}"
            )
        yield from found.each(MAX_ITEMS)


def _read_item(item: Json, numbers: Mapping[float, int]) -> MissionItem:
    item["type"].one_of("SimpleItem")
    command, frame = item["command"].whole(65_535), item["frame"].whole(255)
    values = item["params"].numbers(7, "not set")
    told = item["params"].each()
    if frame != Frame.MISSION:
        # In the mission frame the three coordinates are plain parameters.
        for index, limit in ((4, 90), (5, 180)):
            if abs(values[index]) > limit:
                raise told[index].wrong(f"null or degrees from {-limit} to {limit}")
    if command == Command.DO_JUMP:
        if values[0] not in numbers:
            raise told[0].wrong("the doJumpId of an item of the mission")
        values[0] = float(numbers[values[0]])
    param1, param2, param3, param4, x, y, z = values
    params, autocontinue = (param1, param2, param3, param4), item["autoContinue"].flag()
    return MissionItem(command, frame, params, x, y, z, autocontinue)


def _write_items(mission: Mission, whom: PlanTarget) -> Iterator[dict[str, Any]]:
    for number, item in enumerate(mission.items, start=1):
        last = len(mission.items)
        if item.command == Command.DO_JUMP and item.params[0] not in range(1, last + 1):
            raise MissionFileError(
                f"item {number}: DO_JUMP to {item.params[0]:g}; expected an item of the mission, "
                f"1 to {last}"
            )
        not_set = None if whom.takes_null else 0
        params = [not_set if math.isnan(value) else value for value in item.numbers]
        mode = _ALTITUDE_MODES.get(item.frame)
        shown = {"AMSLAltAboveTerrain": None, "Altitude": params[6], "AltitudeMode": mode}
        yield (shown if mode is not None else {}) | {
            "autoContinue": item.autocontinue,
            "command": int(item.command),
            "doJumpId": number,
            "frame": int(item.frame),
            "params": params,
            "type": "SimpleItem",
        }


def _read_fence(fence: Json) -> Fence:
    polygons, circles = [], []
    for part in fence["polygons"].each(MAX_CORNERS):
        _check_version(part, 1)
        corners = part["polygon"].each(MAX_CORNERS)
        vertices = tuple(_pair(corner) for corner in corners)
        polygons.append(part.made(Polygon, vertices, part["inclusion"].flag()))
    for part in fence["circles"].each(MAX_CORNERS):
        _check_version(part, 1)
        center, radius = _pair(part["circle"]["center"]), part["circle"]["radius"].number()
        circles.append(part.made(Circle, center, radius, part["inclusion"].flag()))
    back = fence.get("breachReturn")
    returning = _read_place(back, RallyPoint) if back else None
    return Fence(tuple(polygons), tuple(circles), returning)


def _write_fence(fence: Fence) -> dict[str, Any]:
    polygons = [_zone(area, polygon=area.vertices) for area in fence.polygons]
    circles = [
        _zone(area, circle={"center": area.center, "radius": area.radius}) for area in fence.circles
    ]
    back = {"breachReturn": _write_place(fence.breach_return)} if fence.breach_return else {}
    return {"circles": circles, "polygons": polygons, "version": 2, **back}


def _zone(area: Polygon | Circle, **outline: object) -> dict[str, Any]:
    return {**outline, "inclusion": area.inclusion, "version": 1}


def _pair(place: Json) -> LatLon:
    latitude, longitude = place.numbers(2)
    return latitude, longitude


def _read_place(place: Json, kind: type[Place]) -> Place:
    return place.made(kind, *place.numbers(3, "not known"))


def _write_place(place: Home | RallyPoint) -> list[float | None]:
    known = not math.isnan(place.altitude)
    return [place.latitude, place.longitude, place.altitude if known else None]
