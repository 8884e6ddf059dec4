"""What ArduPilot does not arm or start for, and what it flies in a way that nobody expects."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.command import ABOVE_TERRAIN, FLOWN_TO, TAKEOFFS, Command, Frame
from faao_mav.validate.context import ValidationContext, at_zero
from faao_mav.validate.rule import Issue, Rules

RULES = Rules("ardupilot")

_SKIPPED = {
    "copter": (30, 83, 191, 194, 210, 212, 223, 3000),
    "plane": (
        *(Command.NAV_VTOL_LAND, Command.NAV_GUIDED_ENABLE, Command.NAV_DELAY),
        *(Command.CONDITION_YAW, 213, 222, 3000, 42600),
    ),
}
"""Commands that each type of vehicle stores and then passes over."""

_ARMING = "ArduPilot 4.7 AP_Arming::mission_checks; measured"
_TAKEOFF = "measured on ArduCopter and ArduPlane 4.7; AP_Mission::starts_with_takeoff_cmd"

_REQUIRED = {
    1: Command.NAV_LAND,
    2: Command.NAV_VTOL_LAND,
    4: Command.DO_LAND_START,
    8: Command.NAV_TAKEOFF,
    16: Command.NAV_VTOL_TAKEOFF,
    64: Command.NAV_RETURN_TO_LAUNCH,
}
"""The items that bits of ARMING_MIS_ITEMS ask for."""

_RALLY_BIT = 32
_WAYPOINTS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)

_SAME_HEIGHT = 1.0
"""The height, m, by which home may be moved in flight: less does not matter. Chosen; at home's own
it was flown."""

_TAKEOFFS = {"copter": TAKEOFFS, "plane": {Command.NAV_TAKEOFF}}
"""What gets the aircraft off the ground. A plane without vertical rotors stays there for the other.
Measured."""

_ON_GROUND = {
    "copter": "AUTO is refused (Missing Takeoff Cmd), or it disarms after 10 s",
    "plane": "it stays there",
}


@RULES.error("ardupilot-required-item", _ARMING)
def _required(context: ValidationContext) -> Iterator[Issue]:
    """ARMING_MIS_ITEMS asks for an item that the mission does not have."""
    bits = int(context.vehicle.value("arming_items"))
    for bit, command in _REQUIRED.items():
        if bits & bit and not any(context.each(command)):
            told = f"ARMING_MIS_ITEMS is {bits} and asks for {command.name}, which is not there"
            yield Issue(None, told, f"add {command.name}, or take {bit} off ARMING_MIS_ITEMS")


@RULES.error("ardupilot-required-rally", f"{_ARMING}, AP_Rally::find_nearest_rally_point")
def _required_rally(context: ValidationContext) -> Iterator[Issue]:
    """ARMING_MIS_ITEMS asks for a rally point near enough."""
    bits, limit = int(context.vehicle.value("arming_items")), context.vehicle.value("rally_limit")
    if not bits & _RALLY_BIT or context.frame is None:
        return
    places = (context.frame.to_local(p.latitude, p.longitude) for p in context.mission.rally)
    nearest = min((math.hypot(*place) for place in places), default=math.inf)
    if not nearest < (limit or math.inf):
        within = f" within {limit:g} m" if limit else ""
        there = f"the nearest is {nearest:.0f} m away" if nearest < math.inf else "there is none"
        told = f"ARMING_MIS_ITEMS is {bits} and asks for a rally point{within}; {there}"
        yield Issue(None, told, f"add one, or take {_RALLY_BIT} off ARMING_MIS_ITEMS")


@RULES.error("ardupilot-no-takeoff", _TAKEOFF)
def _no_takeoff(context: ValidationContext) -> Iterator[Issue]:
    """Without a take-off ArduPilot does not start the mission from the ground."""
    if not context.airborne:
        yield from _without_takeoff(context)


@RULES.warning("ardupilot-begins-in-the-air", _TAKEOFF)
def _begins_in_the_air(context: ValidationContext) -> Iterator[Issue]:
    """A plan begins in the air: ArduPilot does not start its mission from the ground."""
    if context.airborne:
        yield from _without_takeoff(context)


def _without_takeoff(context: ValidationContext) -> Iterator[Issue]:
    kind = context.vehicle.kind
    if context.items and not any(context.each(*_TAKEOFFS[kind])):
        told = f"there is no take-off that a {kind} flies: from the ground {_ON_GROUND[kind]}"
        yield Issue(None, told, "take off before you start it, or add NAV_TAKEOFF as first item")


@RULES.error("ardupilot-takeoff-first", _TAKEOFF)
def _takeoff_first(context: ValidationContext) -> Iterator[Issue]:
    """ArduPilot starts a mission on the ground only if it begins with a take-off."""
    kind = context.vehicle.kind
    takeoff = next((index for index, _ in context.each(*_TAKEOFFS[kind])), 0)
    before = next((k + 1 for k, command in context.flying if command != Command.NAV_DELAY), 0)
    if 0 < before <= takeoff and not context.airborne:
        told = f"the take-off comes after item {before}: from the ground {_ON_GROUND[kind]}"
        yield Issue(takeoff, told, f"move the take-off before item {before}")


RULES.error_where(
    "ardupilot-land-start",
    "DO_LAND_START, but RTL_AUTOLAND is 0: ArduPlane does not arm",
    "set RTL_AUTOLAND to 2 (a return lands here) or 3 (it does not), or remove the item",
    _ARMING,
    lambda context: (
        k
        for k, _ in context.each(Command.DO_LAND_START)
        if context.vehicle.value("return_lands") == 0
    ),
    kind="plane",
)


@RULES.error(
    "ardupilot-spline-delay",
    "measured on ArduCopter 4.7: from 30 m to 12 m and to 79 m in 8 of 8 flights",
    kind="copter",
)
def _spline_delay(context: ValidationContext) -> Iterator[Issue]:
    """A NAV_DELAY after a spline waypoint: the aircraft may plunge."""
    for (before, first), (index, second) in pairwise(context.flying):
        if (first, second) == (Command.NAV_SPLINE_WAYPOINT, Command.NAV_DELAY):
            told = (
                f"a delay after the spline waypoint {before + 1}: the aircraft may plunge or climb"
            )
            do = f"make item {before + 1} a plain waypoint, or give it a hold in whole seconds"
            yield Issue(index, told, do)


@RULES.warning(
    "ardupilot-spline-last",
    "measured on ArduCopter 4.7: Internal Errors 0x20000000, which refuse the next arming",
    "make it a plain waypoint, or let a return, a landing or another waypoint follow",
    kind="copter",
)
def _spline_last(context: ValidationContext) -> Iterator[Issue]:
    """A spline waypoint behind another item is the last that flies: an internal error."""
    *_, before, last = [(-1, 0), (-1, 0), *context.flying]
    if last[1] == Command.NAV_SPLINE_WAYPOINT != before[1]:
        yield Issue(last[0])


@RULES.warning(
    "ardupilot-land-approach",
    "measured on ArduPlane 4.7: 102 m from a landing point at home, 3 m from one 700 m ahead",
    "put waypoints before it from which it can glide to the landing",
    kind="plane",
)
def _approach(context: ValidationContext) -> Iterator[Issue]:
    """A landing right after the take-off: a plane that is not in line with it misses by 100 m."""
    for (_, first), (index, second) in pairwise(context.flying):
        if (first, second) == (Command.NAV_TAKEOFF, Command.NAV_LAND):
            yield Issue(index)


@RULES.error(
    "ardupilot-set-home",
    "measured on ArduCopter 4.7: it hovers at the next waypoint for good",
    "remove the item",
)
def _set_home(context: ValidationContext) -> Iterator[Issue]:
    """Home is set in flight: heights above home count from there, and no waypoint is reached."""
    takeoffs = [index for index, _ in context.each(*_TAKEOFFS[context.vehicle.kind])]
    for index, item in context.each(Command.DO_SET_HOME):
        same_height = item.params[0] == 0 and abs(context.height(item)) < _SAME_HEIGHT
        if not same_height and (context.airborne or min(takeoffs, default=index) < index):
            yield Issue(index)


RULES.warning_where(
    "ardupilot-guided",
    "NAV_GUIDED_ENABLE: the aircraft hovers there for good, unless another computer leads it on",
    "remove the item, if no companion computer is meant to take over",
    "measured on ArduCopter 4.7: it hovers there for good",
    lambda context: (
        k for k, item in context.each(Command.NAV_GUIDED_ENABLE) if item.params[0] > 0
    ),
    kind="copter",
)
RULES.warning_where(
    "ardupilot-stays",
    "latitude and longitude are 0: the aircraft stays where it is",
    "give the coordinates, or remove the item",
    "ArduPilot 4.7 ModeAuto::loc_from_cmd, Plane::set_next_WP; measured",
    lambda context: (k for k, item in context.each(*_WAYPOINTS) if at_zero(item)),
)
RULES.warning_where(
    "ardupilot-frame-mission",
    "frame 2 says that there is no place, but ArduPilot flies there, z above sea level",
    "use frame 3 for heights above home, 0 for heights above sea level",
    "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd; measured",
    lambda context: (k for k, item in context.each(*FLOWN_TO) if item.frame == Frame.MISSION),
)
RULES.warning_where(
    "ardupilot-command-skipped",
    "ArduPilot stores this command, but this kind of aircraft does nothing with it",
    "remove the item, or check that --type is right",
    "measured; ArduCopter 4.7 ModeAuto::start_command, ArduPlane 4.7 Plane::start_command",
    lambda context: (
        (k, name_of(item.command)) for k, item in context.each(*_SKIPPED[context.vehicle.kind])
    ),
    "{} is stored, and skipped by this kind of aircraft",
)


@RULES.error(
    "ardupilot-terrain",
    "measured on ArduCopter and ArduPlane 4.7: arming is refused (waiting for terrain data)",
    "use frame 3, height above home; or make sure of terrain data, with TERRAIN_ENABLE 1",
)
def _terrain(context: ValidationContext) -> Iterator[Issue]:
    """Heights above terrain: without terrain data ArduPilot does not arm."""
    above = [index for index, item in context.each(*FLOWN_TO) if item.frame in ABOVE_TERRAIN]
    if above:
        off = ", and TERRAIN_ENABLE is 0" if context.vehicle.value("terrain_enable") == 0 else ""
        told = f"{len(above)} heights count from the terrain and are not checked here{off}"
        yield Issue(above[0], f"{told}: without terrain data ArduPilot does not arm")


@RULES.note("altitude-rounded", "measured on ArduCopter 4.7: read back")
def _altitude(context: ValidationContext) -> Iterator[Issue]:
    """An altitude is stored in whole centimetres."""
    pairs = [(k, item.z, kept.z) for k, item, kept in context.stored if item.command in FLOWN_TO]
    changed = [each for each in pairs if abs(each[2] - each[1]) > 1e-4 * max(1.0, abs(each[1]))]
    for index, z, kept in changed[:1]:
        more = f", and so in {len(changed)} items" if changed[1:] else ""
        told = f"the altitude of {z:g} m is stored as {kept:.2f} m{more}"
        yield Issue(index, told, "nothing, unless centimetres matter")
