"""The numbers of the mission protocol.

Source: MAVLink developer guide, "Mission Protocol", and the MAVLink common set.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

from faao_mav.autopilot.manners import meanings_of


class MissionType(IntEnum):
    """MAV_MISSION_TYPE: which of a vehicle's three lists is meant; `part` in names."""

    MISSION = 0
    FENCE = 1
    RALLY = 2

    @property
    def title(self) -> str:
        """What people call it."""
        return ("mission", "fence", "rally points")[self]


class MavResult(IntEnum):
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


def meaning(result: int, own: Mapping[str, str]) -> str:
    """Return a MAV_MISSION_RESULT by its name, and what it says; `own` are an autopilot's meanings.

    >>> meaning(13, {}), meaning(5, {"INVALID": "command 0 or 1"}), meaning(99, {})
    ('INVALID_SEQUENCE (an item came out of turn)', 'INVALID (command 0 or 1)', 'result 99')
    """
    try:
        known = MavResult(result)
    except ValueError:
        return f"result {result}"
    text = own.get(known.name) or meanings_of("any").get(known.name)
    return f"{known.name} ({text})" if text else known.name


def command_result(result: int) -> str:
    """Return a MAV_RESULT, the answer to an order, by its name, and what it says.

    >>> command_result(3), command_result(5), command_result(99)
    ('UNSUPPORTED (it does not know the command)', 'IN_PROGRESS', 'MAV_RESULT 99')
    """
    return meanings_of("order").get(str(result), f"MAV_RESULT {result}")


_SHOWN = 5  # Things that a message lists, at most; chosen.


def listed(things: Sequence[str]) -> str:
    """Return the first of some things on one line, and how many more there are."""
    more = f"; and {len(things) - _SHOWN} more" if len(things) > _SHOWN else ""
    return "; ".join(things[:_SHOWN]) + more


class MavSeverity(IntEnum):
    """MAV_SEVERITY of status texts."""

    CRITICAL = 2
    WARNING = 4
    INFO = 6


class MavCommand(IntEnum):
    """MAV_CMD outside of missions."""

    TAKEOFF = 22
    SET_MODE = 176
    REBOOT = 246
    START = 300
    ARM = 400
    SET_INTERVAL = 511
    REQUEST_MESSAGE = 512


SYSTEM_STATUS, LOCAL_POSITION, POSITION, CURRENT_ITEM, LOCAL_ORIGIN = 1, 32, 33, 42, 49
AUTOPILOT_VERSION, HOME_POSITION, CURRENT_MODE = 148, 242, 436
"""The numbers of SYS_STATUS, LOCAL_POSITION_NED, GLOBAL_POSITION_INT, MISSION_CURRENT,
GPS_GLOBAL_ORIGIN, AUTOPILOT_VERSION, HOME_POSITION and CURRENT_MODE."""

ALL_TYPES = 255  # MAV_MISSION_TYPE_ALL: valid in MISSION_CLEAR_ALL only.
GROUND_STATION_TYPE, COMPANION_TYPE = 6, 18  # MAV_TYPE_GCS and MAV_TYPE_ONBOARD_CONTROLLER.
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: what ground stations and other components say they are.

ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED, in a heartbeat's base_mode.
PREARM_CHECK = 1 << 28  # MAV_SYS_STATUS_PREARM_CHECK, in the health of the sensors in SYS_STATUS.
MISSION_COMPLETE = 5  # MISSION_STATE_COMPLETE, in MISSION_CURRENT.

AIRFRAMES = frozenset({*range(5), *range(7, 18), *range(19, 26), 28, 29, 35, 43, 46, 47})
"""MAV_TYPE of what an autopilot moves. All others are beside one: ground stations, companions,
gimbals, cameras, ADS-B and remote identification, antenna trackers, parachutes, radios."""


class MavState(IntEnum):
    """MAV_STATE: below `STANDBY` a vehicle does not take missions yet."""

    BOOT = 1
    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4


@dataclass(frozen=True, slots=True, order=True)
class Address:
    """Who speaks on a link: system and component, 0 to 255; 0 addresses everyone."""

    system: int
    component: int

    def __str__(self) -> str:
        return f"system {self.system}, component {self.component}"

    def takes(self, target: "Address") -> bool:
        """Tell whether a message to `target` is for this address."""
        return target.system in (0, self.system) and target.component in (0, self.component)


GROUND_STATION = Address(246, 190)
"""This end: MAV_COMP_ID_MISSIONPLANNER of a system number of its own. Chosen: below those of ground
stations, which are 255 by default and from 250 on by custom, and not MAVSDK's 245."""
