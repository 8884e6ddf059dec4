"""What ArduPilot does not arm or start for, and what it flies in a way that nobody expects."""

import math
from itertools import pairwise

from faao_mav.mission.command import ABOVE_TERRAIN, FLOWN_TO, TAKEOFFS, Command, Frame
from faao_mav.validate.context import ValidationContext, at_zero
from faao_mav.validate.rule import Checks, Hits, at

checks = Checks()

_SKIPPED = {
    "copter": (30, 83, 191, 194, 210, 212, 223, 3000),
    "plane": (
        *(Command.NAV_VTOL_LAND, Command.NAV_GUIDED_ENABLE, Command.NAV_DELAY),
        *(Command.CONDITION_YAW, 213, 222, 3000, 42600),
    ),
}
"""Commands that each type of vehicle stores and then passes over."""

_REQUIRED = {
    1: Command.NAV_LAND,
    2: Command.NAV_VTOL_LAND,
    4: Command.DO_LAND_START,
    8: Command.NAV_TAKEOFF,
    16: Command.NAV_VTOL_TAKEOFF,
    64: Command.NAV_RETURN_TO_LAUNCH,
}
"""The items that bits of ARMING_MIS_ITEMS ask for."""

RALLY_BIT = 32
"""The bit of ARMING_MIS_ITEMS that asks for a rally point."""

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


@checks("ardupilot-required-item")
def _(context: ValidationContext) -> Hits:
    bits = int(context.vehicle.value("arming_items"))
    for bit, command in _REQUIRED.items():
        if bits & bit and not any(context.each(command)):
            yield at(bits=bits, bit=bit, name=command.name)


@checks("ardupilot-required-rally")
def _(context: ValidationContext) -> Hits:
    bits, limit = int(context.vehicle.value("arming_items")), context.vehicle.value("rally_limit")
    if not bits & RALLY_BIT or context.frame is None:
        return
    places = (context.frame.to_local(p.latitude, p.longitude) for p in context.mission.rally)
    nearest = min((math.hypot(*place) for place in places), default=math.inf)
    if not nearest < (limit or math.inf):
        there = f"the nearest is {nearest:.0f} m away" if nearest < math.inf else "there is none"
        yield at(bits=bits, within=f" within {limit:g} m" if limit else "", there=there)


@checks("ardupilot-no-takeoff")
def _(context: ValidationContext) -> Hits:
    return () if context.airborne else _without_takeoff(context)


@checks("ardupilot-begins-in-the-air")
def _(context: ValidationContext) -> Hits:
    return _without_takeoff(context) if context.airborne else ()


def _without_takeoff(context: ValidationContext) -> Hits:
    kind = context.vehicle.kind
    if context.items and not any(context.each(*_TAKEOFFS[kind])):
        yield at(does=_ON_GROUND[kind])


@checks("ardupilot-takeoff-first")
def _(context: ValidationContext) -> Hits:
    kind = context.vehicle.kind
    takeoff = next((index for index, _ in context.each(*_TAKEOFFS[kind])), 0)
    before = next((k + 1 for k, command in context.flying if command != Command.NAV_DELAY), 0)
    if 0 < before <= takeoff and not context.airborne:
        yield at(takeoff, before=before, does=_ON_GROUND[kind])


@checks("ardupilot-land-start")
def _(context: ValidationContext) -> Hits:
    if context.vehicle.value("return_lands") == 0:
        yield from (at(k) for k, _ in context.each(Command.DO_LAND_START))


@checks("ardupilot-spline-delay")
def _(context: ValidationContext) -> Hits:
    for (before, first), (index, second) in pairwise(context.flying):
        if (first, second) == (Command.NAV_SPLINE_WAYPOINT, Command.NAV_DELAY):
            yield at(index, before=before + 1)


@checks("ardupilot-spline-last")
def _(context: ValidationContext) -> Hits:
    *_, before, last = [(-1, 0), (-1, 0), *context.flying]
    if last[1] == Command.NAV_SPLINE_WAYPOINT != before[1]:
        yield at(last[0])


@checks("ardupilot-land-approach")
def _(context: ValidationContext) -> Hits:
    landing = (Command.NAV_TAKEOFF, Command.NAV_LAND)
    return (at(k) for (_, one), (k, two) in pairwise(context.flying) if (one, two) == landing)


@checks("ardupilot-set-home")
def _(context: ValidationContext) -> Hits:
    takeoffs = [index for index, _ in context.each(*_TAKEOFFS[context.vehicle.kind])]
    for index, item in context.each(Command.DO_SET_HOME):
        same_height = item.params[0] == 0 and abs(context.height(item)) < _SAME_HEIGHT
        if not same_height and (context.airborne or min(takeoffs, default=index) < index):
            yield at(index)


@checks("ardupilot-guided")
def _(context: ValidationContext) -> Hits:
    return (at(k) for k, item in context.each(Command.NAV_GUIDED_ENABLE) if item.params[0] > 0)


@checks("ardupilot-stays")
def _(context: ValidationContext) -> Hits:
    waypoints = context.each(Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
    return (at(k) for k, item in waypoints if at_zero(item))


@checks("ardupilot-frame-mission")
def _(context: ValidationContext) -> Hits:
    return (at(k) for k, item in context.each(*FLOWN_TO) if item.frame == Frame.MISSION)


@checks("ardupilot-command-skipped")
def _(context: ValidationContext) -> Hits:
    return (at(k) for k, _ in context.each(*_SKIPPED[context.vehicle.kind]))


@checks("ardupilot-terrain")
def _(context: ValidationContext) -> Hits:
    above = [index for index, item in context.each(*FLOWN_TO) if item.frame in ABOVE_TERRAIN]
    off = ", and TERRAIN_ENABLE is 0" if context.vehicle.value("terrain_enable") == 0 else ""
    if above:
        yield at(above[0], count=len(above), off=off)


@checks("altitude-rounded")
def _(context: ValidationContext) -> Hits:
    pairs = [(k, item.z, kept.z) for k, item, kept in context.stored if item.command in FLOWN_TO]
    changed = [(k, kept) for k, up, kept in pairs if abs(kept - up) > 1e-4 * max(1.0, abs(up))]
    for index, kept in changed[:1]:
        yield at(index, kept=kept, more=f", and so in {len(changed)} items" if changed[1:] else "")
