"""The MAVLink commands and frames that missions here use (names of the MAVLink common set)."""

from enum import IntEnum
from typing import Final


class Command(IntEnum):
    """MAV_CMD: what an item does."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LOITER_TO_ALT = 31
    NAV_SPLINE_WAYPOINT = 82
    NAV_VTOL_TAKEOFF = 84
    NAV_VTOL_LAND = 85
    NAV_GUIDED_ENABLE = 92
    NAV_DELAY = 93
    CONDITION_DELAY = 112
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_SET_ROI = 201
    JUMP_TAG = 600
    DO_JUMP_TAG = 601


FLOWN_TO = frozenset(command for command in Command if command.name.startswith("NAV_")) - {
    Command.NAV_RETURN_TO_LAUNCH,
    Command.NAV_GUIDED_ENABLE,
    Command.NAV_DELAY,
}
"""Commands that fly to the place x, y, z of their item."""

HOLDING = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TIME)
"""Commands to a place whose param1 is how long, s, what hovers waits there."""

LANDINGS = frozenset({Command.NAV_LAND, Command.NAV_VTOL_LAND})
TAKEOFFS = frozenset({Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF})

FENCE_RETURN_POINT: Final = 5000
"""MAV_CMD_NAV_FENCE_RETURN_POINT."""

POLYGON: Final = {True: 5001, False: 5002}
"""The vertices of a fence's polygon, by whether to stay in it."""

CIRCLE: Final = {True: 5003, False: 5004}
"""A fence's circle, by whether to stay in it."""

RALLY_POINT: Final = 5100
"""MAV_CMD_NAV_RALLY_POINT."""


class Frame(IntEnum):
    """MAV_FRAME: what an item's coordinates mean.

    PX4 refuses a whole mission whose DO_CHANGE_SPEED or RETURN_TO_LAUNCH is not in `MISSION`.
    """

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11


ABOVE_SEA = frozenset({Frame.GLOBAL, Frame.GLOBAL_INT})
"""Frames whose z counts from mean sea level."""

ABOVE_HOME = frozenset({Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT})
"""Frames whose z counts from home."""

ABOVE_TERRAIN = frozenset({Frame.GLOBAL_TERRAIN_ALT, Frame.GLOBAL_TERRAIN_ALT_INT})
"""Frames whose z counts from the ground below."""
