"""From a route to mission items."""

from dataclasses import replace

import numpy as np
import pytest
from relay_flights import dash_hover_dash, items_of, mission_of, plan_with

from faao_mav.errors import InfeasibleError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Frame, Home
from faao_mav.schedule.assemble import assemble
from faao_mav.schedule.route import initial_route


def test_the_items_of_a_mission() -> None:
    t, w = dash_hover_dash()
    mission = mission_of(t, w, plan_with())
    assert mission.home == Home(-35.363262, 149.165237, 584.0)
    takeoff, speed, way = mission.items[:3]
    assert (takeoff.command, takeoff.frame, takeoff.z) == (22, 3, 100.0)
    assert (takeoff.x, takeoff.y) == (-35.363262, 149.165237)
    assert (speed.command, speed.frame, speed.params) == (178, 2, (1.0, 8.0, -1.0, 0.0))
    assert (way.command, way.params) == (16, (0.0, 0.0, 0.0, 0.0))
    assert all(item.x == round(item.x, 9) and item.y == round(item.y, 9) for item in mission.items)
    for on_finish, *expected in (
        ("rtl", 20, 2, 0.0),
        ("land", 21, 3, 0.0),
        ("hover", 17, 3, 100.0),
    ):
        last = mission_of(t, w, plan_with(on_finish=on_finish)).items[-1]
        assert [last.command, last.frame, last.z] == expected
        if on_finish != "rtl":
            place = LocalFrame(-35.363262, 149.165237).to_local(last.x, last.y)
            assert place == pytest.approx(w[-1], abs=1e-3)
    kinds = [item.command for item in mission_of(t, w, plan_with(takeoff=False)).items[:2]]
    assert kinds == [Command.DO_CHANGE_SPEED, Command.NAV_WAYPOINT]


def test_too_many_items_are_counted() -> None:
    t, w = dash_hover_dash()
    rows = len(mission_of(t, w, plan_with()).items) + 1
    mission_of(t, w, plan_with(max_items=rows))
    expected = rf"needs {rows} items .*max_items is {rows - 1}; raise .*path_tolerance \(now 2 m\)"
    with pytest.raises(InfeasibleError, match=expected):
        mission_of(t, w, plan_with(max_items=rows - 1))


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_waits_are_what_the_autopilot_keeps_and_radii_are_passed_on(autopilot: str) -> None:
    plan = plan_with(autopilot=autopilot)
    route = initial_route(*dash_hover_dash(), plan)
    waits, radii = np.array([0.0, 39.7, 5.0]), np.array([0.0, 3.5, 0.0])
    mission = assemble(replace(route, waits=waits, radii=radii), plan)
    assert items_of(mission, plan)[2] == pytest.approx(waits)
    waypoints = [item for item in mission.items if item.command == Command.NAV_WAYPOINT]
    assert [item.params[1] for item in waypoints] == [0.0, 3.5, 0.0]
    delays = [item for item in mission.items if item.command == Command.NAV_DELAY]
    if autopilot == "ardupilot":  # which would drop the fraction
        assert [item.params[0] for item in waypoints] == [0.0, 39.0, 5.0]
        assert delays[0].frame == Frame.MISSION
        assert delays[0].params == pytest.approx((0.7, -1.0, -1.0, -1.0))
    else:
        assert not delays
