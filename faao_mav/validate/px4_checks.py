"""PX4's checks of an uploaded mission: it acknowledges the mission first and then rejects it."""

import math
from collections.abc import Iterator

from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.command import FLOWN_TO, LANDINGS, TAKEOFFS, Command, Frame
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Issue, Rules

RULES = Rules("px4")

_CHECKER = "PX4 1.16 FeasibilityChecker::"
_CONDITION_GATE = 4501
_CONDITIONS = (Command.CONDITION_DELAY, Command.CONDITION_DISTANCE)
_VTOL = (Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, 3000)
_SINGLE = 1e-3
"""The least height above home, m, that is above 0 to PX4: it adds home's height above the sea, in
single precision. A billionth was refused."""

_FLIES = FLOWN_TO | {_CONDITION_GATE, Command.NAV_RETURN_TO_LAUNCH, 187, 211, 42600}
"""What checkTakeoff counts as flying: actuators, grippers and winches as well."""

RULES.error_where(
    "px4-command-rejected",
    "PX4 acknowledges this command on upload and then rejects the mission",
    "remove the item; to wait, use a hold (param1 of a waypoint) or NAV_DELAY",
    f"{_CHECKER}checkMissionItemValidity; measured on 1.16.1",
    lambda context: (k for k, item in context.each(*_CONDITIONS) if item.frame == Frame.MISSION),
)
RULES.error_where(
    "px4-vtol-items",
    "an item for VTOL aircraft only",
    "use NAV_TAKEOFF and NAV_LAND",
    f"{_CHECKER}checkItemsFitToVehicleType; measured on 1.16.1",
    lambda context: (k for k, _ in context.each(*_VTOL)),
)
RULES.error_where(
    "px4-starts-with-land",
    "the mission starts with a landing",
    "put a take-off and waypoints before it",
    f"{_CHECKER}checkMissionItemValidity, checkLandPatternValidity",
    lambda context: (k for k, _ in context.each(*LANDINGS) if k == 0),
)


@RULES.error("px4-takeoff-first", f"{_CHECKER}checkTakeoff; measured on 1.16.1")
def _takeoff_first(context: ValidationContext) -> Iterator[Issue]:
    """A take-off is not the first item that flies."""
    before = next((k for k, item in enumerate(context.items) if item.command in _FLIES), 0)
    for index, _ in context.each(*TAKEOFFS):
        if before < index:
            second = context.items[before].command in TAKEOFFS
            told = "a second take-off, after" if second else "the take-off comes after"
            do = "remove it" if second else f"move it before item {before + 1}"
            yield Issue(index, f"{told} item {before + 1}", do)


RULES.error_where(
    "px4-takeoff-altitude",
    "a take-off to home's height or below",
    "give the take-off an altitude above 0",
    f"{_CHECKER}checkTakeoff; measured on 1.16.1",
    lambda context: ((p.index, p.up) for p in context.places_of(TAKEOFFS) if p.up < _SINGLE),
    "the take-off ends {:g} m above home",
)


@RULES.warning("px4-takeoff-low", "PX4 before 1.15 FeasibilityChecker; MIS_TAKEOFF_ALT")
def _takeoff_low(context: ValidationContext) -> Iterator[Issue]:
    """A take-off lower than older PX4 versions accept or any version flies."""
    vehicle = context.vehicle
    radius, height = vehicle.name_of("acceptance_radius"), vehicle.name_of("takeoff_height")
    old, first = vehicle.value("acceptance_radius") + 1, vehicle.value("takeoff_height")
    for place in context.places_of(TAKEOFFS):
        if 0 < place.up < max(old, first):
            told = f"the take-off ends {place.up:g} m above home; older versions want {old:g} m "
            why = f"({radius} + 1 m), and all first climb to {first:g} m ({height})"
            yield Issue(place.index, told + why, f"take off to {max(old, first):g} m or more")


@RULES.error(
    "px4-takeoff-or-landing-missing", f"{_CHECKER}checkTakeoffLandAvailable; measured on 1.16.1"
)
def _takeoff_landing(context: ValidationContext) -> Iterator[Issue]:
    """MIS_TKO_LAND_REQ asks for a take-off or landing that the mission does not have."""
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
        told = f"MIS_TKO_LAND_REQ is {required} and asks for {what}"
        add = Command.NAV_LAND if takeoff else Command.NAV_TAKEOFF
        yield Issue(None, told, f"add {add.name}, or change MIS_TKO_LAND_REQ")


@RULES.warning(
    "px4-first-waypoint-far",
    f"{_CHECKER}checkHorizontalDistanceToFirstWaypoint",
    "check the coordinates and the home position, or raise MIS_DIST_1WP",
)
def _first_far(context: ValidationContext) -> Iterator[Issue]:
    """The first item is farther from home than MIS_DIST_1WP."""
    limit = context.vehicle.value("first_waypoint_distance")
    for first in context.places[:1] if context.home is not None else ():
        if 0 < limit <= first.from_origin:
            told = f"the first item is {first.from_origin:.0f} m from home"
            yield Issue(first.index, f"{told}, MIS_DIST_1WP is {limit:g} m")


_APPROACH = "PX4 1.16 FeasibilityChecker::checkFixedWindLandApproach"
_SPARE_ANGLE = 0.1
"""How much steeper than FW_LND_ANG PX4 lets an approach be, degrees. PX4's own."""

_ENTRANCES = (Command.NAV_WAYPOINT, Command.NAV_LOITER_TO_ALT)


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


@RULES.error(
    "px4-approach-entrance",
    _APPROACH,
    "put a NAV_WAYPOINT or NAV_LOITER_TO_ALT before the landing",
    kind="plane",
)
def _entrance(context: ValidationContext) -> Iterator[Issue]:
    """A landing approach starts neither at a waypoint nor at a loiter to altitude."""
    for index, _ in context.each(Command.NAV_LAND):
        before = context.items[index - 1].command if index else Command.NAV_WAYPOINT
        if before in FLOWN_TO and before not in _ENTRANCES:
            yield Issue(index, f"the item before the landing is {name_of(before)}")


RULES.error_where(
    "px4-approach-below",
    "a landing approach starts below the landing point",
    "raise the item before the landing",
    _APPROACH,
    lambda context: ((k, -above) for k, above, _, _ in _approaches(context) if above <= 0),
    "the approach starts {:g} m below the landing",
    kind="plane",
)
RULES.error_where(
    "px4-approach-orbit",
    "a landing point lies inside the orbit that its approach starts from",
    "move the landing point out of the orbit, or make the orbit smaller",
    _APPROACH,
    lambda context: ((k, d, r) for k, _, d, r in _approaches(context) if 0 < r >= d),
    "the landing is {:.0f} m from the centre of an orbit of {:g} m",
    kind="plane",
)


@RULES.error("px4-approach-steep", _APPROACH, kind="plane")
def _steep(context: ValidationContext) -> Iterator[Issue]:
    """A landing approach is steeper than FW_LND_ANG."""
    angle = math.degrees(context.vehicle.value("landing_angle"))
    slope = math.tan(math.radians(angle + _SPARE_ANGLE))
    for index, above, away, radius in _approaches(context):
        if context.items[index - 1].command not in _ENTRANCES or away <= radius:
            continue
        way = math.sqrt(away**2 - radius**2)
        if above > slope * way:
            told = f"{above:g} m of descent in {way:.0f} m; FW_LND_ANG is {angle:g} degrees"
            most, least = slope * way, math.ceil(above / slope)
            yield Issue(index, told, f"start at most {most:.0f} m above it, or {least} m away")


@RULES.error(
    "px4-land-start", "PX4 1.16 FeasibilityChecker::checkLandPatternValidity", kind="plane"
)
def _land_start(context: ValidationContext) -> Iterator[Issue]:
    """DO_LAND_START is there twice, before a return to launch, or without a landing after it."""
    starts = [index for index, _ in context.each(Command.DO_LAND_START)]
    for second in starts[1:]:
        told = f"a second DO_LAND_START, after item {starts[0] + 1}"
        yield Issue(second, told, "remove it")
    for start in starts[:1]:
        for index, _ in context.each(Command.NAV_RETURN_TO_LAUNCH):
            if index > start:
                told = f"a return to launch after the DO_LAND_START of item {start + 1}"
                yield Issue(index, told, "remove one of both")
        # The landing's approach, the item before it, may be the DO_LAND_START itself.
        if not any(index - 1 >= start for index, _ in context.each(*LANDINGS)):
            told = "there is no landing after DO_LAND_START"
            yield Issue(start, told, "add NAV_LAND, or remove it")
