"""The MAVLink commands and frames that missions here use (names of the MAVLink common set)."""

from enum import IntEnum


class Command(IntEnum):
    """MAV_CMD: what an item does."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_DELAY = 93
    DO_CHANGE_SPEED = 178


class Frame(IntEnum):
    """MAV_FRAME: what an item's coordinates mean.

    PX4 refuses a whole mission whose DO_CHANGE_SPEED or RETURN_TO_LAUNCH is not in `MISSION`.
    """

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
