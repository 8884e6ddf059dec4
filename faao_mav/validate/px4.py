"""What PX4 rejects after it has acknowledged a mission, and what it flies unexpectedly."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.command import FLOWN_TO, LANDINGS, TAKEOFFS, Command, Frame
from faao_mav.validate.context import NAV_LAST, ValidationContext, at_zero
from faao_mav.validate.rule import Checks, Hits, at
from faao_mav.validate.straight import HOME, Straight

checks = Checks()

_SINGLE = 1e-3
"""The least height above home, m, that is above 0 to PX4: it adds home's height above the sea, in
single precision. A billionth was refused."""

_FLIES = FLOWN_TO | {Command.NAV_RETURN_TO_LAUNCH, 187, 211, 4501, 42600}
"""What checkTakeoff counts as flying: actuators, grippers, winches and gates as well."""

_SPARE_ANGLE = 0.1
"""How much steeper than FW_LND_ANG PX4 lets an approach be, degrees. PX4's own."""

_ENTRANCES = (Command.NAV_WAYPOINT, Command.NAV_LOITER_TO_ALT)
"""What a landing approach may start from."""

SMALLEST = 1.0
"""The radius, m, below which an aircraft may miss it. Measured: it is off by up to 0.5 m."""

_NARROWER = 0.5
"""How much smaller, m, the next radius may be: the aircraft flies on that far while it switches."""

_STRAIGHT = math.radians(5)
"""The turn up to which the way back to a waypoint is no detour, rad. Chosen."""


@checks("px4-command-rejected")
def _(context: ValidationContext) -> Hits:
    conditions = context.each(Command.CONDITION_DELAY, Command.CONDITION_DISTANCE)
    return (at(k) for k, item in conditions if item.frame == Frame.MISSION)


@checks("px4-vtol-items")
def _(context: ValidationContext) -> Hits:
    vtol = (Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, 3000)
    return (at(k) for k, _ in context.each(*vtol))


@checks("px4-starts-with-land")
def _(context: ValidationContext) -> Hits:
    return (at(k) for k, _ in context.each(*LANDINGS) if k == 0)


@checks("px4-takeoff-first")
def _(context: ValidationContext) -> Hits:
    before = next((k for k, item in enumerate(context.items) if item.command in _FLIES), 0)
    which, instead = "the take-off comes", f"move it before item {before + 1}"
    if any(k == before for k, _ in context.each(*TAKEOFFS)):
        which, instead = "a second take-off,", "remove it"
    for index, _ in context.each(*TAKEOFFS):
        if before < index:
            yield at(index, which=which, before=before + 1, instead=instead)


@checks("px4-takeoff-altitude")
def _(context: ValidationContext) -> Hits:
    return (at(p.index, place=p) for p in context.places_of(TAKEOFFS) if p.up < _SINGLE)


@checks("px4-takeoff-low")
def _(context: ValidationContext) -> Hits:
    radius, radius_name = context.parameter("acceptance_radius")
    first, height_name = context.parameter("takeoff_height")
    names, least = {"radius": radius_name, "height": height_name}, max(radius + 1, first)
    for place in context.places_of(TAKEOFFS):
        if 0 < place.up < least:
            yield at(place.index, place=place, old=radius + 1, first=first, least=least, **names)


@checks("px4-takeoff-or-landing-missing")
def _(context: ValidationContext) -> Hits:
    required = int(context.vehicle.value("takeoff_land_required"))
    takeoff, landing = any(context.each(*TAKEOFFS)), any(context.each(Command.NAV_LAND))
    both_or_none = "both a take-off and a landing, or neither", takeoff == landing
    what, there = {
        1: ("a take-off", takeoff),
        2: ("a landing", landing),
        3: ("a take-off and a landing", takeoff and landing),
        4: both_or_none,
        5: both_or_none,  # on the ground; in the air 2
    }.get(required, ("", True))
    if not there:
        missing = Command.NAV_LAND if takeoff else Command.NAV_TAKEOFF
        yield at(required=required, what=what, missing=missing.name)


@checks("px4-first-waypoint-far")
def _(context: ValidationContext) -> Hits:
    limit = context.vehicle.value("first_waypoint_distance")
    first = context.places[:1] if context.home is not None else ()
    return (at(p.index, place=p, limit=limit) for p in first if 0 < limit <= p.from_origin)


@checks("px4-approach-entrance")
def _(context: ValidationContext) -> Hits:
    for index, _ in context.each(Command.NAV_LAND):
        before = context.items[index - 1].command if index else Command.NAV_WAYPOINT
        if before in FLOWN_TO and before not in _ENTRANCES:
            yield at(index, name=name_of(before))


def _approaches(context: ValidationContext) -> Iterator[tuple[int, float, float, float]]:
    """Yield the index of each landing and the item before it: m above, m away, m of its orbit."""
    by_index = {place.index: place for place in context.places}
    for landing in context.places_of({Command.NAV_LAND}):
        if (entrance := by_index.get(landing.index - 1)) is not None:
            away = math.hypot(entrance.east - landing.east, entrance.north - landing.north)
            item = context.items[entrance.index]
            orbits = item.command == Command.NAV_LOITER_TO_ALT and not math.isnan(item.params[1])
            radius = abs(item.params[1]) if orbits else 0.0
            yield landing.index, entrance.up - landing.up, away, radius


@checks("px4-approach-below")
def _(context: ValidationContext) -> Hits:
    return (at(k, below=-above) for k, above, _, _ in _approaches(context) if above <= 0)


@checks("px4-approach-orbit")
def _(context: ValidationContext) -> Hits:
    found = ((k, away, radius) for k, _, away, radius in _approaches(context))
    return (at(k, away=away, radius=radius) for k, away, radius in found if 0 < radius >= away)


@checks("px4-approach-steep")
def _(context: ValidationContext) -> Hits:
    angle = math.degrees(context.vehicle.value("landing_angle"))
    slope = math.tan(math.radians(angle + _SPARE_ANGLE))
    for index, above, away, radius in _approaches(context):
        if context.items[index - 1].command not in _ENTRANCES or away <= radius:
            continue
        way = math.sqrt(away**2 - radius**2)
        if above > slope * way:
            steep, most, least = math.atan2(above, way), slope * way, math.ceil(above / slope)
            told = {"above": above, "way": way, "steep": math.degrees(steep), "angle": angle}
            yield at(index, **told, most=most, least=least)


@checks("px4-land-start")
def _(context: ValidationContext) -> Hits:
    starts = [index for index, _ in context.each(Command.DO_LAND_START)]
    for second in starts[1:]:
        what = f"a second DO_LAND_START, after item {starts[0] + 1}"
        yield at(second, what=what, instead="remove it")
    for start in starts[:1]:
        what = f"a return to launch after the DO_LAND_START of item {start + 1}"
        for index, _ in context.each(Command.NAV_RETURN_TO_LAUNCH):
            if index > start:
                yield at(index, what=what, instead="remove one of both")
        # The landing's approach, the item before it, may be the DO_LAND_START itself.
        if not any(index - 1 >= start for index, _ in context.each(*LANDINGS)):
            what = "there is no landing after DO_LAND_START"
            yield at(start, what=what, instead="add NAV_LAND, or remove it")


@checks("px4-null-island")
def _(context: ValidationContext) -> Hits:
    placed = ((k, item) for k, item in context.each(*FLOWN_TO) if item.frame != Frame.MISSION)
    return (at(k) for k, item in placed if at_zero(item))


@checks("px4-altitude-missing")
def _(context: ValidationContext) -> Hits:
    return (at(k) for k, item in context.each(*FLOWN_TO) if math.isnan(item.z))


@checks("px4-stops")
def _(context: ValidationContext) -> Hits:
    return (at(k) for k, item in enumerate(context.items[:-1]) if not item.autocontinue)


@checks("jump-in-place")
def _(context: ValidationContext) -> Hits:
    for index, item, target in context.jumps:
        # A jump to itself is flown.
        if item.command != Command.DO_JUMP or item.params[1] == 0 or target is None:
            continue
        between = context.items[target:index]
        if between and all(each.command > NAV_LAST for each in between):
            yield at(index, target=target + 1)


@checks("px4-nothing-to-fly")
def _(context: ValidationContext) -> Hits:
    if context.items and not any(context.each(*FLOWN_TO)):
        yield at()


@checks("px4-takeoff-elsewhere")
def _(context: ValidationContext) -> Hits:
    radius = context.vehicle.value("acceptance_radius")
    takeoffs = context.places_of({Command.NAV_TAKEOFF}) if context.home is not None else ()
    return (at(place.index, place=place) for place in takeoffs if place.from_origin > radius)


@checks("px4-roi")
def _(context: ValidationContext) -> Hits:
    for index, item in context.each(80, Command.DO_SET_ROI):
        allowed, mode = (0, 1, 2) if item.frame == Frame.MISSION else (0, 3), item.params[0]
        if math.isnan(mode) or math.trunc(mode) not in allowed:
            yield at(index, allowed=", ".join(map(str, allowed)))


@checks("px4-fence-size")
def _(context: ValidationContext) -> Hits:
    fence, dialect = context.mission.fence, context.vehicle.type.dialect
    vertices = sum(len(polygon.vertices) for polygon in fence.polygons) + len(fence.circles)
    for count, limit, what in (
        (vertices, dialect.fence_rows, "fence vertices"),
        (len(context.mission.rally), dialect.rally_rows, "rally points"),
    ):
        if count > limit:
            yield at(count=count, limit=limit, what=what)


def _radii(context: ValidationContext) -> Iterator[tuple[Straight, float]]:
    """Yield each leg to a waypoint, with the acceptance radius there, m."""
    default = context.vehicle.value("acceptance_radius")
    for leg in context.legs:
        item = context.items[leg.index]
        if item.command == Command.NAV_WAYPOINT and not leg.jump:
            yield leg, item.params[1] if item.params[1] > 0 else default


@checks("px4-radius-covers-leg")
def _(context: ValidationContext) -> Hits:
    for leg, radius in _radii(context):
        held = context.items[leg.index].params[0] > 0  # it is held at all the same
        if leg.start.index != HOME and 0.05 <= leg.length <= radius and not held:
            yield at(leg.index, leg=leg, radius=radius)


@checks("px4-radius-small")
def _(context: ValidationContext) -> Hits:
    return (at(leg.index, radius=r) for leg, r in _radii(context) if r < SMALLEST)


@checks("px4-radius-narrows")
def _(context: ValidationContext) -> Hits:
    for (leg, radius), (onward, smaller) in pairwise(_radii(context)):
        passed = leg.end is onward.start and not context.items[leg.index].params[0] > 0
        if passed and radius > smaller + _NARROWER and leg.turn(onward) > _STRAIGHT:
            yield at(leg.index, radius=radius, smaller=smaller, onward=onward.end)
