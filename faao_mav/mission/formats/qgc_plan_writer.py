"""QGroundControl's `.plan` files, written: all that QGroundControl and MAVSDK ask for."""

import json
import math
from typing import Any

from faao_mav.errors import MissionFileError
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, ABOVE_TERRAIN, Command
from faao_mav.mission.fence import Fence, RallyPoint
from faao_mav.mission.formats.mission_file import PlanTarget
from faao_mav.mission.item import Home, Mission, MissionItem

_CRUISE_SPEED, _HOVER_SPEED = 15.0, 5.0
"""Speeds in m/s that QGroundControl assumes of a mission without a speed: its own defaults."""

_ALTITUDE_MODES = ((1, ABOVE_HOME), (2, ABOVE_SEA), (4, ABOVE_TERRAIN))
"""QGroundControl's altitude modes by the frames of items."""

_MIXED = 0
"""QGroundControl's altitude mode of a plan whose items differ."""


def write_qgc_plan(mission: Mission, target: PlanTarget | None = None) -> str:
    """Return `mission` as the text of a `.plan` file for `target`, a generic one if None.

    NaN is written as null, except for a target that refuses it: there it is 0 (`losses` tells).
    A mission without home has a planned home of zeros, because QGroundControl asks for one. The
    speeds by which QGroundControl estimates times are those of the mission's first
    DO_CHANGE_SPEED. What the mission has `unread` is told under a key of that name, which
    QGroundControl passes over. Raises `MissionFileError` for a DO_JUMP to no item of the mission.
    """
    home = mission.home or Home(0.0, 0.0, 0.0)
    speed = _first_speed(mission)
    not_set = None if target is None or target.takes_null else 0
    plan: dict[str, Any] = {
        "fileType": "Plan",
        "geoFence": _fence(mission.fence),
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": speed or _CRUISE_SPEED,
            "firmwareType": target.firmware if target else 0,
            "globalPlanAltitudeMode": _global_altitude_mode(mission),
            "hoverSpeed": speed or _HOVER_SPEED,
            "items": [
                _item(number, item, mission, not_set)
                for number, item in enumerate(mission.items, start=1)
            ],
            "plannedHomePosition": _place(home),
            "vehicleType": target.vehicle_type if target else 0,
            "version": 2,
        },
        "rallyPoints": {"points": list(map(_place, mission.rally)), "version": 2},
        "version": 1,
    }
    if mission.unread:
        plan["unread"] = list(mission.unread)
    return json.dumps(plan, indent=4, allow_nan=False) + "\n"


def _item(number: int, item: MissionItem, mission: Mission, not_set: int | None) -> dict[str, Any]:
    if item.command == Command.DO_JUMP and item.params[0] not in range(1, len(mission.items) + 1):
        raise MissionFileError(
            f"item {number}: DO_JUMP to {item.params[0]:g}; expected an item of the mission, "
            f"1 to {len(mission.items)}"
        )
    params = [
        not_set if math.isnan(value) else value for value in (*item.params, item.x, item.y, item.z)
    ]
    result: dict[str, Any] = {
        "autoContinue": item.autocontinue,
        "command": int(item.command),
        "doJumpId": number,
        "frame": int(item.frame),
        "params": params,
        "type": "SimpleItem",
    }
    mode = _altitude_mode(item)
    if mode is not None:
        altitude = {"AMSLAltAboveTerrain": None, "Altitude": params[6], "AltitudeMode": mode}
        result = altitude | result
    return result


def _altitude_mode(item: MissionItem) -> int | None:
    """Return how QGroundControl is to show the item's altitude; None: as a plain parameter."""
    return next((mode for mode, frames in _ALTITUDE_MODES if item.frame in frames), None)


def _global_altitude_mode(mission: Mission) -> int:
    modes = {_altitude_mode(item) for item in mission.items} - {None}
    return (modes.pop() if len(modes) == 1 else None) or _MIXED


def _first_speed(mission: Mission) -> float | None:
    speeds = (i.params[1] for i in mission.items if i.command == Command.DO_CHANGE_SPEED)
    return next((speed for speed in speeds if speed > 0), None)


def _fence(fence: Fence) -> dict[str, Any]:
    result: dict[str, Any] = {
        "circles": [
            {
                "circle": {"center": list(circle.center), "radius": circle.radius},
                "inclusion": circle.inclusion,
                "version": 1,
            }
            for circle in fence.circles
        ],
        "polygons": [
            {
                "inclusion": polygon.inclusion,
                "polygon": [list(vertex) for vertex in polygon.vertices],
                "version": 1,
            }
            for polygon in fence.polygons
        ],
        "version": 2,
    }
    if fence.breach_return is not None:
        result["breachReturn"] = _place(fence.breach_return)
    return result


def _place(point: Home | RallyPoint) -> list[float | None]:
    known = not math.isnan(point.altitude)
    return [point.latitude, point.longitude, point.altitude if known else None]
