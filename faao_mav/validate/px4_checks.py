"""PX4's checks of an uploaded mission: it acknowledges the mission first and then rejects it."""

import math
from collections.abc import Iterator

from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.command import FLOWN_TO, LANDINGS, TAKEOFFS, Command, Frame
from faao_mav.validate.context import ValidationContext, number
from faao_mav.validate.rule import Issue, Level, Rules
from faao_mav.validate.straight import PlacedItem

RULES = Rules("px4")

_CHECKER = "PX4 1.16 FeasibilityChecker::"
_CONDITION_GATE = 4501
_SINGLE = 1e-3
"""The least height above home, m, that is above 0 to PX4: it adds home's height above the sea, in
single precision. A billionth was refused."""

_FLIES = FLOWN_TO | {_CONDITION_GATE, Command.NAV_RETURN_TO_LAUNCH, 187, 211, 42600}
"""What checkTakeoff counts as flying: actuators, grippers and winches as well."""

RULES.commands(
    Level.ERROR,
    "px4-command-rejected",
    "PX4 acknowledges this command on upload and then rejects the mission",
    f"{_CHECKER}checkMissionItemValidity; measured on 1.16.1",
    (Command.CONDITION_DELAY, Command.CONDITION_DISTANCE),
    "{name} is acknowledged on upload, then the mission is rejected",
    "remove the item; to wait, use a hold (param1 of a waypoint) or NAV_DELAY",
    where=lambda item: item.frame == Frame.MISSION,
)
RULES.commands(
    Level.ERROR,
    "px4-vtol-items",
    "items for VTOL aircraft only",
    f"{_CHECKER}checkItemsFitToVehicleType; measured on 1.16.1",
    (Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, 3000),
    "{name} is for VTOL aircraft, this is a {kind}",
    "use NAV_TAKEOFF and NAV_LAND",
)


@RULES.error(
    "px4-starts-with-land", f"{_CHECKER}checkMissionItemValidity, checkLandPatternValidity"
)
def _starts_with_land(context: ValidationContext) -> Iterator[Issue]:
    """The mission starts with a landing."""
    if context.items and context.items[0].command in LANDINGS:
        yield Issue(0, "the first item is a landing", "put a take-off and waypoints before it")


@RULES.error("px4-takeoff-first", f"{_CHECKER}checkTakeoff; measured on 1.16.1")
def _takeoff_first(context: ValidationContext) -> Iterator[Issue]:
    """A take-off is not the first item that flies."""
    before = next((k for k, item in enumerate(context.items) if item.command in _FLIES), None)
    for index, _ in context.each(*TAKEOFFS):
        if before is not None and before < index:
            second = context.items[before].command in TAKEOFFS
            yield Issue(
                index,
                f"a second take-off, after item {number(before)}"
                if second
                else f"the take-off comes after item {number(before)}",
                "remove it" if second else f"move it before item {number(before)}",
            )


@RULES.error("px4-takeoff-altitude", f"{_CHECKER}checkTakeoff; measured on 1.16.1")
def _takeoff_altitude(context: ValidationContext) -> Iterator[Issue]:
    """A take-off to home's height or below."""
    for place in _takeoffs(context):
        if place.up < _SINGLE:
            yield Issue(
                place.index,
                f"the take-off ends {place.up:g} m above home; it must be above 0",
                "give the take-off an altitude",
            )


@RULES.warning(
    "px4-takeoff-low", f"PX4 before 1.15 {_CHECKER.split()[-1]}checkTakeoff; MIS_TAKEOFF_ALT"
)
def _takeoff_low(context: ValidationContext) -> Iterator[Issue]:
    """A take-off lower than older PX4 versions accept or any version flies."""
    vehicle = context.vehicle
    radius = vehicle.name_of("acceptance_radius")
    least, first = vehicle.value("acceptance_radius") + 1, vehicle.value("takeoff_height")
    for place in _takeoffs(context):
        if 0 < place.up < max(least, first):
            yield Issue(
                place.index,
                f"the take-off ends {place.up:g} m above home; older versions want "
                f"{least:g} m (acceptance radius {radius} + 1 m), and "
                f"all first climb to {first:g} m ({vehicle.name_of('takeoff_height')})",
                f"take off to {max(least, first):g} m or more",
            )


def _takeoffs(context: ValidationContext) -> Iterator[PlacedItem]:
    for place in context.places:
        if context.items[place.index].command in TAKEOFFS:
            yield place


@RULES.error(
    "px4-takeoff-or-landing-missing", f"{_CHECKER}checkTakeoffLandAvailable; measured on 1.16.1"
)
def _takeoff_landing(context: ValidationContext) -> Iterator[Issue]:
    """MIS_TKO_LAND_REQ asks for a take-off or landing that the mission does not have."""
    required = int(context.vehicle.value("takeoff_land_required"))
    takeoff, landing = any(context.each(*TAKEOFFS)), any(context.each(Command.NAV_LAND))
    both_or_none = "both a take-off and a landing, or neither,", takeoff == landing
    asked = {
        1: ("a take-off", takeoff),
        2: ("a landing", landing),
        3: ("a take-off and a landing", takeoff and landing),
        4: both_or_none,
        5: both_or_none,  # on the ground; in the air 2
    }
    what, there = asked.get(required, ("", True))
    if not there:
        yield Issue(
            None,
            f"MIS_TKO_LAND_REQ is {required} and asks for {what}; the mission has "
            f"{'a' if takeoff else 'no'} take-off and {'a' if landing else 'no'} landing",
            f"add {'NAV_LAND' if takeoff else 'NAV_TAKEOFF'}, or change MIS_TKO_LAND_REQ",
        )


@RULES.warning("px4-first-waypoint-far", f"{_CHECKER}checkHorizontalDistanceToFirstWaypoint")
def _first_far(context: ValidationContext) -> Iterator[Issue]:
    """The first item is farther from home than MIS_DIST_1WP."""
    limit = context.vehicle.value("first_waypoint_distance")
    if context.home is not None and context.places and limit > 0:
        first = context.places[0]
        distance = first.from_origin
        if distance >= limit:
            yield Issue(
                first.index,
                f"the first item is {distance:.0f} m from home, MIS_DIST_1WP is {limit:g} m",
                "check the coordinates and the home position, or raise MIS_DIST_1WP",
            )


_APPROACH = "PX4 1.16 FeasibilityChecker::checkFixedWindLandApproach"
_PATTERN = "PX4 1.16 FeasibilityChecker::checkLandPatternValidity"
_SPARE_ANGLE = 0.1
"""How much steeper than FW_LND_ANG PX4 lets an approach be, degrees. PX4's own."""

_ENTRANCES = (Command.NAV_WAYPOINT, Command.NAV_LOITER_TO_ALT)


def _approaches(context: ValidationContext) -> Iterator[tuple[int, float, float, float]]:
    """Yield the index of each landing and the item before it: m above, m away, m of its orbit."""
    by_index = {place.index: place for place in context.places}
    for index, _ in context.each(Command.NAV_LAND):
        entrance, landing = by_index.get(index - 1), by_index.get(index)
        if entrance is not None and landing is not None:
            away = math.hypot(entrance.east - landing.east, entrance.north - landing.north)
            item = context.items[entrance.index]
            orbits = item.command == Command.NAV_LOITER_TO_ALT and not math.isnan(item.params[1])
            yield index, entrance.up - landing.up, away, abs(item.params[1]) if orbits else 0.0


@RULES.error("px4-approach-entrance", _APPROACH, kind="plane")
def _entrance(context: ValidationContext) -> Iterator[Issue]:
    """A landing approach starts neither at a waypoint nor at a loiter to altitude."""
    for index, _ in context.each(Command.NAV_LAND):
        before = context.items[index - 1] if index else None
        if before is not None and before.command in FLOWN_TO and before.command not in _ENTRANCES:
            yield Issue(
                index,
                f"the item before the landing is {name_of(before.command)}",
                "put a NAV_WAYPOINT or NAV_LOITER_TO_ALT before the landing",
            )


@RULES.error("px4-approach-below", _APPROACH, kind="plane")
def _below(context: ValidationContext) -> Iterator[Issue]:
    """A landing approach starts below the landing point."""
    for index, above, _, _ in _approaches(context):
        if above <= 0:
            yield Issue(
                index,
                f"the approach starts {-above:g} m below the landing; it must be above it",
                "raise the item before the landing",
            )


@RULES.error("px4-approach-orbit", _APPROACH, kind="plane")
def _orbit(context: ValidationContext) -> Iterator[Issue]:
    """A landing point lies inside the orbit that its approach starts from."""
    for index, _, away, radius in _approaches(context):
        if radius > 0 and away <= radius:
            yield Issue(
                index,
                f"the landing is {away:.0f} m from the centre of an orbit of {radius:g} m",
                "move the landing point out of the orbit, or make the orbit smaller",
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
        if above > 0 and above / way > slope:
            yield Issue(
                index,
                f"{above:g} m of descent in {way:.0f} m are "
                f"{math.degrees(math.atan2(above, way)):.1f} degrees, FW_LND_ANG is {angle:g}",
                f"start the approach at most {slope * way:.0f} m above the landing, or "
                f"{math.ceil(above / slope)} m away from it",
            )


@RULES.error("px4-land-start", _PATTERN, kind="plane")
def _land_start(context: ValidationContext) -> Iterator[Issue]:
    """DO_LAND_START is there twice, before a return to launch, or without a landing after it."""
    starts = [index for index, _ in context.each(Command.DO_LAND_START)]
    if not starts:
        return
    start = starts[0]
    for second in starts[1:]:
        yield Issue(second, f"a second DO_LAND_START, after item {number(start)}", "remove it")
    for index, _ in context.each(Command.NAV_RETURN_TO_LAUNCH):
        if index > start:
            yield Issue(
                index,
                f"a return to launch after the DO_LAND_START of item {number(start)}",
                "remove one of both",
            )
    landings = [index for index, _ in context.each(*LANDINGS)]
    # The landing's approach, the item before it, may be the DO_LAND_START itself.
    if not any(index - 1 >= start for index in landings):
        yield Issue(start, "there is no landing after DO_LAND_START", "add NAV_LAND, or remove it")
