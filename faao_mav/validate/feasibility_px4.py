"""PX4's checks after an upload: it acknowledges the mission first and then does not fly it."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.validate import parameters
from faao_mav.validate.case import Case, Place, number
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle.dialect import name_of

RULES = Rules()

_CHECKER = "PX4 1.16 FeasibilityChecker::"
_CONDITION_GATE = 4501
_NEVER = frozenset({Command.CONDITION_DELAY, Command.CONDITION_DISTANCE})
_VTOL = (Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, 3000)
_TAKEOFFS = (Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF)
_FLIES = FLOWN_TO | {_CONDITION_GATE, Command.NAV_RETURN_TO_LAUNCH, 187, 211, 42600}
"""What checkTakeoff counts as flying: actuators, grippers and winches as well."""

_CLOSEST_GATE = 0.05

_TAKEOFF, _LANDING, _BOTH, _BOTH_OR_NONE, _BOTH_OR_NONE_ON_GROUND = 1, 2, 3, 4, 5


@RULES.add(
    "px4-command-rejected",
    Level.ERROR,
    "PX4 acknowledges this command on upload and then rejects the mission",
    f"{_CHECKER}checkMissionItemValidity; measured on 1.16.1",
    autopilot="px4",
)
def _rejected(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_NEVER):
        if item.frame == Frame.MISSION:
            yield Issue(
                index,
                f"{name_of(item.command)} is acknowledged on upload, then the mission is rejected",
                "remove the item; to wait, use a hold (param1 of a waypoint) or NAV_DELAY",
            )


@RULES.add(
    "px4-vtol-items",
    Level.ERROR,
    "items for VTOL aircraft only",
    f"{_CHECKER}checkItemsFitToVehicleType",
    autopilot="px4",
)
def _vtol(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_VTOL):
        yield Issue(
            index,
            f"{name_of(item.command)} is for VTOL aircraft, this is a {case.vehicle.kind}",
            "use NAV_TAKEOFF and NAV_LAND",
        )


@RULES.add(
    "px4-starts-with-land",
    Level.ERROR,
    "the mission starts with a landing",
    f"{_CHECKER}checkMissionItemValidity, checkLandPatternValidity",
    autopilot="px4",
)
def _starts_with_land(case: Case) -> Iterator[Issue]:
    if case.items and case.items[0].command in (Command.NAV_LAND, Command.NAV_VTOL_LAND):
        yield Issue(0, "the first item is a landing", "put a take-off and waypoints before it")


@RULES.add(
    "px4-takeoff-first",
    Level.ERROR,
    "a take-off is not the first item that flies",
    f"{_CHECKER}checkTakeoff; measured on 1.16.1",
    autopilot="px4",
)
def _takeoff_first(case: Case) -> Iterator[Issue]:
    before = next((k for k, item in enumerate(case.items) if item.command in _FLIES), None)
    for index, _ in case.each(*_TAKEOFFS):
        if before is not None and before < index:
            second = case.items[before].command in _TAKEOFFS
            yield Issue(
                index,
                f"a second take-off, after item {number(before)}"
                if second
                else f"the take-off comes after item {number(before)}",
                "remove it" if second else f"move it before item {number(before)}",
            )


@RULES.add(
    "px4-takeoff-altitude",
    Level.ERROR,
    "a take-off to home's height or below",
    f"{_CHECKER}checkTakeoff; measured on 1.16.1",
    autopilot="px4",
)
def _takeoff_altitude(case: Case) -> Iterator[Issue]:
    for place in _takeoffs(case):
        if place.up <= 0:
            yield Issue(
                place.index,
                f"the take-off ends {place.up:g} m above home; it must be above 0",
                "give the take-off an altitude",
            )


@RULES.add(
    "px4-takeoff-low",
    Level.WARNING,
    "a take-off lower than older PX4 versions accept or any version flies",
    f"PX4 before 1.15 {_CHECKER.split()[-1]}checkTakeoff; MIS_TAKEOFF_ALT",
    autopilot="px4",
)
def _takeoff_low(case: Case) -> Iterator[Issue]:
    radius = parameters.acceptance_radius(case.vehicle)
    climb = parameters.PX4_TAKEOFF_ALTITUDE
    for place in _takeoffs(case):
        least = radius.of(case.vehicle) + 1
        first = climb.of(case.vehicle)
        if 0 < place.up < max(least, first):
            yield Issue(
                place.index,
                f"the take-off ends {place.up:g} m above home; older versions want "
                f"{least:g} m (acceptance radius {radius.name(case.vehicle)} + 1 m), and all first "
                f"climb to {first:g} m ({climb.name(case.vehicle)})",
                f"take off to {max(least, first):g} m or more",
            )


def _takeoffs(case: Case) -> Iterator[Place]:
    for place in case.places:
        if case.items[place.index].command in _TAKEOFFS:
            yield place


@RULES.add(
    "px4-takeoff-or-landing-missing",
    Level.ERROR,
    "MIS_TKO_LAND_REQ asks for a take-off or landing that the mission does not have",
    f"{_CHECKER}checkTakeoffLandAvailable; measured on 1.16.1",
    autopilot="px4",
)
def _takeoff_landing(case: Case) -> Iterator[Issue]:
    required = int(parameters.PX4_TAKEOFF_LAND.of(case.vehicle))
    takeoff, landing = any(case.each(*_TAKEOFFS)), any(case.each(Command.NAV_LAND))
    wanted = {
        _TAKEOFF: takeoff,
        _LANDING: landing,
        _BOTH: takeoff and landing,
        _BOTH_OR_NONE: takeoff == landing,
        _BOTH_OR_NONE_ON_GROUND: takeoff == landing,
    }
    if wanted.get(required, True):
        return
    missing = {
        _TAKEOFF: "a take-off",
        _LANDING: "a landing",
        _BOTH: "a take-off and a landing",
    }.get(required, "both a take-off and a landing, or neither,")
    yield Issue(
        None,
        f"MIS_TKO_LAND_REQ is {required} and asks for {missing}; the mission has "
        f"{'a' if takeoff else 'no'} take-off and {'a' if landing else 'no'} landing",
        f"add {'NAV_LAND' if takeoff else 'NAV_TAKEOFF'}, or change MIS_TKO_LAND_REQ",
    )


@RULES.add(
    "px4-first-waypoint-far",
    Level.WARNING,
    "the first item is farther from home than MIS_DIST_1WP",
    f"{_CHECKER}checkHorizontalDistanceToFirstWaypoint",
    autopilot="px4",
)
def _first_far(case: Case) -> Iterator[Issue]:
    limit = parameters.PX4_FIRST_DISTANCE.of(case.vehicle)
    if case.home is not None and case.places and limit > 0:
        first = case.places[0]
        distance = first.from_origin
        if distance >= limit:
            yield Issue(
                first.index,
                f"the first item is {distance:.0f} m from home, MIS_DIST_1WP is {limit:g} m",
                "check the coordinates and the home position, or raise MIS_DIST_1WP",
            )


@RULES.add(
    "px4-gate-close",
    Level.ERROR,
    "a CONDITION_GATE at the place of the item before or after it",
    f"{_CHECKER}checkDistancesBetweenWaypoints",
    autopilot="px4",
)
def _gate(case: Case) -> Iterator[Issue]:
    if case.frame is None:
        return
    placed = [
        (k, item)
        for k, item in case.each(*FLOWN_TO, _CONDITION_GATE)
        if abs(item.x) <= 90 and abs(item.y) <= 180
    ]
    local = case.frame.to_local([item.x for _, item in placed], [item.y for _, item in placed])
    for n in range(1, len(placed)):
        (before, first), (index, second) = placed[n - 1], placed[n]
        distance = math.dist(local[n - 1], local[n])
        if _CONDITION_GATE in (first.command, second.command) and distance < _CLOSEST_GATE:
            yield Issue(
                index,
                f"{distance:.3f} m from item {number(before)}; a gate and its neighbour must be "
                f"{_CLOSEST_GATE} m apart",
                "move the gate",
            )


@RULES.add(
    "px4-max-horizontal",
    Level.ERROR,
    "farther from home than GF_MAX_HOR_DIST",
    "PX4 1.16 Geofence::check, MissionFeasibilityChecker::checkGeofence",
    autopilot="px4",
)
def _max_horizontal(case: Case) -> Iterator[Issue]:
    limit = parameters.PX4_MAX_HORIZONTAL.of(case.vehicle)
    if limit > 0 and case.home is not None:
        for place in case.places:
            distance = place.from_origin
            if distance > limit:
                yield Issue(
                    place.index,
                    f"{distance:.0f} m from home, GF_MAX_HOR_DIST is {limit:g} m",
                    "move the item or raise GF_MAX_HOR_DIST",
                )


@RULES.add(
    "px4-max-vertical",
    Level.ERROR,
    "higher above home than GF_MAX_VER_DIST",
    "PX4 1.16 Geofence::check, MissionFeasibilityChecker::checkGeofence",
    autopilot="px4",
)
def _max_vertical(case: Case) -> Iterator[Issue]:
    limit = parameters.PX4_MAX_VERTICAL.of(case.vehicle)
    if limit > 0:
        for place in case.places:
            if abs(place.up) > limit:
                yield Issue(
                    place.index,
                    f"{place.up:g} m above home, GF_MAX_VER_DIST is {limit:g} m",
                    "lower the item or raise GF_MAX_VER_DIST",
                )
