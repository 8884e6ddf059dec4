"""From a route to mission items: take-off, the way to w_I, the route, the way home, the end.

The ways between home and the route keep the plan's margin from the fence's edge.
"""

from functools import lru_cache

import numpy as np
import shapely

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError, InputError
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.fence_area import FreeArea
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.plan import Plan
from faao_mav.plan.fence import edge_of, margin_key, trouble
from faao_mav.schedule.route import Route
from faao_mav.schedule.timing import SHORTEST_HOLD

ROUNDING = 0.012
"""By how much, m, a way may be nearer to the edge than it should: places are sent in 1e-7 degrees,
11 mm."""

_SIMPLER = (4.0, 1.0)
"""By how much, m, a way may keep farther from the edge than it has to, for fewer corners. Chosen:
around a circle of 60 m they are 30 m apart."""

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
            f"{plan.source}: the mission needs {rows} items with home, mission.max_items is "
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


def check_transit(plan: Plan) -> None:
    """Raise where no flight of `plan` gets from home to flight.start, and back if it has to.

    `InputError` for a home that is nearer to the edge than the plan's margin,
    `InfeasibleError` where there is no way.
    """
    way_out(plan, np.array(plan.flight.start))
    way_home(plan, np.array(plan.flight.end))


def way_out(plan: Plan, first: Real) -> Real:
    """Return the corners (k, 2), m, on the way from home to `first` (2,); errors as above."""
    return _corners(plan, np.zeros(2), first, "home (site.origin) to flight.start")


def way_home(plan: Plan, last: Real) -> Real:
    """Return the corners (k, 2), m, after which a return to launch from `last` (2,) is straight.

    There are none unless the mission ends with one. Errors as above.
    """
    if plan.mission.on_finish != "rtl":
        return np.empty((0, 2))
    return _corners(plan, last, np.zeros(2), "flight.end to home (site.origin)")


def way_between(plan: Plan, start: Real, end: Real) -> Real | None:
    """Return the corners (k, 2), m, of a way from `start` to `end`, both (2,), which are its ends.

    It keeps the plan's margin from the edge of the fence, where `start` is nearer to it from the
    nearest place on that does. None where there is no such way inside the fence.
    """
    fence, margin = plan.keep_in, plan.margin
    if fence is None or (kept := _kept(fence, margin)).covers_path(np.array([start, end])):
        return np.array([start, end])
    before, begin = [], start
    if not kept.covers(start[None]).all():
        within = fence.inside(margin)
        if within.empty:
            return None
        begin = within.nearest(start, end)
        if not fence.covers_path(np.array([start, begin])):
            return None
        before = [start]
    way = _way(fence, margin, begin, end)
    return None if way is None else np.array([*before, *way])


def check_run_in(plan: Plan, route: Route) -> None:
    """Raise `InfeasibleError` where a leg before w_I or after w_F comes nearer to the edge."""
    fence, last = plan.keep_in, len(route.positions) - 1
    if fence is None:
        return
    area = _kept(fence, plan.margin)
    legs = ((0, route.first, "start"), (route.last, last, "end"))
    for begin, end, name in legs:
        leg = route.positions[begin : end + 1]
        if len(leg) > 1 and not area.covers_path(leg):
            raise InfeasibleError(
                f"{plan.source}: {edge_of(plan)}: the aircraft takes "
                f"{route.leg_lengths[begin]:.0f} m to get up "
                f"to speed before flight.start, or to slow down after flight.end, and at "
                f"flight.{name} that leg comes nearer to the edge than {plan.margin:g} m "
                f"({margin_key(plan)}): give flight.{name}_velocity: hover, or move flight.{name}"
            )


def _corners(plan: Plan, start: Real, end: Real, name: str) -> Real:
    fence, margin = plan.keep_in, plan.margin
    if fence is None:
        return np.empty((0, 2))
    if not _kept(fence, margin).covers(np.zeros((1, 2))).all():
        raise InputError(
            f"{plan.source}: site.origin: home, where the mission takes off, is "
            f"{trouble(plan, (0.0, 0.0))}"
        )
    way = _way(fence, margin, start, end)
    if way is None:
        raise InfeasibleError(
            f"{edge_of(plan)}: no way leads from {name} that keeps {margin:g} m "
            f"({margin_key(plan)}) from the edge; give a smaller margin, move home, or change the "
            f"{edge_of(plan)}"
        )
    return way[1:-1]


def _way(fence: FreeArea, margin: float, start: Real, end: Real) -> Real | None:
    """Return the corners (k, 2) of a short way with few of them: the aircraft stops at each.

    It keeps the `margin`, m, from the edge of `fence`. None where there is no way.
    """
    area = _kept(fence, margin)
    for simpler in _SIMPLER:
        offset = -(margin + simpler)
        coarse = fence.shape.buffer(offset, join_style="mitre", mitre_limit=2).simplify(simpler)
        if coarse.is_empty:
            continue
        places = shapely.points(np.array([start, end]))
        links = shapely.get_coordinates(shapely.shortest_line(coarse, places))[::2]
        middle = FreeArea(coarse).shortest_way(*links)
        if middle is not None and area.covers_path(np.vstack([start, middle, end])):
            return _straightened(area, np.vstack([start, middle, end]))
    return area.shortest_way(start, end)


def _straightened(area: FreeArea, way: Real) -> Real:
    """Return `way` (k, 2) without the corners that the straight past them makes needless."""
    kept = [0]
    for k in range(1, len(way) - 1):
        if not area.covers_path(way[[kept[-1], k + 1]]):
            kept.append(k)
    return way[[*kept, -1]]


@lru_cache(maxsize=8)
def _kept(fence: FreeArea, margin: float) -> FreeArea:
    """Return where a `fence` and a `margin`, m, let the aircraft be."""
    return fence.inside(max(margin - ROUNDING, 0.0))
