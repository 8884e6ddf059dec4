"""Items that PX4 accepts and then flies in a way that nobody expects."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.validate.context import ValidationContext, at_zero
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle import PX4_COPTER

RULES = Rules(PX4_COPTER.family)

_ROI = (80, Command.DO_SET_ROI)
_ROI_WITH_PLACE, _ROI_WITHOUT_PLACE = (0, 3), (0, 1, 2)

_MEASURED = "measured on PX4 1.16.1"


@RULES.error(
    "px4-null-island",
    "an item at latitude and longitude 0: PX4 flies there, to the Gulf of Guinea",
    _MEASURED,
)
def _null_island(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(*FLOWN_TO):
        if at_zero(item) and item.frame != Frame.MISSION:
            first = "climbs and then " if item.command == Command.NAV_TAKEOFF else ""
            yield Issue(
                index,
                f"latitude and longitude are 0: PX4 {first}flies off towards 0, 0",
                "give the coordinates; for a take-off those of home",
            )


@RULES.error(
    "px4-altitude-missing",
    "an altitude that is not set: PX4 hovers at that item for good",
    _MEASURED,
)
def _altitude_missing(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(*FLOWN_TO):
        if math.isnan(item.z):
            yield Issue(
                index,
                "the altitude is not set (NaN): PX4 accepts it and then hovers there for good",
                "give the altitude",
            )


@RULES.warning(
    "px4-speed-default",
    "a DO_CHANGE_SPEED without a speed above 0 sets the default speed",
    _MEASURED,
)
def _speed_default(context: ValidationContext) -> Iterator[Issue]:
    default, name = context.vehicle.value("cruise_speed"), context.vehicle.name_of("cruise_speed")
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        speed = item.params[1]
        if not speed > 0:
            yield Issue(
                index,
                f"a speed of {speed:g} m/s sets the default of {default:g} m/s ({name})",
                "give the speed in param2, unless you mean the default",
            )


@RULES.warning(
    "px4-speed-type",
    "PX4 takes a climb or descent speed for the horizontal speed",
    _MEASURED,
    kind="copter",
)
def _speed_type(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        if item.params[0] in (2, 3) and item.params[1] > 0:
            yield Issue(
                index,
                f"speed type {item.params[0]:g} is ignored: {item.params[1]:g} m/s become the "
                "horizontal speed",
                "remove the item and set MPC_Z_V_AUTO_UP and MPC_Z_V_AUTO_DN instead",
            )


@RULES.warning(
    "px4-speed-capped",
    "faster than PX4 flies",
    f"{_MEASURED}: capped at MPC_XY_VEL_MAX",
    kind="copter",
)
def _speed_capped(context: ValidationContext) -> Iterator[Issue]:
    limit, name = context.vehicle.value("max_speed"), context.vehicle.name_of("max_speed")
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        if item.params[1] > limit:
            yield Issue(
                index,
                f"{item.params[1]:g} m/s; PX4 flies at most {limit:g} m/s ({name})",
                f"ask for {limit:g} m/s or less, or raise MPC_XY_VEL_MAX",
            )


@RULES.warning(
    "px4-plane-speed",
    "an airspeed outside what PX4 flies a plane at",
    "PX4 1.16: FW_AIRSPD_MIN, FW_AIRSPD_MAX",
    kind="plane",
)
def _plane_speed(context: ValidationContext) -> Iterator[Issue]:
    least = context.vehicle.value("min_speed")
    top = context.vehicle.value("max_speed")
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        speed = item.params[1]
        if speed > 0 and not least <= speed <= top:
            yield Issue(
                index,
                f"an airspeed of {speed:g} m/s; the plane flies {least:g} to {top:g} m/s "
                "(FW_AIRSPD_MIN, FW_AIRSPD_MAX)",
                "ask for a speed in between",
            )


@RULES.note(
    "px4-takeoff-elsewhere",
    "a take-off item away from home: PX4 climbs first and then flies there",
    _MEASURED,
    kind="copter",
)
def _takeoff_elsewhere(context: ValidationContext) -> Iterator[Issue]:
    if context.home is None:
        return
    radius = context.vehicle.value("acceptance_radius")
    for place in context.places:
        distance = place.from_origin
        if context.items[place.index].command == Command.NAV_TAKEOFF and distance > radius:
            yield Issue(
                place.index,
                f"the take-off item is {distance:.0f} m from home: PX4 climbs at home and then "
                "flies there",
                "nothing, if the way is free",
            )


@RULES.warning(
    "px4-stops",
    "an item without autocontinue: PX4 stops the mission there",
    "PX4 1.16 MissionBase::on_active",
)
def _stops(context: ValidationContext) -> Iterator[Issue]:
    for index, item in enumerate(context.items[:-1]):
        if not item.autocontinue:
            yield Issue(
                index,
                "autocontinue is off: PX4 does not go on to the next item",
                "set autocontinue, the last field of the row",
            )


@RULES.error(
    "px4-roi",
    "PX4 refuses this kind of region of interest (INVALID_PARAM1)",
    "PX4 1.16 MavlinkMissionManager::parse_mavlink_mission_item",
)
def _roi(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(*_ROI):
        allowed = _ROI_WITHOUT_PLACE if item.frame == Frame.MISSION else _ROI_WITH_PLACE
        mode = item.params[0]
        if math.isnan(mode) or math.trunc(mode) not in allowed:
            yield Issue(
                index,
                f"region of interest {mode:g} in frame {item.frame}; PX4 takes "
                f"{', '.join(map(str, allowed))} there",
                "use DO_SET_ROI_LOCATION (195) or DO_SET_ROI_NONE (197)",
            )


@RULES.warning(
    "px4-fence-size",
    "more fence vertices or rally points than small PX4 boards store",
    "PX4: 64 fence vertices and 8 rally points on the smallest boards",
)
def _fence_size(context: ValidationContext) -> Iterator[Issue]:
    fence, dialect = context.mission.fence, context.vehicle.type.dialect
    vertices = sum(len(polygon.vertices) for polygon in fence.polygons) + len(fence.circles)
    for count, limit, what in (
        (vertices, dialect.fence_rows, "fence vertices"),
        (len(context.mission.rally), dialect.rally_rows, "rally points"),
    ):
        if count > limit:
            yield Issue(
                None,
                f"{count} {what}; the smallest boards store {limit}",
                "use fewer, or check that your board stores them",
            )
