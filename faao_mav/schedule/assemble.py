"""From a route to mission items: take-off, the way to w_I, the route, the end."""

from typing import TYPE_CHECKING

from faao_mav.errors import InfeasibleError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.schedule.route import Route
from faao_mav.vehicle import vehicle_of

if TYPE_CHECKING:
    from faao_mav.plan import Plan

_DECIMALS = 9  # of a degree: 0.1 mm

_AIRSPEED, _GROUND_SPEED = 0.0, 1.0
"""Types of DO_CHANGE_SPEED. ArduPlane takes the second for the least ground speed."""

_PITCH = 15.0
"""Degrees by which a plane climbs at least until it is at its altitude."""


def assemble(route: Route, plan: "Plan") -> Mission:
    """Return the mission that flies `route` at `plan.flight.altitude` above the origin.

    Home is the plan's origin. The items: TAKEOFF there, if the plan asks for it; the way to w_I
    at the vehicle's greatest speed, a plane's at the speed that it begins with; for each leg its
    waypoint, before it a DO_CHANGE_SPEED where the speed is another, after it a NAV_DELAY where
    the wait has a fraction that the autopilot would not keep; and what `plan.mission.on_finish`
    says. Unused parameters are 0: ArduPilot refuses NaN.

    Raises `InfeasibleError` if home and items are more than `plan.mission.max_items`.
    """
    origin, altitude = plan.origin, plan.flight.altitude
    latitudes, longitudes = LocalFrame(origin.latitude, origin.longitude).to_geodetic(
        route.positions
    )
    places = [
        (round(float(x), _DECIMALS), round(float(y), _DECIMALS))
        for x, y in zip(latitudes, longitudes, strict=True)
    ]

    vehicle_type = vehicle_of(plan).type
    plane, whole_seconds = not vehicle_type.hovers, vehicle_type.whole_second_holds
    axis = _AIRSPEED if plane else _GROUND_SPEED
    items = []
    if plan.mission.takeoff:
        # At 0, 0 ("here" for ArduPilot) PX4 would fly to the Gulf of Guinea.
        here = (round(origin.latitude, _DECIMALS), round(origin.longitude, _DECIMALS))
        items.append(_at(Command.NAV_TAKEOFF, here, altitude, _PITCH if plane else 0.0))
    commanded = (
        float(route.speeds[0]) if plane else min(plan.vehicle.max_speed, vehicle_type.fastest)
    )
    items.append(_change_speed(commanded, axis))
    for k, place in enumerate(places):
        speed = float(route.speeds[k - 1]) if k else commanded
        if speed != commanded:
            items.append(_change_speed(speed, axis))
            commanded = speed
        hold, delay = float(route.holds[k]), float(route.delays[k])
        if not whole_seconds:
            hold, delay = hold + delay, 0.0
        items.append(
            _waypoint(place, altitude, hold, float(route.radii[k]), spline=bool(route.splines[k]))
        )
        if delay > 0:
            items.append(MissionItem(Command.NAV_DELAY, Frame.MISSION, (delay, -1.0, -1.0, -1.0)))
    items.append(_finish(plan, places[-1]))

    rows = len(items) + 1
    if rows > plan.mission.max_items:
        raise InfeasibleError(
            f"the mission needs {rows} items with home, mission.max_items is "
            f"{plan.mission.max_items}; raise mission.max_items (if the autopilot stores as many) "
            f"or mission.path_tolerance (now {plan.mission.path_tolerance:g} m)"
        )
    return Mission(tuple(items), Home(origin.latitude, origin.longitude, origin.elevation))


def _finish(plan: "Plan", place: tuple[float, float]) -> MissionItem:
    match plan.mission.on_finish:
        case "rtl":
            return MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION)
        case "land":
            return _at(Command.NAV_LAND, place, 0.0)
        case "hover":
            return _at(Command.NAV_LOITER_UNLIM, place, plan.flight.altitude)


def _waypoint(
    place: tuple[float, float], altitude: float, hold: float, radius: float, *, spline: bool
) -> MissionItem:
    command = Command.NAV_SPLINE_WAYPOINT if spline else Command.NAV_WAYPOINT
    frame = Frame.GLOBAL_RELATIVE_ALT
    params = (hold, radius, 0.0, 0.0)
    return MissionItem(command, frame, params, *place, float(altitude))


def _at(
    command: Command, place: tuple[float, float], altitude: float, param1: float = 0.0
) -> MissionItem:
    frame = Frame.GLOBAL_RELATIVE_ALT
    return MissionItem(command, frame, (param1, 0.0, 0.0, 0.0), *place, float(altitude))


def _change_speed(speed: float, axis: float) -> MissionItem:
    # throttle -1 leaves it alone
    return MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, (axis, float(speed), -1.0, 0.0))
