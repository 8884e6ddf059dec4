"""What a mission file cannot hold, said aloud."""

import math

from faao_mav.mission.command import ABOVE_HOME, ABOVE_TERRAIN, Command
from faao_mav.mission.formats.mission_file import PlanTarget
from faao_mav.mission.item import Mission, MissionItem

_NAMES = ("param1", "param2", "param3", "param4", "latitude", "longitude", "altitude")

_SHOWN_ITEMS = 5
"""Values that a line names before it counts the rest; chosen to fit two lines."""


def wpl_losses(mission: Mission, target: PlanTarget | None = None) -> list[str]:
    """Return what of `mission` a QGC WPL file does not hold, one line each."""
    del target
    return [
        *unread_losses(mission),
        *_rally(mission, "QGC WPL"),
        *_not_set(mission),
        *_home(mission),
        *_height_of_home(mission),
    ]


def plan_losses(mission: Mission, target: PlanTarget | None) -> list[str]:
    """Return what of `mission` a `.plan` file for `target` does not hold, one line each."""
    clears = "QGroundControl clears it there when it uploads this plan"
    unread = [f"{line}; {clears}" for line in unread_losses(mission)]
    home = _home(mission)
    if target is None:
        return [*unread, "no autopilot is known: the plan is for a generic one", *home]
    return [*unread, *([] if target.takes_null else _not_set(mission)), *home]


def kml_losses(mission: Mission, target: PlanTarget | None = None) -> list[str]:
    """Return what of `mission` a KML file does not hold or show, one line each."""
    del target
    found = [
        *unread_losses(mission),
        *_rally(mission, "KML"),
        "KML holds route and fence alone: no commands, speeds or holds, and cannot be read back",
    ]
    frames = {item.frame for item in mission.items}
    known = mission.home is not None and not math.isnan(mission.home.altitude)
    if not known and frames & ABOVE_HOME:
        found.append("no height of home is known: heights above home are drawn above the ground")
    if frames & ABOVE_TERRAIN:
        found.append("heights above terrain are drawn above Google Earth's own")
    if any(item.command == Command.NAV_SPLINE_WAYPOINT for item in mission.items):
        found.append("spline waypoints are joined by straight lines")
    return found


def unread_losses(mission: Mission) -> list[str]:
    """Return what of a vehicle's mission was not read from it, one line each."""
    return [
        f"without the {part} that the vehicle may hold: not read from it" for part in mission.unread
    ]


def _rally(mission: Mission, name: str) -> list[str]:
    if not mission.rally:
        return []
    return [f"{name} holds no rally points: {_count(len(mission.rally), 'point')} left out"]


def _not_set(mission: Mission) -> list[str]:
    """Name the values that are not set, by item: they are written as 0."""
    places = [
        f"item {number} {name}"
        for number, item in enumerate(mission.items, start=1)
        for name, value in zip(_NAMES, _values(item), strict=True)
        if math.isnan(value)
    ]
    if not places:
        return []
    shown = ", ".join(places[:_SHOWN_ITEMS])
    more = f" and {len(places) - _SHOWN_ITEMS} more" if len(places) > _SHOWN_ITEMS else ""
    return [f"not set (NaN) becomes 0: {shown}{more}"]


def _home(mission: Mission) -> list[str]:
    return [] if mission.home else ["no home is known: the file says 0, 0, 0, which means none"]


def _height_of_home(mission: Mission) -> list[str]:
    unknown = mission.home is not None and math.isnan(mission.home.altitude)
    return ["the altitude of home is not known: the file says 0 m"] if unknown else []


def _values(item: MissionItem) -> tuple[float, ...]:
    return (*item.params, item.x, item.y, item.z)


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"
