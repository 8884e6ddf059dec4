"""Plans and trajectories for the tests of missions."""

from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np
from conftest import FLYABLE, edited

from faao_mav.arrays import Real
from faao_mav.mission import Command, Frame, Mission
from faao_mav.plan import Plan, parse_plan
from faao_mav.schedule import Conversion, convert
from faao_mav.schedule.assemble import assemble
from faao_mav.schedule.route import initial_route

Trajectory: TypeAlias = tuple[Real, Real]


def plan_with(*, recommend: bool = False, **changes: Any) -> Plan:
    """Return a plan with values of its vehicle and mission by their keys.

    The radio and the flight's ends play no part in a mission.
    """
    values: dict[str, Any] = {
        "vehicle": {"max_speed": 8.0, "max_acceleration": 1.5},
        "flight.start": [0, 350],
        "flight.end": [350, 0],
        "flight.altitude": 100,
        "flight.duration": 120,
        "flight.start_velocity": "free",
        "flight.end_velocity": "free",
        "mission.parameters": "recommend" if recommend else "keep",
    }
    for key, value in changes.items():
        of_vehicle = key in ("autopilot", "type", "max_speed", "min_speed", "parameters")
        values[f"{'vehicle' if of_vehicle else 'mission'}.{key}"] = value
    return parse_plan(edited(FLYABLE, values))


def dash(begin: float, end: float, top: float, acceleration: float, t: Real) -> Real:
    """Return positions along a line, from rest to rest, as fast as the limits allow."""
    length = end - begin
    top = min(top, float(np.sqrt(length * acceleration)))
    ramp = top / acceleration
    cruise = (length - top * ramp) / top
    speeds = ([0.0, ramp, ramp + cruise, 2 * ramp + cruise], [0.0, top, top, 0.0])
    fine = np.linspace(0.0, speeds[0][-1], 20_001)
    v = np.interp(fine, *speeds)
    s = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(fine))])
    result: Real = begin + np.interp(t, fine, s)
    return result


def dash_hover_dash(hover: float = 40.0, step: float = 0.2) -> Trajectory:
    """Return two dashes of 250 m with a hover of about `hover` seconds between them."""
    lasting = 250 / 8 + 8 / 1.5
    t = np.arange(0.0, 2 * lasting + hover + step, step)
    first = dash(0.0, 250.0, 8.0, 1.5, t)
    second = dash(0.0, 250.0, 8.0, 1.5, np.maximum(t - lasting - hover, 0.0))
    w = np.outer(first, [0.6, -0.8]) + np.outer(second, [0.8, 0.6]) + [0.0, 350.0]
    return t, w


def converted(t: Real, w: Real, plan: Plan) -> Conversion:
    """Return the conversion of a bare trajectory."""
    return convert(SimpleNamespace(plan=plan, t=t, w=w))  # type: ignore[arg-type]


def mission_of(t: Real, w: Real, plan: Plan) -> Mission:
    """Return the mission that flies a bare trajectory."""
    return assemble(initial_route(t, w, plan), plan)


def items_of(mission: Mission, plan: Plan) -> tuple[Real, list[float], list[float]]:
    """Return positions, speeds and holds of the route that the mission's items make."""
    assert [item.command for item in mission.items[:2]].count(Command.NAV_TAKEOFF) == int(
        plan.mission.takeoff
    )
    begin = 1 if plan.mission.takeoff else 0
    speed, before, points, speeds, holds = np.nan, None, [], [], []
    for item in mission.items[begin:-1]:
        if item.command == Command.DO_CHANGE_SPEED:
            assert item.frame == Frame.MISSION
            assert item.params[0::2] == (1.0, -1.0)
            assert before != Command.DO_CHANGE_SPEED
            assert item.params[1] != speed
            speed = item.params[1]
        elif item.command == Command.NAV_DELAY:
            assert item.frame == Frame.MISSION
            assert before == Command.NAV_WAYPOINT
            holds[-1] += item.params[0]
        else:
            assert item.command == Command.NAV_WAYPOINT
            assert item.frame == Frame.GLOBAL_RELATIVE_ALT
            assert item.z == plan.flight.altitude
            points.append(item)
            speeds.append(speed)
            holds.append(item.params[0])
        before = item.command
    assert before in (Command.NAV_WAYPOINT, Command.NAV_DELAY)
    assert speeds[0] == plan.vehicle.max_speed
    positions = plan.origin.frame.to_local([p.x for p in points], [p.y for p in points])
    return positions, speeds[1:], holds
