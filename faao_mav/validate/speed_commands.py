"""What becomes of the speed that a DO_CHANGE_SPEED asks for."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import Command
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Issue, Rules

_COPTERS, _ARDUPILOT, _PX4 = Rules(), Rules("ardupilot"), Rules("px4")

_MEASURED = "measured on PX4 1.16.1"


def _asked(context: ValidationContext) -> Iterator[tuple[int, float, float]]:
    """Yield index, type and speed, m/s, of each DO_CHANGE_SPEED."""
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        yield index, *item.params[:2]


@_ARDUPILOT.warning(
    "ardupilot-speed-ignored", "measured on ArduCopter 4.7; ArduPlane 4.7 Plane::do_change_speed"
)
def _ignored(context: ValidationContext) -> Iterator[Issue]:
    """ArduPilot does nothing on this DO_CHANGE_SPEED."""
    for index, kind, speed in _asked(context):
        item = context.items[index]
        throttle = 0.0 if context.vehicle.type.hovers else item.params[2]
        if context.vehicle.type.dialect.speed_change(item) is None and not throttle > 0:
            yield Issue(
                index,
                f"speed type {kind:g} with {speed:g} m/s does nothing: the speed before stays in "
                "force",
                "give type 0 in param1 and a speed above 0 in param2, or remove the item",
            )


@_COPTERS.note("speed-lean", "the drag of vehicle.body, and the lean limit", kind="copter")
def _lean(context: ValidationContext) -> Iterator[Issue]:
    """Faster than the airframe that predictions assume flies at the lean limit."""
    vehicle, top = context.vehicle, context.vehicle.top_airspeed
    asked = []
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        change = vehicle.type.dialect.speed_change(item)
        if change is not None and change.axis == "horizontal" and change.speed is not None:
            asked.append((change.speed, index))
    fastest, at = max(asked, key=lambda each: each[0], default=(0.0, 0))
    if fastest > top:
        angle = round(math.degrees(vehicle.value("lean_angle")), 9)
        yield Issue(
            at,
            f"{fastest:g} m/s; with a lean of at most {angle:g} degrees "
            f"({vehicle.name_of('lean_angle')}) the predicted aircraft gets to {top:.1f} in calm "
            f"air: this {vehicle.assumption}",
            "nothing, if yours is faster; else ask for less, or let it lean more",
        )


@_ARDUPILOT.warning("ardupilot-plane-speed", "ArduPlane 4.7 Plane::do_change_speed", kind="plane")
def _ardupilot_plane(context: ValidationContext) -> Iterator[Issue]:
    """An airspeed outside what ArduPlane allows is not flown."""
    return _plane(context, (0,), "AIRSPEED_MIN, AIRSPEED_MAX")


@_PX4.warning("px4-plane-speed", "PX4 1.16: FW_AIRSPD_MIN, FW_AIRSPD_MAX", kind="plane")
def _px4_plane(context: ValidationContext) -> Iterator[Issue]:
    """An airspeed outside what PX4 flies a plane at."""
    return _plane(context, None, "FW_AIRSPD_MIN, FW_AIRSPD_MAX")


def _plane(
    context: ValidationContext, kinds: tuple[float, ...] | None, names: str
) -> Iterator[Issue]:
    """Yield the airspeeds, asked for by one of `kinds`, outside those that a plane flies."""
    least, top = context.vehicle.value("min_speed"), context.vehicle.value("max_speed")
    for index, kind, speed in _asked(context):
        if (kinds is None or kind in kinds) and speed > 0 and not least <= speed <= top:
            yield Issue(
                index,
                f"an airspeed of {speed:g} m/s; the plane flies {least:g} to {top:g} m/s ({names})",
                "ask for a speed in between",
            )


@_PX4.warning("px4-speed-default", _MEASURED)
def _default(context: ValidationContext) -> Iterator[Issue]:
    """A DO_CHANGE_SPEED without a speed above 0 sets the default speed."""
    default, name = context.vehicle.value("cruise_speed"), context.vehicle.name_of("cruise_speed")
    for index, _, speed in _asked(context):
        if not speed > 0:
            yield Issue(
                index,
                f"a speed of {speed:g} m/s sets the default of {default:g} m/s ({name})",
                "give the speed in param2, unless you mean the default",
            )


@_PX4.warning("px4-speed-type", _MEASURED, kind="copter")
def _type(context: ValidationContext) -> Iterator[Issue]:
    """PX4 takes a climb or descent speed for the horizontal speed."""
    for index, kind, speed in _asked(context):
        if kind in (2, 3) and speed > 0:
            yield Issue(
                index,
                f"speed type {kind:g} is ignored: {speed:g} m/s become the horizontal speed",
                "remove the item and set MPC_Z_V_AUTO_UP and MPC_Z_V_AUTO_DN instead",
            )


@_PX4.warning("px4-speed-capped", f"{_MEASURED}: capped at MPC_XY_VEL_MAX", kind="copter")
def _capped(context: ValidationContext) -> Iterator[Issue]:
    """Faster than PX4 flies."""
    limit, name = context.vehicle.value("max_speed"), context.vehicle.name_of("max_speed")
    for index, _, speed in _asked(context):
        if speed > limit:
            yield Issue(
                index,
                f"{speed:g} m/s; PX4 flies at most {limit:g} m/s ({name})",
                f"ask for {limit:g} m/s or less, or raise MPC_XY_VEL_MAX",
            )


RULES = [*_COPTERS, *_ARDUPILOT, *_PX4]
