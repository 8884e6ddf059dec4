"""The numbers of the mission protocol, and what its answers mean.

Source: MAVLink developer guide, "Mission Protocol", and the MAVLink common set.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

Firmware: TypeAlias = str
"""Whose manners a vehicle has; "generic" is any that follows the guide to the letter."""

FIRMWARE_NAMES = {"ardupilot": "ArduPilot", "px4": "PX4", "generic": "an autopilot unknown here"}


class MissionType(IntEnum):
    """MAV_MISSION_TYPE: which of a vehicle's three lists is meant."""

    MISSION = 0
    FENCE = 1
    RALLY = 2

    @property
    def title(self) -> str:
        """What people call it."""
        return ("mission", "fence", "rally points")[self]


ALL_TYPES = 255
"""MAV_MISSION_TYPE_ALL: valid in MISSION_CLEAR_ALL only."""


class Result(IntEnum):
    """MAV_MISSION_RESULT: how a transfer went."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15


class Autopilot(IntEnum):
    """MAV_AUTOPILOT, as far as missions need telling apart."""

    GENERIC = 0
    ARDUPILOT = 3
    INVALID = 8
    PX4 = 12


class State(IntEnum):
    """MAV_STATE: below `STANDBY` a vehicle does not take missions yet."""

    UNINIT = 0
    BOOT = 1
    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5


ARMED = 128
"""MAV_MODE_FLAG_SAFETY_ARMED, in a heartbeat's base_mode."""

_GENERAL = {
    Result.UNSUPPORTED_FRAME: "the frame of an item is not supported",
    Result.UNSUPPORTED: "a command, or this kind of list, is not supported",
    Result.INVALID: "an item, or this kind of list, is invalid",
    Result.INVALID_PARAM1: "param1 of an item is invalid",
    Result.INVALID_PARAM2: "param2 of an item is invalid",
    Result.INVALID_PARAM3: "param3 of an item is invalid",
    Result.INVALID_PARAM4: "param4 of an item is invalid",
    Result.INVALID_PARAM5_X: "the latitude (param5) of an item is out of range",
    Result.INVALID_PARAM6_Y: "the longitude (param6) of an item is out of range",
    Result.INVALID_PARAM7: "the altitude (param7) of an item is invalid",
    Result.INVALID_SEQUENCE: "an item came out of turn",
    Result.OPERATION_CANCELLED: "the vehicle gave the transfer up",
}

_PARTICULAR: dict[tuple[Firmware, Result], str] = {
    ("px4", Result.ERROR): (
        "busy with another transfer, storage failed, a fence polygon of fewer than 3 vertices, or "
        "fence items in a mission"
    ),
    ("px4", Result.INVALID): "this kind of list is unknown to it",
    ("ardupilot", Result.ERROR): (
        "no transfer under way, an item beyond the list, or a change of the mission that it is "
        "flying"
    ),
    ("ardupilot", Result.INVALID): "command 0 or 1",
    ("ardupilot", Result.UNSUPPORTED): (
        "a command that this vehicle does not know, or fence and rally points over MAVLink 1"
    ),
    ("ardupilot", Result.DENIED): "another ground station is uploading",
}


def meaning(result: int, firmware: Firmware) -> str:
    """Return `result` by name, and what it says when `firmware` sends it."""
    try:
        known = Result(result)
    except ValueError:
        return f"result {result}"
    text = _PARTICULAR.get((firmware, known)) or _GENERAL.get(known)
    return f"{known.name} ({text})" if text else known.name


@dataclass(frozen=True, slots=True, order=True)
class Address:
    """Who speaks on a link: system and component, 0 to 255; 0 addresses everyone."""

    system: int
    component: int

    def takes(self, system: int, component: int) -> bool:
        """Tell whether a message to `system`, `component` is for this address."""
        return system in (0, self.system) and component in (0, self.component)


NOBODY = Address(0, 0)
"""No sender has this address."""

GROUND_STATION = Address(255, 190)
"""MAV_COMP_ID_MISSIONPLANNER of the system that ground stations use by custom."""
