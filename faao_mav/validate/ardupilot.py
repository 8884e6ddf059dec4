"""What ArduPilot does not arm or start for, and what it flies in a way that nobody expects."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.autopilot import ARDUCOPTER, ARDUPLANE
from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.command import ABOVE_TERRAIN, FLOWN_TO, TAKEOFFS, Command, Frame
from faao_mav.validate.context import NAV_LAST, ValidationContext, at_zero, number
from faao_mav.validate.rule import Issue, Level, Rules

RULES = Rules(ARDUCOPTER.family)

_SKIPPED = {
    ARDUCOPTER: (30, 83, 191, 194, 210, 212, 223, 3000),
    ARDUPLANE: (
        Command.NAV_VTOL_LAND,
        Command.NAV_GUIDED_ENABLE,
        Command.NAV_DELAY,
        Command.CONDITION_YAW,
        *(213, 222, 3000, 42600),
    ),
}
"""Commands that are stored and then passed over."""

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

_SAME_HEIGHT = 1.0
"""The height, m, by which home may be moved in flight: less does not matter. Chosen; at home's own
it was flown."""

_TAKEOFFS = {
    ARDUCOPTER: TAKEOFFS,
    ARDUPLANE: {Command.NAV_TAKEOFF},
}
"""What gets the aircraft off the ground. A plane without vertical rotors stays there for the other.
Measured."""

_ON_GROUND = {
    ARDUCOPTER: "AUTO is refused (Missing Takeoff Cmd), or it disarms after 10 s",
    ARDUPLANE: "it stays there",
}


@RULES.error("ardupilot-required-item", _ARMING)
def _required(context: ValidationContext) -> Iterator[Issue]:
    """ARMING_MIS_ITEMS asks for an item that the mission does not have."""
    bits = int(context.vehicle.value("arming_items"))
    there = {item.command for item in context.items}
    for bit, command in _REQUIRED.items():
        if bits & bit and command not in there:
            yield Issue(
                None,
                f"ARMING_MIS_ITEMS is {bits} and asks for {command.name}, which the mission does "
                "not have",
                f"add {command.name}, or take {bit} off ARMING_MIS_ITEMS",
            )


@RULES.error("ardupilot-required-rally", f"{_ARMING}, AP_Rally::find_nearest_rally_point")
def _required_rally(context: ValidationContext) -> Iterator[Issue]:
    """ARMING_MIS_ITEMS asks for a rally point near enough."""
    bits = int(context.vehicle.value("arming_items"))
    if not bits & _RALLY_BIT or context.frame is None:
        return
    limit = context.vehicle.value("rally_limit")
    places = (context.frame.to_local(p.latitude, p.longitude) for p in context.mission.rally)
    nearest = min((math.hypot(*place) for place in places), default=None)
    if nearest is None or (limit and nearest > limit):
        there = "there is none" if nearest is None else f"the nearest is {nearest:.0f} m away"
        yield Issue(
            None,
            f"ARMING_MIS_ITEMS is {bits} and asks for a rally point"
            f"{f' within {limit:g} m' if limit else ''}; {there}",
            f"add one, or take {_RALLY_BIT} off ARMING_MIS_ITEMS",
        )


@RULES.error("ardupilot-no-takeoff", _TAKEOFF)
def _no_takeoff(context: ValidationContext) -> Iterator[Issue]:
    """Without a take-off ArduPilot does not start the mission from the ground."""
    return _without_takeoff(context, airborne=False)


@RULES.warning("ardupilot-begins-in-the-air", _TAKEOFF)
def _begins_in_the_air(context: ValidationContext) -> Iterator[Issue]:
    """A plan begins in the air: ArduPilot does not start its mission from the ground."""
    return _without_takeoff(context, airborne=True)


def _without_takeoff(context: ValidationContext, *, airborne: bool) -> Iterator[Issue]:
    own = context.vehicle.type
    if context.items and airborne is context.airborne and not any(context.each(*_TAKEOFFS[own])):
        yield Issue(
            None,
            f"there is no take-off that a {own.kind} flies: from the ground {_ON_GROUND[own]}",
            "take off before you start the mission, or add NAV_TAKEOFF as the first item",
        )


@RULES.error("ardupilot-takeoff-first", _TAKEOFF)
def _takeoff_first(context: ValidationContext) -> Iterator[Issue]:
    """ArduPilot starts a mission on the ground only if it begins with a take-off."""
    own = context.vehicle.type
    takeoff = next((index for index, _ in context.each(*_TAKEOFFS[own])), 0)
    before = next(
        (
            index
            for index, item in enumerate(context.items[:takeoff])
            if item.command <= NAV_LAST and item.command != Command.NAV_DELAY
        ),
        None,
    )
    if before is not None and not context.airborne:
        yield Issue(
            takeoff,
            f"the take-off comes after item {number(before)}: from the ground {_ON_GROUND[own]}",
            f"move the take-off before item {number(before)}",
        )


@RULES.error("ardupilot-land-start", _ARMING, kind="plane")
def _land_start(context: ValidationContext) -> Iterator[Issue]:
    """DO_LAND_START, but RTL_AUTOLAND is 0: ArduPlane does not arm."""
    for index, _ in context.each(Command.DO_LAND_START):
        if context.vehicle.value("return_lands") == 0:
            yield Issue(
                index,
                f"{context.vehicle.name_of('return_lands')} is 0: arming is refused "
                "(DO_LAND_START set and RTL_AUTOLAND disabled)",
                "set RTL_AUTOLAND to 2 (a return lands here) or 3 (it does not), or remove the "
                "item",
            )


def _flying(context: ValidationContext) -> Iterator[tuple[int, int]]:
    """Yield index and command of the items that fly, in order."""
    return ((k, item.command) for k, item in enumerate(context.items) if item.command <= NAV_LAST)


@RULES.error(
    "ardupilot-spline-delay",
    "measured on ArduCopter 4.7: from 30 m to 12 m and to 79 m in 8 of 8 flights",
    kind="copter",
)
def _spline_delay(context: ValidationContext) -> Iterator[Issue]:
    """A NAV_DELAY after a spline waypoint: the aircraft may plunge."""
    for (before, first), (index, second) in pairwise(_flying(context)):
        if (first, second) == (Command.NAV_SPLINE_WAYPOINT, Command.NAV_DELAY):
            yield Issue(
                index,
                f"the delay follows the spline waypoint {number(before)}: the autopilot reads its "
                "bytes as the spline's next point and may plunge or climb",
                f"make item {number(before)} a plain waypoint, or give it a hold in whole seconds",
            )


@RULES.warning(
    "ardupilot-spline-last",
    "measured on ArduCopter 4.7: Internal Errors 0x20000000, which refuse the next arming",
    kind="copter",
)
def _spline_last(context: ValidationContext) -> Iterator[Issue]:
    """A spline waypoint behind another item is the last that flies: an internal error."""
    *_, before, last = [(-1, 0), (-1, 0), *_flying(context)]
    if last[1] == Command.NAV_SPLINE_WAYPOINT != before[1]:
        yield Issue(
            last[0],
            "a single spline waypoint is the last item that flies: it is flown, and reported as an "
            "internal error of the autopilot",
            "make it a plain waypoint, or let a return, a landing or another waypoint follow",
        )


@RULES.warning(
    "ardupilot-land-approach",
    "measured on ArduPlane 4.7: 102 m from a landing point at home, 3 m from one 700 m ahead",
    kind="plane",
)
def _approach(context: ValidationContext) -> Iterator[Issue]:
    """A plane lands straight from its take-off, without an approach."""
    for (_, first), (index, second) in pairwise(_flying(context)):
        if (first, second) == (Command.NAV_TAKEOFF, Command.NAV_LAND):
            yield Issue(
                index,
                "the landing follows the take-off: a plane that is not in line with it misses it "
                "by 100 m",
                "put waypoints before it from which it can glide to the landing",
            )


@RULES.error(
    "ardupilot-set-home", "measured on ArduCopter 4.7: it hovers at the next waypoint for good"
)
def _set_home(context: ValidationContext) -> Iterator[Issue]:
    """Home is set in flight: heights above home count from there, and no waypoint is reached."""
    takeoffs = [index for index, _ in context.each(*_TAKEOFFS[context.vehicle.type])]
    for index, item in context.each(Command.DO_SET_HOME):
        same_height = item.params[0] == 0 and abs(context.height(item)) < _SAME_HEIGHT
        in_flight = context.airborne or any(takeoff < index for takeoff in takeoffs)
        if in_flight and not same_height:
            yield Issue(
                index,
                "home moves in flight, and with it what heights above home count from: the "
                "aircraft hovers at the next waypoint for good",
                "remove the item",
            )


RULES.commands(
    Level.WARNING,
    "ardupilot-guided",
    "NAV_GUIDED_ENABLE: the aircraft hovers until another computer leads it on",
    "measured on ArduCopter 4.7: it hovers there for good",
    (Command.NAV_GUIDED_ENABLE,),
    "the aircraft hovers there for good, unless another computer leads it on and ends it",
    "remove the item, if no companion computer is meant to take over",
    where=lambda item: item.params[0] > 0,
    kind="copter",
)
RULES.commands(
    Level.WARNING,
    "ardupilot-stays",
    "ArduPilot takes a waypoint at latitude and longitude 0 for the place where it is",
    "ArduPilot 4.7 ModeAuto::loc_from_cmd, Plane::set_next_WP; measured",
    (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT),
    "latitude and longitude are 0: the aircraft stays where it is",
    "give the coordinates, or remove the item",
    where=at_zero,
)
RULES.commands(
    Level.WARNING,
    "ardupilot-frame-mission",
    "ArduPilot takes coordinates in frame 2 for heights above sea level",
    "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd; measured",
    FLOWN_TO,
    "frame 2 says that there are no coordinates, but ArduPilot flies there, at {item.z:g} m above "
    "sea level",
    "use frame 3 for heights above home, 0 for heights above sea level",
    where=lambda item: item.frame == Frame.MISSION,
)


@RULES.warning(
    "ardupilot-command-skipped",
    "measured; ArduCopter 4.7 ModeAuto::start_command, ArduPlane 4.7 Plane::start_command",
)
def _skipped(context: ValidationContext) -> Iterator[Issue]:
    """ArduPilot stores this command, but this kind of aircraft does nothing with it."""
    for index, item in context.each(*_SKIPPED[context.vehicle.type]):
        yield Issue(
            index,
            f"{name_of(item.command)} is stored, but a {context.vehicle.kind} skips it",
            "remove the item, or check that --type is right",
        )


@RULES.error(
    "ardupilot-terrain",
    "measured on ArduCopter and ArduPlane 4.7: arming is refused (waiting for terrain data)",
)
def _terrain(context: ValidationContext) -> Iterator[Issue]:
    """Heights above terrain: without terrain data ArduPilot does not arm."""
    above = [index for index, item in context.each(*FLOWN_TO) if item.frame in ABOVE_TERRAIN]
    if above:
        off = context.vehicle.value("terrain_enable") == 0
        why = "TERRAIN_ENABLE is 0" if off else "that takes terrain data on the vehicle"
        yield Issue(
            above[0],
            f"{len(above)} of the heights count from the terrain (frame 10 or 11): {why}; without, "
            "ArduPilot does not arm, and such heights are not checked here",
            "use frame 3, height above home; or make sure of the terrain data"
            + (" and set TERRAIN_ENABLE to 1" if off else ""),
        )


@RULES.note("altitude-rounded", "measured on ArduCopter 4.7: read back")
def _altitude(context: ValidationContext) -> Iterator[Issue]:
    """An altitude is stored in whole centimetres."""
    changed = []
    for index, item in context.each(*FLOWN_TO):
        stored = context.stored(index)
        if stored is not None and abs(stored.z - item.z) > 1e-4 * max(1.0, abs(item.z)):
            changed.append((index, item.z, stored.z))
    if changed:
        index, z, kept = changed[0]
        more = f", and so in {len(changed)} items" if len(changed) > 1 else ""
        yield Issue(
            index,
            f"the altitude of {z:g} m is stored as {kept:.2f} m{more}",
            "nothing, unless centimetres matter",
        )
