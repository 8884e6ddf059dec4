"""What a mission file tells, what it does not hold, and whom it is for."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from faao_mav.errors import counted
from faao_mav.mission.item import Mission

_NAMES = ("param1", "param2", "param3", "param4", "latitude", "longitude", "altitude")

_SHOWN_ITEMS = 5  # Values that a line names before it counts the rest; chosen to fit two lines.


@dataclass(frozen=True, slots=True)
class MissionFile:
    """A mission, for whom it was made as far as the file says it, and what was odd about it.

    `firmware` is a MAV_AUTOPILOT and `vehicle_type` a MAV_TYPE, which only `.plan` files hold.
    `warnings` are lines that name the place.
    """

    mission: Mission
    firmware: int | None = None
    vehicle_type: int | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanTarget:
    """Whom a `.plan` file is written for: a MAV_AUTOPILOT and a MAV_TYPE, 0 for a generic one.

    `takes_null`: whether that autopilot is sent null, not set, or 0 instead because it refuses it.
    """

    firmware: int
    vehicle_type: int
    takes_null: bool = True


def not_read(mission: Mission, then: str = "") -> Iterator[str]:
    """Yield what of a vehicle's mission was not read from it, one line each, and what follows."""
    for part in mission.unread:
        yield f"without the {part} that the vehicle may hold: not read from it{then}"


def left_out(mission: Mission, name: str) -> Iterator[str]:
    """Yield what of `mission` the format `name` leaves out, which holds no rally points."""
    yield from not_read(mission)
    if mission.rally:
        yield f"{name} holds no rally points: {counted(len(mission.rally), 'point')} left out"


def zeros(mission: Mission, *, for_nan: bool) -> Iterator[str]:
    """Yield what is written as 0: the home where none is known and, `for_nan`, what is not set."""
    places = [
        f"item {number} {name}"
        for number, item in enumerate(mission.items, start=1)
        for name, value in zip(_NAMES, item.numbers, strict=True)
        if for_nan and math.isnan(value)
    ]
    if places:
        more = f" and {len(places) - _SHOWN_ITEMS} more" if len(places) > _SHOWN_ITEMS else ""
        yield f"not set (NaN) becomes 0: {', '.join(places[:_SHOWN_ITEMS])}{more}"
    if mission.home is None:
        yield "no home is known: the file says 0, 0, 0, which means none"
