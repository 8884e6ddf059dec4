"""PX4's checks of how a plane lands."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import FLOWN_TO, Command
from faao_mav.validate import parameters
from faao_mav.validate.case import Case, Place, number
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle.dialect import name_of

RULES = Rules()

_APPROACH = "PX4 1.16 FeasibilityChecker::checkFixedWindLandApproach"
_PATTERN = "PX4 1.16 FeasibilityChecker::checkLandPatternValidity"
_SPARE_ANGLE = 0.1
_ENTRANCES = (Command.NAV_WAYPOINT, Command.NAV_LOITER_TO_ALT)


def _approaches(case: Case) -> Iterator[tuple[Place, Place]]:
    """Yield the place before each landing, and the landing."""
    by_index = {place.index: place for place in case.places}
    for index, _ in case.each(Command.NAV_LAND):
        if index - 1 in by_index and index in by_index:
            yield by_index[index - 1], by_index[index]


@RULES.add(
    "px4-approach-entrance",
    Level.ERROR,
    "a landing approach starts neither at a waypoint nor at a loiter to altitude",
    _APPROACH,
    autopilot="px4",
    kind="plane",
)
def _entrance(case: Case) -> Iterator[Issue]:
    for index, _ in case.each(Command.NAV_LAND):
        before = case.items[index - 1] if index else None
        if before is not None and before.command in FLOWN_TO and before.command not in _ENTRANCES:
            yield Issue(
                index,
                f"the item before the landing is {name_of(before.command)}",
                "put a NAV_WAYPOINT or NAV_LOITER_TO_ALT before the landing",
            )


@RULES.add(
    "px4-approach-below",
    Level.ERROR,
    "a landing approach starts below the landing point",
    _APPROACH,
    autopilot="px4",
    kind="plane",
)
def _below(case: Case) -> Iterator[Issue]:
    for entrance, landing in _approaches(case):
        if entrance.up - landing.up <= 0:
            yield Issue(
                landing.index,
                f"the approach starts {entrance.up:g} m above home, the landing is at "
                f"{landing.up:g} m",
                "raise the item before the landing",
            )


@RULES.add(
    "px4-approach-orbit",
    Level.ERROR,
    "a landing point lies inside the orbit that its approach starts from",
    _APPROACH,
    autopilot="px4",
    kind="plane",
)
def _orbit(case: Case) -> Iterator[Issue]:
    for entrance, landing in _approaches(case):
        distance, radius = _distance(entrance, landing), _orbit_radius(case, entrance)
        if radius > 0 and distance <= radius:
            yield Issue(
                landing.index,
                f"the landing is {distance:.0f} m from the centre of an orbit of {radius:g} m",
                "move the landing point out of the orbit, or make the orbit smaller",
            )


@RULES.add(
    "px4-approach-steep",
    Level.ERROR,
    "a landing approach is steeper than FW_LND_ANG",
    _APPROACH,
    autopilot="px4",
    kind="plane",
)
def _steep(case: Case) -> Iterator[Issue]:
    angle = parameters.PX4_LANDING_ANGLE.of(case.vehicle)
    slope = math.tan(math.radians(angle + _SPARE_ANGLE))
    for entrance, landing in _approaches(case):
        if case.items[entrance.index].command not in _ENTRANCES:
            continue
        height = entrance.up - landing.up
        square = _distance(entrance, landing) ** 2 - _orbit_radius(case, entrance) ** 2
        if square > 0 and height > 0 and height / math.sqrt(square) > slope:
            distance = math.sqrt(square)
            yield Issue(
                landing.index,
                f"{height:g} m of descent in {distance:.0f} m are "
                f"{math.degrees(math.atan2(height, distance)):.1f} degrees, FW_LND_ANG is "
                f"{angle:g}",
                f"start the approach at most {slope * distance:.0f} m above the landing, or "
                f"{math.ceil(height / slope)} m away from it",
            )


def _distance(a: Place, b: Place) -> float:
    return math.hypot(a.east - b.east, a.north - b.north)


def _orbit_radius(case: Case, entrance: Place) -> float:
    item = case.items[entrance.index]
    if item.command != Command.NAV_LOITER_TO_ALT or math.isnan(item.params[1]):
        return 0.0
    return abs(item.params[1])


@RULES.add(
    "px4-land-start",
    Level.ERROR,
    "DO_LAND_START is there twice, before a return to launch, or without a landing after it",
    _PATTERN,
    autopilot="px4",
    kind="plane",
)
def _land_start(case: Case) -> Iterator[Issue]:
    starts = [index for index, _ in case.each(Command.DO_LAND_START)]
    if not starts:
        return
    start = starts[0]
    for second in starts[1:]:
        yield Issue(second, f"a second DO_LAND_START, after item {number(start)}", "remove it")
    for index, _ in case.each(Command.NAV_RETURN_TO_LAUNCH):
        if index > start:
            yield Issue(
                index,
                f"a return to launch after the DO_LAND_START of item {number(start)}",
                "remove one of both",
            )
    landings = [index for index, _ in case.each(Command.NAV_LAND, Command.NAV_VTOL_LAND)]
    # The landing's approach, the item before it, may be the DO_LAND_START itself.
    if not any(index - 1 >= start for index in landings):
        yield Issue(start, "there is no landing after DO_LAND_START", "add NAV_LAND, or remove it")
