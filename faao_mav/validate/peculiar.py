"""What only one autopilot refuses, does not arm or start for, or flies as nobody expects."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.autopilot.dialect import name_of
from faao_mav.autopilot.px4 import CONDITIONS, FLIES, LEAST_TAKEOFF
from faao_mav.files import table
from faao_mav.mission.command import ABOVE_TERRAIN, FLOWN_TO, LANDINGS, TAKEOFFS, Command, Frame
from faao_mav.mission.item import MissionItem
from faao_mav.validate.context import HOME, NAV_LAST, Straight, ValidationContext, at_zero
from faao_mav.validate.rule import Hits, checks, hit, threshold

_SKIPPED = {
    kind: {
        int(row["command"]) for row in table("autopilot/commands.tsv") if kind in row["skipped by"]
    }
    for kind in ("copter", "plane")
}
_REQUIRED = {
    int(row["arming"]): Command(int(row["command"]))
    for row in sorted(table("autopilot/commands.tsv"), key=lambda row: int(row["arming"] or 0))
    if row["arming"]
}
_RALLY_BIT = 32  # The bit of ARMING_MIS_ITEMS that asks for a rally point.

_TAKEOFFS = {"copter": TAKEOFFS, "plane": {Command.NAV_TAKEOFF}}
"""What gets the aircraft off the ground. A plane without vertical rotors stays there for the other.
Measured."""

_LEFT_OUT = {
    94: "descends until the ground has its load",
    207: "turns the fence off, or its floor",
    208: "releases the parachute",
    218: "works a switch, perhaps that of the mode, the fence or the motors",
    42702: "leaves the aircraft to a script",
    42703: "holds an attitude, whatever way that is",
}
_HARMLESS = {207: (1,), 208: (0, 1), 218: (0, 9, 15, 19, 27, 28, 34, 35, 36, 66, 67)}
"""What commands do that is not predicted, unless param1 is harmless: the fence turned on, the
parachute made ready or not, the switch of camera, sprayer, gripper, mount or relay. Source:
ArduPilot 4.7 AC_Fence, AP_Parachute; its documentation, "Auxiliary functions"."""

_ENTRANCES = (Command.NAV_WAYPOINT, Command.NAV_LOITER_TO_ALT)  # What an approach may start from.


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
    if not bits & _RALLY_BIT or context.frame is None:
        return
    limit = context.value("rally_limit")
    places = (context.frame.to_local(p.latitude, p.longitude) for p in context.mission.rally)
    nearest = min((math.hypot(*place) for place in places), default=math.inf)
    if not nearest < (limit or math.inf):
        within = f" within {limit:g} m" if limit else ""
        there = f"the nearest is {nearest:.0f} m away" if nearest < math.inf else "there is none"
        yield hit("ardupilot-required-rally", bits=bits, bit=_RALLY_BIT, within=within, there=there)


@checks
def _ardupilot_takeoff(context: ValidationContext) -> Hits:
    """How the mission begins, and home that is moved after that."""
    takeoffs, before = [k for k, _ in context.each(*_TAKEOFFS.get(context.vehicle.kind, ()))], 0
    if context.items and not takeoffs:
        air = context.airborne
        yield hit("ardupilot-begins-in-the-air" if air else "ardupilot-no-takeoff")
    if takeoffs and not context.airborne:
        before = next(k + 1 for k, command in context.flying if command != Command.NAV_DELAY)
    if 0 < before <= min(takeoffs, default=0):
        yield hit("ardupilot-takeoff-first", takeoffs[0], before=before)
    for k, item in context.each(Command.DO_SET_HOME):
        same_height = item.params[0] == 0 and abs(context.height(item)) < threshold.home_moved
        counts = not same_height and (context.airborne or min(takeoffs, default=k) < k)
        if counts:
            yield hit("ardupilot-set-home", k)
        if counts or _left_out(context, item):
            yield hit("px4-set-home", k)


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
def _alone(context: ValidationContext) -> Hits:
    """Items by themselves."""
    for k, item in enumerate(context.items):
        command, in_mission = item.command, item.frame == Frame.MISSION
        allowed, mode = (0, 1, 2) if in_mission else (0, 3), item.params[0]
        taken = not math.isnan(mode) and math.trunc(mode) in allowed
        if command == Command.NAV_GUIDED_ENABLE and mode > 0:
            yield hit("ardupilot-guided", k)
        if command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT) and at_zero(item):
            yield hit("ardupilot-stays", k)
        if command in FLOWN_TO and in_mission:
            yield hit("ardupilot-frame-mission", k)
        if command in _SKIPPED.get(context.vehicle.kind, ()):
            yield hit("ardupilot-command-skipped", k)
        elif does := _left_out(context, item):
            yield hit("ardupilot-left-out", k, does=does)
        if command in CONDITIONS and in_mission:
            yield hit("px4-command-rejected", k)
        if command in (Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, 3000):
            yield hit("px4-vtol-items", k)
        if command in FLOWN_TO and at_zero(item) and not in_mission:
            yield hit("px4-null-island", k)
        if command in FLOWN_TO and math.isnan(item.z):
            yield hit("px4-altitude-missing", k)
        if not item.autocontinue and k + 1 < len(context.items):
            yield hit("px4-stops", k)
        if command in (80, Command.DO_SET_ROI) and not taken:
            yield hit("px4-roi", k, allowed=", ".join(map(str, allowed)))
    pairs = [(k, item.z, kept.z) for k, item, kept in context.stored if item.command in FLOWN_TO]
    changed = [(k, kept) for k, up, kept in pairs if abs(kept - up) > 1e-4 * max(1.0, abs(up))]
    for k, kept in changed[:1]:
        more = f", and so in {len(changed)} items" if changed[1:] else ""
        yield hit("altitude-rounded", k, kept=kept, more=more)


def _left_out(context: ValidationContext, item: MissionItem) -> str:
    """Return what is done at `item` that is neither predicted nor checked, "" for nothing."""
    how, frame = item.params[0], context.frame
    if item.command == Command.NAV_DELAY and not how > 0 and item.params[1:] != (-1, -1, -1):
        return "waits for a time of the day (UTC)"
    if item.command == Command.DO_SET_HOME and how != 1 and not at_zero(item) and frame is not None:
        moved = math.hypot(*frame.to_local(item.x, item.y))
        return f"moves home by {moved:.0f} m" if moved > threshold.home_moved else ""
    harmless = how in _HARMLESS.get(item.command, ())
    return "" if harmless else _LEFT_OUT.get(item.command, "")


@checks
def _whole(context: ValidationContext) -> Hits:
    """The mission as a whole, its jumps, and what beside it is to be stored."""
    if context.items and context.items[0].command in LANDINGS:
        yield hit("px4-starts-with-land", 0)
    if context.items and not any(context.each(*FLOWN_TO)):
        yield hit("px4-nothing-to-fly")
    limit = context.value("first_waypoint_distance")
    for place in context.places[:1]:
        if context.home is not None and 0 < limit <= place.from_origin:
            yield hit("px4-first-waypoint-far", place.index, place=place, limit=limit)
    for k, item, target in context.jumps:
        # A jump to itself is flown.
        between = context.items[target:k] if target is not None else ()
        flies = any(each.command <= NAV_LAST for each in between)
        if item.command == Command.DO_JUMP and item.params[1] != 0 and between and not flies:
            yield hit("jump-in-place", k, target=(target or 0) + 1)
    fence, dialect = context.mission.fence, context.vehicle.type.dialect
    vertices = sum(len(polygon.vertices) for polygon in fence.polygons) + len(fence.circles)
    for count, most, what in (
        (vertices, dialect.fence_rows, "fence vertices"),
        (len(context.mission.rally), dialect.rally_rows, "rally points"),
    ):
        if count > most:
            yield hit("px4-fence-size", count=count, limit=most, what=what)


@checks
def _px4_takeoff(context: ValidationContext) -> Hits:
    """Where the take-off stands, where it leads, and whether there has to be one."""
    takeoffs = [k for k, _ in context.each(*TAKEOFFS)]
    before = next((k for k, item in enumerate(context.items) if item.command in FLIES), 0)
    which, instead = "the take-off comes", f"move it before item {before + 1}"
    if before in takeoffs:
        which, instead = "a second take-off,", "remove it"
    for k in takeoffs:
        if before < k:
            yield hit("px4-takeoff-first", k, which=which, before=before + 1, instead=instead)
    radius, radius_name = context.parameter("acceptance_radius")
    first, height_name = context.parameter("takeoff_height")
    told = {"radius": radius_name, "height": height_name, "old": radius + 1, "first": first}
    least = max(radius + 1, first)
    for place in (each for each in context.places if each.index in takeoffs):
        away = context.home is not None and place.from_origin > radius
        if place.up < LEAST_TAKEOFF:
            yield hit("px4-takeoff-altitude", place.index, place=place)
        if 0 < place.up < least:
            yield hit("px4-takeoff-low", place.index, place=place, least=least, **told)
        if away and context.items[place.index].command == Command.NAV_TAKEOFF:
            yield hit("px4-takeoff-elsewhere", place.index, place=place)
    required = int(context.value("takeoff_land_required", 0))
    has = {"NAV_TAKEOFF": bool(takeoffs), "NAV_LAND": any(context.each(Command.NAV_LAND))}
    both = list(has)
    # 4 asks for both or neither; so does 5 on the ground, in the air for what 2 does
    asked = {1: both[:1], 2: both[1:], 3: both} | dict.fromkeys((4, 5), both * any(has.values()))
    if missing := " and ".join(name for name in asked.get(required, ()) if not has[name]):
        yield hit("px4-takeoff-or-landing-missing", required=required, missing=missing)


@checks
def _landing(context: ValidationContext) -> Hits:
    """The approach to a landing: it starts above it, outside its own orbit, and is not steep."""
    angle = math.degrees(context.value("landing_angle"))
    slope = math.tan(math.radians(angle + threshold.spare_angle))
    by_index = {place.index: place for place in context.places}
    for k, _ in context.each(Command.NAV_LAND):
        item = context.items[max(k - 1, 0)]
        if k and item.command in FLOWN_TO and item.command not in _ENTRANCES:
            yield hit("px4-approach-entrance", k, name=name_of(item.command))
        if k - 1 not in by_index or k not in by_index:
            continue
        entrance, landing = by_index[k - 1], by_index[k]
        orbits = item.command == Command.NAV_LOITER_TO_ALT and not math.isnan(item.params[1])
        radius, above = abs(item.params[1]) if orbits else 0.0, entrance.up - landing.up
        away = abs(entrance.place - landing.place)
        way = math.sqrt(max(away**2 - radius**2, 0.0))
        if above <= 0:
            yield hit("px4-approach-below", k, below=-above)
        if 0 < radius >= away:
            yield hit("px4-approach-orbit", k, away=away, radius=radius)
        elif item.command in _ENTRANCES and away > 0 and above > slope * way:
            steep, most, least = math.atan2(above, way), slope * way, math.ceil(above / slope)
            told = {"above": above, "way": way, "steep": math.degrees(steep), "angle": angle}
            yield hit("px4-approach-steep", k, **told, most=most, least=least)


@checks
def _land_start(context: ValidationContext) -> Hits:
    starts = [k for k, _ in context.each(Command.DO_LAND_START)]
    for second in starts[1:]:
        what = f"a second DO_LAND_START, after item {starts[0] + 1}"
        yield hit("px4-land-start", second, what=what, instead="remove it")
    for start in starts[:1]:
        what = f"a return to launch after the DO_LAND_START of item {start + 1}"
        for k, _ in context.each(Command.NAV_RETURN_TO_LAUNCH):
            if k > start:
                yield hit("px4-land-start", k, what=what, instead="remove one of both")
        # The landing's approach, the item before it, may be the DO_LAND_START itself.
        if not any(k - 1 >= start for k, _ in context.each(*LANDINGS)):
            what = "there is no landing after DO_LAND_START"
            yield hit("px4-land-start", start, what=what, instead="add NAV_LAND, or remove it")


def _radii(context: ValidationContext) -> Iterator[tuple[Straight, float]]:
    """Yield each leg to a waypoint, with the acceptance radius there, m."""
    default = context.value("acceptance_radius")
    for leg in context.legs:
        item = context.items[leg.index]
        if item.command == Command.NAV_WAYPOINT and not leg.jump:
            yield leg, item.params[1] if item.params[1] > 0 else default


@checks
def _radius(context: ValidationContext) -> Hits:
    """Acceptance radii beside the legs and beside each other."""
    for leg, radius in _radii(context):
        held = context.items[leg.index].params[0] > 0  # it is held at all the same
        if leg.start.index != HOME and 0.05 <= leg.length <= radius and not held:
            yield hit("px4-radius-covers-leg", leg.index, leg=leg, radius=radius)
        if radius < threshold.smallest_radius:
            yield hit("px4-radius-small", leg.index, radius=radius)
    for (leg, radius), (onward, smaller) in pairwise(_radii(context)):
        passed = leg.end is onward.start and not context.items[leg.index].params[0] > 0
        if (
            passed
            and radius > smaller + threshold.narrower
            and leg.turn(onward) > math.radians(threshold.straight)
        ):
            told = {"radius": radius, "smaller": smaller, "onward": onward.end}
            yield hit("px4-radius-narrows", leg.index, **told)
