"""What keeps ArduPilot from arming or from starting a mission that it has stored."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import Command
from faao_mav.validate import parameters
from faao_mav.validate.case import NAV_LAST, Case, number
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules

RULES = Rules()

_ARMING = "ArduPilot 4.7 AP_Arming::mission_checks"
_TAKEOFF = "ArduPilot 4.7 AP_Mission::starts_with_takeoff_cmd, ArduCopter ModeAuto::init"

_REQUIRED = {  # bits of ARMING_MIS_ITEMS
    1: (Command.NAV_LAND, "NAV_LAND"),
    2: (Command.NAV_VTOL_LAND, "NAV_VTOL_LAND"),
    4: (Command.DO_LAND_START, "DO_LAND_START"),
    8: (Command.NAV_TAKEOFF, "NAV_TAKEOFF"),
    16: (Command.NAV_VTOL_TAKEOFF, "NAV_VTOL_TAKEOFF"),
    64: (Command.NAV_RETURN_TO_LAUNCH, "NAV_RETURN_TO_LAUNCH"),
}
_RALLY_BIT = 32
_TAKEOFFS = (Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF)
_CEILING, _CIRCLE, _FLOOR = 1, 2, 8  # bits of FENCE_TYPE


@RULES.add(
    "ardupilot-required-item",
    Level.ERROR,
    "ARMING_MIS_ITEMS asks for an item that the mission does not have",
    _ARMING,
    autopilot="ardupilot",
)
def _required(case: Case) -> Iterator[Issue]:
    bits = int(parameters.ARMING_ITEMS.of(case.vehicle))
    there = {item.command for item in case.items}
    for bit, (command, name) in _REQUIRED.items():
        if bits & bit and command not in there:
            yield Issue(
                None,
                f"ARMING_MIS_ITEMS is {bits} and asks for {name}, which the mission does not have",
                f"add {name}, or take {bit} off ARMING_MIS_ITEMS",
            )


@RULES.add(
    "ardupilot-required-rally",
    Level.ERROR,
    "ARMING_MIS_ITEMS asks for a rally point near enough",
    f"{_ARMING}, AP_Rally::find_nearest_rally_point",
    autopilot="ardupilot",
)
def _required_rally(case: Case) -> Iterator[Issue]:
    bits = int(parameters.ARMING_ITEMS.of(case.vehicle))
    if not bits & _RALLY_BIT or case.frame is None:
        return
    limit = parameters.rally_limit(case.vehicle).of(case.vehicle)
    distances = [
        float(math.hypot(*case.frame.to_local(point.latitude, point.longitude)))
        for point in case.mission.rally
    ]
    nearest = min(distances, default=math.inf)
    if nearest > (limit or math.inf) or not distances:
        there = f"the nearest is {nearest:.0f} m away" if distances else "there is none"
        yield Issue(
            None,
            f"ARMING_MIS_ITEMS is {bits} and asks for a rally point"
            f"{f' within {limit:g} m' if limit else ''}; {there}",
            f"add one, or take {_RALLY_BIT} off ARMING_MIS_ITEMS",
        )


@RULES.add(
    "ardupilot-no-takeoff",
    Level.WARNING,
    "without a take-off ArduCopter does not start the mission from the ground",
    _TAKEOFF,
    autopilot="ardupilot",
    kind="copter",
)
def _no_takeoff(case: Case) -> Iterator[Issue]:
    if case.items and not any(case.each(*_TAKEOFFS)):
        yield Issue(
            None,
            "there is no take-off: from the ground AUTO is refused (Missing Takeoff Cmd)",
            "add NAV_TAKEOFF as the first item, or take off before you start the mission",
        )


@RULES.add(
    "ardupilot-takeoff-first",
    Level.ERROR,
    "ArduCopter starts a mission on the ground only if it begins with a take-off",
    _TAKEOFF,
    autopilot="ardupilot",
    kind="copter",
)
def _takeoff_first(case: Case) -> Iterator[Issue]:
    takeoff = next((index for index, _ in case.each(*_TAKEOFFS)), None)
    if takeoff is None:
        return
    before = next(
        (
            index
            for index, item in enumerate(case.items[:takeoff])
            if item.command <= NAV_LAST and item.command != Command.NAV_DELAY
        ),
        None,
    )
    if before is not None:
        yield Issue(
            takeoff,
            f"the take-off comes after item {number(before)}: from the ground AUTO is refused "
            "(Missing Takeoff Cmd)",
            f"move the take-off before item {number(before)}",
        )


@RULES.add(
    "ardupilot-fence-ceiling",
    Level.ERROR,
    "the mission climbs above FENCE_ALT_MAX while the fence is on",
    "ArduPilot 4.7 AC_Fence::check_fence_alt_max",
    autopilot="ardupilot",
)
def _fence_ceiling(case: Case) -> Iterator[Issue]:
    ceiling = parameters.FENCE_CEILING.of(case.vehicle)
    if _fence_on(case, _CEILING):
        for place in case.places:
            if place.up > ceiling:
                yield Issue(
                    place.index,
                    f"{place.up:g} m above home; the fence's ceiling (FENCE_ALT_MAX) is "
                    f"{ceiling:g} m",
                    "lower the item or raise FENCE_ALT_MAX",
                )


@RULES.add(
    "ardupilot-fence-floor",
    Level.ERROR,
    "the mission descends below FENCE_ALT_MIN while the fence is on",
    "ArduPilot 4.7 AC_Fence::check_fence_alt_min",
    autopilot="ardupilot",
)
def _fence_floor(case: Case) -> Iterator[Issue]:
    floor = parameters.FENCE_FLOOR.of(case.vehicle)
    if _fence_on(case, _FLOOR):
        for place in case.places:
            if place.up < floor and case.items[place.index].command != Command.NAV_LAND:
                yield Issue(
                    place.index,
                    f"{place.up:g} m above home; the fence's floor (FENCE_ALT_MIN) is {floor:g} m",
                    "raise the item or lower FENCE_ALT_MIN",
                )


@RULES.add(
    "ardupilot-fence-circle",
    Level.ERROR,
    "the mission goes beyond FENCE_RADIUS from home while the fence is on",
    "ArduPilot 4.7 AC_Fence::check_fence_circle",
    autopilot="ardupilot",
)
def _fence_circle(case: Case) -> Iterator[Issue]:
    radius = parameters.FENCE_RADIUS.of(case.vehicle)
    if _fence_on(case, _CIRCLE) and case.home is not None:
        for place in case.places:
            distance = place.from_origin
            if distance > radius:
                yield Issue(
                    place.index,
                    f"{distance:.0f} m from home; the fence's radius (FENCE_RADIUS) is "
                    f"{radius:g} m",
                    "move the item or raise FENCE_RADIUS",
                )


def _fence_on(case: Case, bit: int) -> bool:
    on = parameters.FENCE_ENABLE.of(case.vehicle) != 0
    return on and bool(int(parameters.fence_type(case.vehicle).of(case.vehicle)) & bit)
