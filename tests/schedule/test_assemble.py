"""From a route to mission items."""

from dataclasses import replace

import numpy as np
import pytest
from relay_flights import dash_hover_dash, items_of, mission_of, plan_with

from faao_mav.errors import InfeasibleError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Frame, Home
from faao_mav.schedule.assemble import assemble
from faao_mav.schedule.initial_route import initial_route


def test_the_items_of_a_mission() -> None:
    t, w = dash_hover_dash()
    plan = plan_with()
    mission = mission_of(t, w, plan)
    assert mission.home == Home(-35.363262, 149.165237, 584.0)
    takeoff, speed, way = mission.items[:3]
    assert (takeoff.command, takeoff.frame, takeoff.z) == (22, 3, 100.0)
    assert (takeoff.x, takeoff.y) == (-35.363262, 149.165237)
    assert (speed.command, speed.frame, speed.params) == (178, 2, (1.0, 8.0, -1.0, 0.0))
    assert (way.command, way.params) == (16, (0.0, 0.0, 0.0, 0.0))
    assert mission.items[-1].command == Command.NAV_RETURN_TO_LAUNCH
    assert mission.items[-1].frame == Frame.MISSION
    assert all(item.x == round(item.x, 9) and item.y == round(item.y, 9) for item in mission.items)


def test_a_take_off_is_left_out_on_request() -> None:
    mission = mission_of(*dash_hover_dash(), plan_with(takeoff=False))
    assert mission.items[0].command == Command.DO_CHANGE_SPEED
    assert mission.items[1].command == Command.NAV_WAYPOINT


@pytest.mark.parametrize(
    ("on_finish", "command", "frame", "z"),
    [("rtl", 20, 2, 0.0), ("land", 21, 3, 0.0), ("hover", 17, 3, 100.0)],
)
def test_endings(on_finish: str, command: int, frame: int, z: float) -> None:
    t, w = dash_hover_dash()
    last = mission_of(t, w, plan_with(on_finish=on_finish)).items[-1]
    assert (last.command, last.frame, last.z) == (command, frame, z)
    if on_finish != "rtl":
        place = LocalFrame(-35.363262, 149.165237).to_local(last.x, last.y)
        assert place == pytest.approx(w[-1], abs=1e-3)


def test_too_many_items_are_counted() -> None:
    t, w = dash_hover_dash()
    rows = len(mission_of(t, w, plan_with()).items) + 1
    mission_of(t, w, plan_with(max_items=rows))
    expected = rf"needs {rows} items .*max_items is {rows - 1}; raise .*path_tolerance \(now 2 m\)"
    with pytest.raises(InfeasibleError, match=expected):
        mission_of(t, w, plan_with(max_items=rows - 1))


def test_a_speed_is_commanded_where_it_changes() -> None:
    plan = plan_with()
    route = initial_route(*dash_hover_dash(), plan)
    places = np.array([[0.0, 0.0], [50, 0], [100, 0], [150, 0], [200, 0], [250, 0]])
    still = np.zeros(len(places))
    route = replace(
        route,
        positions=places,
        speeds=np.array([8.0, 5.5, 5.5, 3.0, 8.0]),
        waits=still,
        radii=still,
    )
    mission = assemble(route, plan)
    commanded = [i.params[1] for i in mission.items if i.command == Command.DO_CHANGE_SPEED]
    assert commanded == [8.0, 5.5, 3.0, 8.0]
    _, speeds, _ = items_of(mission, plan)
    assert speeds == list(route.speeds)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_wait_of_a_fraction_is_what_the_autopilot_keeps(autopilot: str) -> None:
    plan = plan_with(autopilot=autopilot)
    route = initial_route(*dash_hover_dash(), plan)
    mission = assemble(replace(route, waits=np.array([0.0, 39.7, 5.0])), plan)
    _, _, waits = items_of(mission, plan)
    assert waits == pytest.approx([0.0, 39.7, 5.0])
    commands = [item.command for item in mission.items]
    assert (Command.NAV_DELAY in commands) == (autopilot == "ardupilot")
    own = [item.params[0] for item in mission.items if item.command == Command.NAV_WAYPOINT]
    if autopilot == "ardupilot":  # which would drop the fraction
        assert own == [0.0, 39.0, 5.0]
        delay = mission.items[commands.index(Command.NAV_DELAY)]
        assert delay.params == pytest.approx((0.7, -1.0, -1.0, -1.0))


def test_acceptance_radii_are_passed_on() -> None:
    plan = plan_with(autopilot="px4")
    route = initial_route(*dash_hover_dash(), plan)
    mission = assemble(replace(route, radii=np.array([0.0, 3.5, 0.0])), plan)
    waypoints = [item for item in mission.items if item.command == Command.NAV_WAYPOINT]
    assert [item.params[1] for item in waypoints] == [0.0, 3.5, 0.0]
