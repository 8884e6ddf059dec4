"""What ArduPilot does not arm or start for, and what it flies in a way that nobody expects."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.mission.command import ABOVE_TERRAIN, FLOWN_TO, Command, Frame
from faao_mav.validate.context import NAV_LAST, ValidationContext, at_zero, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle import ARDUCOPTER, ARDUPLANE
from faao_mav.vehicle.dialect import name_of

RULES = Rules(ARDUCOPTER.family)

_SKIPPED = {
    ARDUCOPTER: (30, 83, 191, 194, 210, 212, 223, 3000),
    ARDUPLANE: (Command.CONDITION_YAW, 213, 222, 42600),
}
"""Commands that are stored and then passed over."""

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


@RULES.error(
    "ardupilot-required-item",
    "ARMING_MIS_ITEMS asks for an item that the mission does not have",
    _ARMING,
)
def _required(context: ValidationContext) -> Iterator[Issue]:
    bits = int(context.vehicle.value("arming_items"))
    there = {item.command for item in context.items}
    for bit, (command, name) in _REQUIRED.items():
        if bits & bit and command not in there:
            yield Issue(
                None,
                f"ARMING_MIS_ITEMS is {bits} and asks for {name}, which the mission does not have",
                f"add {name}, or take {bit} off ARMING_MIS_ITEMS",
            )


@RULES.error(
    "ardupilot-required-rally",
    "ARMING_MIS_ITEMS asks for a rally point near enough",
    f"{_ARMING}, AP_Rally::find_nearest_rally_point",
)
def _required_rally(context: ValidationContext) -> Iterator[Issue]:
    bits = int(context.vehicle.value("arming_items"))
    if not bits & _RALLY_BIT or context.frame is None:
        return
    limit = context.vehicle.value("rally_limit")
    distances = [
        float(math.hypot(*context.frame.to_local(point.latitude, point.longitude)))
        for point in context.mission.rally
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


@RULES.warning(
    "ardupilot-no-takeoff",
    "without a take-off ArduCopter does not start the mission from the ground",
    _TAKEOFF,
    kind="copter",
)
def _no_takeoff(context: ValidationContext) -> Iterator[Issue]:
    if context.items and not any(context.each(*_TAKEOFFS)):
        yield Issue(
            None,
            "there is no take-off: from the ground AUTO is refused (Missing Takeoff Cmd)",
            "add NAV_TAKEOFF as the first item, or take off before you start the mission",
        )


@RULES.error(
    "ardupilot-takeoff-first",
    "ArduCopter starts a mission on the ground only if it begins with a take-off",
    _TAKEOFF,
    kind="copter",
)
def _takeoff_first(context: ValidationContext) -> Iterator[Issue]:
    takeoff = next((index for index, _ in context.each(*_TAKEOFFS)), None)
    if takeoff is None:
        return
    before = next(
        (
            index
            for index, item in enumerate(context.items[:takeoff])
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


@RULES.error(
    "ardupilot-fence-ceiling",
    "the mission climbs above FENCE_ALT_MAX while the fence is on",
    "ArduPilot 4.7 AC_Fence::check_fence_alt_max",
)
def _fence_ceiling(context: ValidationContext) -> Iterator[Issue]:
    ceiling = context.vehicle.value("fence_ceiling")
    if _fence_on(context, _CEILING):
        for place in context.places:
            if place.up > ceiling:
                yield Issue(
                    place.index,
                    f"{place.up:g} m above home; the fence's ceiling (FENCE_ALT_MAX) is "
                    f"{ceiling:g} m",
                    "lower the item or raise FENCE_ALT_MAX",
                )


@RULES.error(
    "ardupilot-fence-floor",
    "the mission descends below FENCE_ALT_MIN while the fence is on",
    "ArduPilot 4.7 AC_Fence::check_fence_alt_min",
)
def _fence_floor(context: ValidationContext) -> Iterator[Issue]:
    floor = context.vehicle.value("fence_floor")
    if _fence_on(context, _FLOOR):
        for place in context.places:
            if place.up < floor and context.items[place.index].command != Command.NAV_LAND:
                yield Issue(
                    place.index,
                    f"{place.up:g} m above home; the fence's floor (FENCE_ALT_MIN) is {floor:g} m",
                    "raise the item or lower FENCE_ALT_MIN",
                )


@RULES.error(
    "ardupilot-fence-circle",
    "the mission goes beyond FENCE_RADIUS from home while the fence is on",
    "ArduPilot 4.7 AC_Fence::check_fence_circle",
)
def _fence_circle(context: ValidationContext) -> Iterator[Issue]:
    radius = context.vehicle.value("fence_radius")
    if _fence_on(context, _CIRCLE) and context.home is not None:
        for place in context.places:
            distance = place.from_origin
            if distance > radius:
                yield Issue(
                    place.index,
                    f"{distance:.0f} m from home; the fence's radius (FENCE_RADIUS) is "
                    f"{radius:g} m",
                    "move the item or raise FENCE_RADIUS",
                )


def _fence_on(context: ValidationContext, bit: int) -> bool:
    on = context.vehicle.value("fence_enable") != 0
    return on and bool(int(context.vehicle.value("fence_type")) & bit)


_WAYPOINTS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
_HORIZONTAL = (0, 1)

_LEAN = ((30.0, 10.3), (45.0, 15.2))
"""The lean angle, degrees, and the top speed that it gave, m/s. Measured: a quadrotor of
ArduPilot's simulator."""


@RULES.error(
    "ardupilot-spline-delay",
    "a NAV_DELAY after a spline waypoint: the aircraft may plunge",
    "measured on ArduCopter 4.7: from 30 m to 12 m and to 79 m in 8 of 8 flights",
    kind="copter",
)
def _spline_delay(context: ValidationContext) -> Iterator[Issue]:
    flying = [(k, item) for k, item in enumerate(context.items) if item.command <= NAV_LAST]
    for (before, first), (index, second) in pairwise(flying):
        if (first.command, second.command) == (Command.NAV_SPLINE_WAYPOINT, Command.NAV_DELAY):
            yield Issue(
                index,
                f"the delay follows the spline waypoint {number(before)}: the autopilot reads its "
                "bytes as the spline's next point and may plunge or climb",
                f"make item {number(before)} a plain waypoint, or give it a hold in whole seconds",
            )


@RULES.warning(
    "ardupilot-stays",
    "ArduPilot takes a waypoint at latitude and longitude 0 for the place where it is",
    "ArduPilot 4.7 ModeAuto::loc_from_cmd, Plane::set_next_WP",
)
def _stays(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(*_WAYPOINTS):
        if at_zero(item):
            yield Issue(
                index,
                "latitude and longitude are 0: the aircraft stays where it is",
                "give the coordinates, or remove the item",
            )


@RULES.warning(
    "ardupilot-speed-ignored",
    "ArduPilot does nothing on this DO_CHANGE_SPEED",
    "measured on ArduCopter 4.7; ArduPlane 4.7 Plane::do_change_speed",
)
def _speed_ignored(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        throttle = 0.0 if context.vehicle.type.hovers else item.params[2]
        if context.vehicle.type.dialect.speed_change(item) is None and not throttle > 0:
            yield Issue(
                index,
                f"speed type {item.params[0]:g} with {item.params[1]:g} m/s does nothing: the "
                "speed before stays in force",
                "give type 0 in param1 and a speed above 0 in param2, or remove the item",
            )


@RULES.warning(
    "ardupilot-speed-lean",
    "faster than a copter flies at its lean limit",
    "measured: 10.3 m/s at 30 degrees, 15.2 m/s at 45 (quadrotor of ArduPilot's simulator)",
    kind="copter",
)
def _speed_lean(context: ValidationContext) -> Iterator[Issue]:
    angle = round(math.degrees(context.vehicle.value("lean_angle")), 9)
    name = context.vehicle.name_of("lean_angle")
    (a0, v0), (a1, v1) = _LEAN
    top = max(v0 + (angle - a0) * (v1 - v0) / (a1 - a0), 0.0)
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        kind, speed = item.params[:2]
        if kind in _HORIZONTAL and speed > top:
            yield Issue(
                index,
                f"{speed:g} m/s; with a lean of at most {angle:g} degrees "
                f"({name}) ArduPilot's simulated quadrotor reaches {top:.1f}",
                f"ask for {top:.1f} m/s or less, or set ANGLE_MAX if your aircraft can lean more",
            )


@RULES.warning(
    "ardupilot-plane-speed",
    "an airspeed outside what ArduPlane allows is not flown",
    "ArduPlane 4.7 Plane::do_change_speed",
    kind="plane",
)
def _plane_speed(context: ValidationContext) -> Iterator[Issue]:
    least = context.vehicle.value("min_speed")
    top = context.vehicle.value("max_speed")
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        kind, speed = item.params[:2]
        if kind == 0 and speed > 0 and not least <= speed <= top:
            yield Issue(
                index,
                f"an airspeed of {speed:g} m/s; the plane flies {least:g} to {top:g} m/s "
                "(AIRSPEED_MIN, AIRSPEED_MAX) and ignores others",
                "ask for a speed in between",
            )


@RULES.warning(
    "ardupilot-command-skipped",
    "ArduPilot stores this command, but this kind of aircraft does nothing with it",
    "ArduCopter 4.7 ModeAuto::start_command, ArduPlane 4.7 Plane::start_command",
)
def _skipped(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(*_SKIPPED[context.vehicle.type]):
        yield Issue(
            index,
            f"{name_of(item.command)} is stored, but a {context.vehicle.kind} skips it",
            "remove the item, or check that --type is right",
        )


@RULES.warning(
    "ardupilot-frame-mission",
    "ArduPilot takes coordinates in frame 2 for heights above sea level",
    "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd",
)
def _frame_mission(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(*FLOWN_TO):
        if item.frame == Frame.MISSION:
            yield Issue(
                index,
                f"frame 2 says that there are no coordinates, but ArduPilot flies there, at "
                f"{item.z:g} m above sea level",
                "use frame 3 for heights above home, 0 for heights above sea level",
            )


@RULES.warning(
    "ardupilot-terrain",
    "heights above terrain: without terrain data ArduPilot does not arm",
    "measured on ArduCopter 4.7: frame 10 uploads, then arming is refused",
)
def _terrain(context: ValidationContext) -> Iterator[Issue]:
    above = _above_terrain(context)
    if above and context.vehicle.value("terrain_enable") != 0:
        yield Issue(
            above[0],
            f"{len(above)} of the heights count from the terrain (frame 10 or 11): ArduPilot does "
            "not arm before it has the terrain data, and they are not checked here",
            "load the terrain data onto the vehicle's card, or use frame 3: height above home",
        )


@RULES.error(
    "ardupilot-terrain-off",
    "heights above terrain, but TERRAIN_ENABLE is 0",
    "ArduPilot 4.7 AP_Arming::terrain_checks",
)
def _terrain_off(context: ValidationContext) -> Iterator[Issue]:
    above = _above_terrain(context)
    if above and context.vehicle.value("terrain_enable") == 0:
        yield Issue(
            above[0],
            f"{len(above)} of the heights count from the terrain (frame 10 or 11), but "
            "TERRAIN_ENABLE is 0",
            "set TERRAIN_ENABLE to 1, or use frame 3: height above home",
        )


def _above_terrain(context: ValidationContext) -> list[int]:
    return [index for index, item in context.each(*FLOWN_TO) if item.frame in ABOVE_TERRAIN]


@RULES.note(
    "altitude-rounded",
    "an altitude is stored in whole centimetres",
    "measured on ArduCopter 4.7: read back",
)
def _altitude(context: ValidationContext) -> Iterator[Issue]:
    changed = []
    for index, item in context.each(*FLOWN_TO):
        stored = context.stored(item)
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
