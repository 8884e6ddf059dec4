"""What ArduPilot does not arm or start for, and what it flies in a way that nobody expects."""

import math
from itertools import pairwise

from faao_mav.mission.command import ABOVE_TERRAIN, FLOWN_TO, TAKEOFFS, Command, Frame
from faao_mav.validate.context import ValidationContext, at_zero
from faao_mav.validate.rule import Hits, checks, hit

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

RALLY_BIT = 32  # The bit of ARMING_MIS_ITEMS that asks for a rally point.

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


@checks
def _arming(context: ValidationContext) -> Hits:
    """What arming asks for."""
    bits = int(context.value("arming_items", 0))
    for bit, command in _REQUIRED.items():
        if bits & bit and not any(context.each(command)):
            yield hit("ardupilot-required-item", bits=bits, bit=bit, name=command.name)
    above = [k for k, item in context.each(*FLOWN_TO) if item.frame in ABOVE_TERRAIN]
    off = ", and TERRAIN_ENABLE is 0" if context.value("terrain_enable") == 0 else ""
    if above:
        yield hit("ardupilot-terrain", above[0], count=len(above), off=off)
    if context.value("return_lands") == 0:
        yield from (hit("ardupilot-land-start", k) for k, _ in context.each(Command.DO_LAND_START))
    if not bits & RALLY_BIT or context.frame is None:
        return
    limit = context.value("rally_limit")
    places = (context.frame.to_local(p.latitude, p.longitude) for p in context.mission.rally)
    nearest = min((math.hypot(*place) for place in places), default=math.inf)
    if not nearest < (limit or math.inf):
        within = f" within {limit:g} m" if limit else ""
        there = f"the nearest is {nearest:.0f} m away" if nearest < math.inf else "there is none"
        yield hit("ardupilot-required-rally", bits=bits, within=within, there=there)


@checks
def _takeoff(context: ValidationContext) -> Hits:
    """How the mission begins, and home that is moved after that."""
    takeoffs = [k for k, _ in context.each(*_TAKEOFFS.get(context.vehicle.kind, ()))]
    does, before = _ON_GROUND.get(context.vehicle.kind, ""), 0
    if context.items and not takeoffs:
        air = context.airborne
        yield hit("ardupilot-begins-in-the-air" if air else "ardupilot-no-takeoff", does=does)
    if takeoffs and not context.airborne:
        before = next(k + 1 for k, command in context.flying if command != Command.NAV_DELAY)
    if 0 < before <= min(takeoffs, default=0):
        yield hit("ardupilot-takeoff-first", takeoffs[0], before=before, does=does)
    for k, item in context.each(Command.DO_SET_HOME):
        same_height = item.params[0] == 0 and abs(context.height(item)) < _SAME_HEIGHT
        if not same_height and (context.airborne or min(takeoffs, default=k) < k):
            yield hit("ardupilot-set-home", k)


@checks
def _in_order(context: ValidationContext) -> Hits:
    """Items that do not go with the one before them."""
    for (before, first), (k, second) in pairwise(context.flying):
        if (first, second) == (Command.NAV_SPLINE_WAYPOINT, Command.NAV_DELAY):
            yield hit("ardupilot-spline-delay", k, before=before + 1)
        if (first, second) == (Command.NAV_TAKEOFF, Command.NAV_LAND):
            yield hit("ardupilot-land-approach", k)
    *_, (_, first), (last, second) = [(-1, 0), (-1, 0), *context.flying]
    if second == Command.NAV_SPLINE_WAYPOINT != first:
        yield hit("ardupilot-spline-last", last)


@checks
def _items(context: ValidationContext) -> Hits:
    """Items by themselves."""
    for k, item in enumerate(context.items):
        if item.command == Command.NAV_GUIDED_ENABLE and item.params[0] > 0:
            yield hit("ardupilot-guided", k)
        if item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT) and at_zero(item):
            yield hit("ardupilot-stays", k)
        if item.command in FLOWN_TO and item.frame == Frame.MISSION:
            yield hit("ardupilot-frame-mission", k)
        if item.command in _SKIPPED.get(context.vehicle.kind, ()):
            yield hit("ardupilot-command-skipped", k)
    pairs = [(k, item.z, kept.z) for k, item, kept in context.stored if item.command in FLOWN_TO]
    changed = [(k, kept) for k, up, kept in pairs if abs(kept - up) > 1e-4 * max(1.0, abs(up))]
    for k, kept in changed[:1]:
        more = f", and so in {len(changed)} items" if changed[1:] else ""
        yield hit("altitude-rounded", k, kept=kept, more=more)
