"""From a route to mission items: take-off, the way to w_I, the route, the end."""

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.plan import Plan
from faao_mav.schedule.route import Route
from faao_mav.schedule.timing import SHORTEST_HOLD
from faao_mav.schedule.transit import check_run_in, way_home, way_out

_PITCH = 15.0  # the least pitch of a plane's climb after take-off, degrees; chosen


def assemble(route: Route, plan: Plan) -> Mission:
    """Return the mission that flies `route` at `plan.flight.altitude` above the origin.

    Home is the plan's origin. The items: TAKEOFF there, if the plan asks for it; the way to w_I
    at the vehicle's greatest speed, a plane's at the speed that it begins with; for each leg its
    waypoint, before it a DO_CHANGE_SPEED where the speed is another, after it a NAV_DELAY where
    the wait has a fraction that the autopilot would not keep; and what `plan.mission.on_finish`
    says. Unused parameters are 0: ArduPilot refuses NaN. The fence is the plan's: the ways from
    and to home go around it, and the aircraft stops at their corners, so as not to cut them.

    Raises `InfeasibleError` if home and items are more than `plan.mission.max_items`, or where the
    fence leaves no way.
    """
    origin, altitude = plan.origin, plan.flight.altitude
    check_run_in(plan, route)
    places, out, back = (
        _places(each, plan)
        for each in (
            route.positions,
            way_out(plan, route.positions[0]),
            way_home(plan, route.positions[-1]),
        )
    )

    vehicle = plan.aircraft.type
    # Types of DO_CHANGE_SPEED: 1, ground speed, is the least one to ArduPlane; 0 is airspeed.
    axis = 1.0 if vehicle.hovers else 0.0
    items = []
    if plan.mission.takeoff:
        # At 0, 0 ("here" for ArduPilot) PX4 would fly to the Gulf of Guinea.
        (here,), pitch = _places(np.zeros((1, 2)), plan), 0.0 if vehicle.hovers else _PITCH
        items.append(_at(Command.NAV_TAKEOFF, here, altitude, pitch))
    fastest = min(plan.vehicle.max_speed, vehicle.fastest)
    commanded = fastest if vehicle.hovers else float(route.speeds[0])
    items.append(_change_speed(commanded, axis))
    stop = SHORTEST_HOLD if vehicle.hovers else 0.0
    items += [_at(Command.NAV_WAYPOINT, place, altitude, stop) for place in out]
    holds = np.floor(route.waits) if vehicle.whole_second_holds else route.waits
    delays = np.round(route.waits - holds, 9)
    for k, place in enumerate(places):
        speed = float(route.speeds[k - 1]) if k else commanded
        if speed != commanded:
            items.append(_change_speed(speed, axis))
            commanded = speed
        items.append(
            _at(Command.NAV_WAYPOINT, place, altitude, float(holds[k]), float(route.radii[k]))
        )
        if delays[k] > 0:
            params = (float(delays[k]), -1.0, -1.0, -1.0)
            items.append(MissionItem(Command.NAV_DELAY, Frame.MISSION, params))
    if back and vehicle.hovers and commanded != fastest:
        items.append(_change_speed(fastest, axis))
    items += [_at(Command.NAV_WAYPOINT, place, altitude, stop) for place in back]
    items.append(_finish(plan, places[-1]))

    rows = len(items) + 1
    if rows > plan.mission.max_items:
        raise InfeasibleError(
            f"the mission needs {rows} items with home, mission.max_items is "
            f"{plan.mission.max_items}; raise mission.max_items (if the autopilot stores as many) "
            f"or mission.path_tolerance (now {plan.mission.path_tolerance:g} m)"
        )
    home = Home(origin.latitude, origin.longitude, origin.elevation)
    return Mission(tuple(items), home, plan.geofence)


def _places(positions: Real, plan: Plan) -> list[tuple[float, float]]:
    """Return `positions` (k, 2), m, in degrees, to 0.1 mm."""
    degrees = np.round(plan.origin.frame.to_geodetic(positions), 9)
    return [(latitude, longitude) for latitude, longitude in degrees.T.tolist()]


def _finish(plan: Plan, place: tuple[float, float]) -> MissionItem:
    match plan.mission.on_finish:
        case "rtl":
            return MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION)
        case "land":
            return _at(Command.NAV_LAND, place, 0.0)
        case "hover":
            return _at(Command.NAV_LOITER_UNLIM, place, plan.flight.altitude)


def _at(
    command: Command, place: tuple[float, float], altitude: float, *params: float
) -> MissionItem:
    """Return an item at `place` (degrees) whose first parameters are `params`."""
    frame = Frame.GLOBAL_RELATIVE_ALT
    first, second, third, fourth = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, frame, (first, second, third, fourth), *place, float(altitude))


def _change_speed(speed: float, axis: float) -> MissionItem:
    # throttle -1 leaves it alone
    return MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, (axis, float(speed), -1.0, 0.0))
