"""What a check has to say."""

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How bad it is.

    `ERROR`: the autopilot refuses the mission, or the flight is dangerous or breaks a limit that
    was set. `WARNING`: it will not fly as it is written. `NOTE`: worth knowing.
    """

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that a rule found.

    `item` is the number that people see: the row of a `.waypoints` file, where row 0 is home, and
    the item's number in QGroundControl and Mission Planner; None if it is about no single item.
    `message` says what is the context, with the value and the limit; `action` what to do about it.
    """

    level: Level
    rule: str
    item: int | None
    message: str
    action: str
