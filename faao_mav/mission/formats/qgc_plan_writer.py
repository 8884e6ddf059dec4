"""QGroundControl's `.plan` files, written: all that QGroundControl and MAVSDK ask for."""

import json
import math
from typing import Any

from faao_mav.errors import MissionFileError
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, ABOVE_TERRAIN, Command
from faao_mav.mission.fence import Fence, RallyPoint
from faao_mav.mission.formats.mission_file import NamedVehicle
from faao_mav.mission.formats.qgc_plan_reader import FIRMWARE, VEHICLE_TYPES
from faao_mav.mission.item import Home, Mission, MissionItem

_CRUISE_SPEED, _HOVER_SPEED = 15.0, 5.0  # what QGroundControl assumes
_MIXED, _RELATIVE, _ABSOLUTE, _TERRAIN_FRAME = 0, 1, 2, 4
"""QGroundControl's altitude modes."""


def write_qgc_plan(mission: Mission, vehicle: NamedVehicle | None = None) -> str:
    """Return `mission` as the text of a `.plan` file for `vehicle`, a generic one if None.

    NaN is written as null, except for ArduPilot, which refuses it: there it is 0 (`losses`
    tells). A mission without home has a planned home of zeros, because QGroundControl asks for
    one. The speeds by which QGroundControl estimates times are those of the mission's first
    DO_CHANGE_SPEED. Raises `MissionFileError` for a DO_JUMP to no item of the mission.
    """
    home = mission.home or Home(0.0, 0.0, 0.0)
    speed = _first_speed(mission)
    plan = {
        "fileType": "Plan",
        "geoFence": _fence(mission.fence),
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": speed or _CRUISE_SPEED,
            "firmwareType": FIRMWARE[vehicle.autopilot] if vehicle else 0,
            "globalPlanAltitudeMode": _global_altitude_mode(mission),
            "hoverSpeed": speed or _HOVER_SPEED,
            "items": [
                _item(number, item, mission, vehicle)
                for number, item in enumerate(mission.items, start=1)
            ],
            "plannedHomePosition": [home.latitude, home.longitude, home.altitude],
            "vehicleType": VEHICLE_TYPES[vehicle.kind][0] if vehicle else 0,
            "version": 2,
        },
        "rallyPoints": {"points": list(map(_rally_point, mission.rally)), "version": 2},
        "version": 1,
    }
    return json.dumps(plan, indent=4, allow_nan=False) + "\n"


def _item(
    number: int, item: MissionItem, mission: Mission, vehicle: NamedVehicle | None
) -> dict[str, Any]:
    if item.command == Command.DO_JUMP and item.params[0] not in range(1, len(mission.items) + 1):
        raise MissionFileError(
            f"item {number}: DO_JUMP to {item.params[0]:g}; expected an item of the mission, "
            f"1 to {len(mission.items)}"
        )
    not_set = 0 if vehicle is not None and vehicle.autopilot == "ardupilot" else None
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
    modes = {_RELATIVE: ABOVE_HOME, _ABSOLUTE: ABOVE_SEA, _TERRAIN_FRAME: ABOVE_TERRAIN}
    return next((mode for mode, frames in modes.items() if item.frame in frames), None)


def _global_altitude_mode(mission: Mission) -> int:
    modes = {_altitude_mode(item) for item in mission.items} - {None}
    return modes.pop() or _MIXED if len(modes) == 1 else _MIXED


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
        result["breachReturn"] = _rally_point(fence.breach_return)
    return result


def _rally_point(point: RallyPoint) -> list[float]:
    return [point.latitude, point.longitude, point.altitude]
