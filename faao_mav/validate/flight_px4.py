"""Items that PX4 accepts and then flies in a way that nobody expects."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.validate import parameters
from faao_mav.validate.case import HOME, Case, at_zero
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules

RULES = Rules()

_MEASURED = "measured on PX4 1.16.1"


@RULES.add(
    "px4-null-island",
    Level.ERROR,
    "an item at latitude and longitude 0: PX4 flies there, to the Gulf of Guinea",
    _MEASURED,
    autopilot="px4",
)
def _null_island(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*FLOWN_TO):
        if at_zero(item) and item.frame != Frame.MISSION:
            first = "climbs and then " if item.command == Command.NAV_TAKEOFF else ""
            yield Issue(
                index,
                f"latitude and longitude are 0: PX4 {first}flies off towards 0, 0",
                "give the coordinates; for a take-off those of home",
            )


@RULES.add(
    "px4-altitude-missing",
    Level.ERROR,
    "an altitude that is not set: PX4 hovers at that item for good",
    _MEASURED,
    autopilot="px4",
)
def _altitude_missing(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*FLOWN_TO):
        if math.isnan(item.z):
            yield Issue(
                index,
                "the altitude is not set (NaN): PX4 accepts it and then hovers there for good",
                "give the altitude",
            )


@RULES.add(
    "px4-speed-default",
    Level.WARNING,
    "a DO_CHANGE_SPEED without a speed above 0 sets the default speed",
    _MEASURED,
    autopilot="px4",
)
def _speed_default(case: Case) -> Iterator[Issue]:
    default = parameters.cruise_speed(case.vehicle)
    for index, item in case.each(Command.DO_CHANGE_SPEED):
        speed = item.params[1]
        if not speed > 0:
            yield Issue(
                index,
                f"a speed of {speed:g} m/s sets the default of {default.of(case.vehicle):g} m/s "
                f"({default.name(case.vehicle)})",
                "give the speed in param2, unless you mean the default",
            )


@RULES.add(
    "px4-speed-type",
    Level.WARNING,
    "PX4 takes a climb or descent speed for the horizontal speed",
    _MEASURED,
    autopilot="px4",
    kind="copter",
)
def _speed_type(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.DO_CHANGE_SPEED):
        if item.params[0] in (2, 3) and item.params[1] > 0:
            yield Issue(
                index,
                f"speed type {item.params[0]:g} is ignored: {item.params[1]:g} m/s become the "
                "horizontal speed",
                "remove the item and set MPC_Z_V_AUTO_UP and MPC_Z_V_AUTO_DN instead",
            )


@RULES.add(
    "px4-speed-capped",
    Level.WARNING,
    "faster than PX4 flies",
    f"{_MEASURED}: capped at MPC_XY_VEL_MAX",
    autopilot="px4",
    kind="copter",
)
def _speed_capped(case: Case) -> Iterator[Issue]:
    top = parameters.PX4_TOP_SPEED
    limit = top.of(case.vehicle)
    for index, item in case.each(Command.DO_CHANGE_SPEED):
        if item.params[1] > limit:
            yield Issue(
                index,
                f"{item.params[1]:g} m/s; PX4 flies at most {limit:g} m/s "
                f"({top.name(case.vehicle)})",
                f"ask for {limit:g} m/s or less, or raise MPC_XY_VEL_MAX",
            )


@RULES.add(
    "px4-plane-speed",
    Level.WARNING,
    "an airspeed outside what PX4 flies a plane at",
    "PX4 1.16: FW_AIRSPD_MIN, FW_AIRSPD_MAX",
    autopilot="px4",
    kind="plane",
)
def _plane_speed(case: Case) -> Iterator[Issue]:
    least = parameters.PX4_PLANE_LEAST_SPEED.of(case.vehicle)
    top = parameters.PX4_PLANE_TOP_SPEED.of(case.vehicle)
    for index, item in case.each(Command.DO_CHANGE_SPEED):
        speed = item.params[1]
        if speed > 0 and not least <= speed <= top:
            yield Issue(
                index,
                f"an airspeed of {speed:g} m/s; the plane flies {least:g} to {top:g} m/s "
                "(FW_AIRSPD_MIN, FW_AIRSPD_MAX)",
                "ask for a speed in between",
            )


@RULES.add(
    "px4-radius-covers-leg",
    Level.WARNING,
    "an acceptance radius as long as its leg: the waypoint counts at once",
    _MEASURED,
    autopilot="px4",
)
def _radius(case: Case) -> Iterator[Issue]:
    default = parameters.acceptance_radius(case.vehicle).of(case.vehicle)
    for leg in case.legs:
        if leg.jump or leg.start.index == HOME:
            continue
        item = case.items[leg.index]
        own = item.params[1]
        radius = own if own > 0 else default
        if item.command == Command.NAV_WAYPOINT and 0.05 <= leg.length <= radius:
            yield Issue(
                leg.index,
                f"the leg is {leg.length:.1f} m long, the acceptance radius {radius:g} m: the "
                "waypoint counts as reached at once",
                "use a smaller radius (param2, NAV_ACC_RAD) or a longer leg",
            )


@RULES.add(
    "px4-takeoff-elsewhere",
    Level.NOTE,
    "a take-off item away from home: PX4 climbs first and then flies there",
    _MEASURED,
    autopilot="px4",
    kind="copter",
)
def _takeoff_elsewhere(case: Case) -> Iterator[Issue]:
    if case.home is None:
        return
    radius = parameters.acceptance_radius(case.vehicle).of(case.vehicle)
    for place in case.places:
        distance = place.from_origin
        if case.items[place.index].command == Command.NAV_TAKEOFF and distance > radius:
            yield Issue(
                place.index,
                f"the take-off item is {distance:.0f} m from home: PX4 climbs at home and then "
                "flies there",
                "nothing, if the way is free",
            )


@RULES.add(
    "px4-stops",
    Level.WARNING,
    "an item without autocontinue: PX4 stops the mission there",
    "PX4 1.16 MissionBase::on_active",
    autopilot="px4",
)
def _stops(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items[:-1]):
        if not item.autocontinue:
            yield Issue(
                index,
                "autocontinue is off: PX4 does not go on to the next item",
                "set autocontinue, the last field of the row",
            )
