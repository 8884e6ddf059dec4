"""From a route to mission items, by ways around the fence, and what no vehicle flies."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from relay_flights import dash_hover_dash, items_of, mission_of, plan_with

from faao_mav import Vehicle
from faao_mav.autopilot.predict import predict
from faao_mav.errors import InfeasibleError, InputError, PlanError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Frame, Home, Mission
from faao_mav.plan import Plan, parse_plan
from faao_mav.schedule.assemble import assemble, check_transit, way_home, way_out
from faao_mav.schedule.conversion import beyond_vehicle, check_vehicle
from faao_mav.schedule.route import initial_route, with_run_in


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
    t, w = dash_hover_dash()
    rows = len(mission_of(t, w, plan_with()).items) + 1
    mission_of(t, w, plan_with(max_items=rows))
    told = rf"needs {rows} items .*max_items is {rows - 1}; raise .*path_tolerance \(now 2 m\)"
    with pytest.raises(InfeasibleError, match=told):
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


PX4 = {"autopilot": "px4"}
TILT = {"parameters": {"MPC_TILTMAX_AIR": 20}}
PLANE = {"type": "plane", "min_speed": 12, "max_speed": 16, "parameters": {"ROLL_LIMIT_DEG": 30}}


def test_what_is_accepted_follows_the_parameters() -> None:
    quick, told_most = {"parameters": {"WPNAV_ACCEL": 700}}, "the most that it is told"
    cases: tuple[tuple[bool, dict[str, Any], dict[float, str]], ...] = (
        (True, {}, {20: told_most, 5: "WP_ACC"}),
        (False, {}, {20: told_most, 2.5: "WP_ACC, its default"}),
        (False, quick, {20: "", 5.6: "ATC_ANGLE_MAX, its default"}),
        (True, PX4, {20: "", 9.8: "MPC_TILTMAX_AIR, its default"}),
        (False, PX4, {12: "MPC_XY_VEL_MAX, its default", 3: "MPC_ACC_HOR, its default"}),
        (True, PX4 | TILT, {20: "", 3.5: "MPC_TILTMAX_AIR"}),
        (True, PLANE, {5.6: "ROLL_LIMIT_DEG"}),
    )
    for recommend, vehicle, most in cases:
        plan = plan_with(recommend=recommend, **vehicle)
        beyond = {"vehicle.max_speed": 25, "vehicle.max_acceleration": 50}
        lines = beyond_vehicle(plan.changed(beyond))
        for line, (limit, why) in zip(lines, most.items(), strict=True):
            assert re.findall(r"at most (\S+) m/s", line) == [f"{limit:g}"]
            assert f"({why}" in line
        speed, acceleration = [16, *most][-2:]
        within = {"vehicle.max_speed": speed, "vehicle.max_acceleration": acceleration}
        assert beyond_vehicle(plan.changed(within)) == []
    (line,) = beyond_vehicle(plan_with(recommend=True, max_speed=25))
    assert line == (
        "plan: vehicle.max_speed: 25 m/s; ArduCopter keeps plans of at most 20 m/s "
        "(the most that it is told)"
    )
    slow = plan_with(recommend=True).changed({"vehicle.max_speed": 0.05, "flight.end": [0, 350]})
    with pytest.raises(InputError, match=r"vehicle\.max_speed: 0\.05 m/s; missions command 0\.1"):
        check_vehicle(slow)
    with pytest.raises(InputError, match=r"vehicle\.parameters.*WPNAV_JERK: 0"):
        check_vehicle(plan_with(parameters={"WPNAV_JERK": 0.0}))


WALL = {"polygon": [[-60, 15], [60, 15], [60, 30], [-60, 30]]}
ROUND = {"center": [150, 25], "radius": 20}
T, W = np.arange(0.0, 61.0), np.linspace([0.0, 60.0], [300.0, 60.0], 61)


def walled(**changes: Any) -> Plan:
    """From [0, 60] to [300, 60] past a wall before home, and a round zone on the way back."""
    flight = {"flight.start": [0, 60], "flight.end": [300, 60], "flight.duration": 60}
    hovering = {"flight.start_velocity": "hover", "flight.end_velocity": "hover"}
    fence = {"fence.exclusion": [WALL, ROUND], "fence.margin": 4}
    return parse_plan(edited(FLYABLE, flight | hovering | fence | changes))


def ways_of(mission: Mission, plan: Plan) -> list[list[float]]:
    """Return the places of the items in local metres, home first and, for a return, last."""
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    places = [frame.to_local(item.x, item.y).tolist() for item in mission.items if item.x]
    returns = mission.items[-1].command == Command.NAV_RETURN_TO_LAUNCH
    return [[0.0, 0.0], *places, *([[0.0, 0.0]] if returns else [])]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_mission_goes_around_what_lies_between_home_and_the_route(autopilot: str) -> None:
    plan = walled(**{"vehicle.autopilot": autopilot})
    mission = assemble(initial_route(T, W, plan), plan)
    assert mission.fence == plan.geofence
    area = plan.keep_in
    assert area is not None
    assert area.clearance(np.array(ways_of(mission, plan))) >= 4 - 0.01
    track = predict(mission, Vehicle(autopilot))
    assert area.clearance(track.position[:, :2]) > 2
    corners = [item for item in mission.items if item.command == 16 and item.params[0] == 1.0]
    assert 3 <= len(corners) <= 6  # the aircraft stops at each
    speeds = [item.params[1] for item in mission.items if item.command == 178]
    assert speeds[0] == speeds[-1] == 10.0 > max(speeds[1:-1])  # slower on the route alone


def test_homes_and_ways_that_cannot_be_are_named() -> None:
    wall = {"polygon": [[-400, 15], [400, 15], [400, 30], [-400, 30]]}
    cell = [[-300, -100], [400, -100], [400, 300], [-300, 300]]
    near, inside = ([{"center": [x, 0], "radius": 8}] for x in (10, 5))
    no_way = r"no way leads from home \(site\.origin\) to flight\.start that keeps 4 m "
    no_way += r"\(fence\.margin\).*give a smaller margin, move home"
    for error, told, zones, inclusion in (
        (InputError, r"site\.origin: home, .* 3\.0 m inside exclusion circle.*; move", inside, {}),
        (InputError, r"2\.0 m from exclusion circle, less than fence\.margin", near, {}),
        (InfeasibleError, no_way, [wall], {"fence.inclusion": cell}),
    ):
        with pytest.raises(error, match=told):
            check_vehicle(walled(**{"fence.exclusion": zones, **inclusion}))


def test_a_run_in_has_to_be_free_as_well() -> None:
    at_speed = {"flight.start_velocity": [8, 0], "fence.exclusion": [WALL]}
    behind = {"polygon": [[-30, 40], [-10, 40], [-10, 80], [-30, 80]]}
    free, blocked = (
        walled(**(at_speed | {"fence.exclusion": zones})) for zones in ([WALL], [WALL, behind])
    )
    for plan in (free, blocked):
        route = initial_route(T, W, plan)
        route = with_run_in(route, T, W, plan.aircraft.flight_model(), 8.0)
        assert route.first == 1
        assert route.waits[0] == route.radii[0] == 0
        if plan is free:
            assert assemble(route, plan).items
        else:
            with pytest.raises(
                InfeasibleError, match=r"before flight\.start.*give flight\.start_v"
            ):
                assemble(route, plan)


def test_a_way_that_is_not_needed_is_not_there() -> None:
    aside = walled(**{"fence.exclusion": [{"center": [150, 200], "radius": 20}]})
    without = parse_plan(edited(aside.text, {"fence": None}))
    route = initial_route(T, W, aside)
    assert assemble(route, aside).items == assemble(route, without).items
    landing = walled(**{"mission.on_finish": "land"})
    assert len(way_home(landing, np.array([300.0, 60.0]))) == 0
    assert len(way_out(landing, np.array([0.0, 60.0]))) == 2
    with pytest.raises(InfeasibleError, match=r"from flight\.end to home .* that keeps 4 m"):
        way_home(aside, np.array([150.0, 222.0]))  # 2 m from the zone


spots = st.tuples(st.integers(-150, 450), st.integers(-150, 250))
zones = st.lists(
    st.builds(lambda c, r: {"center": list(c), "radius": r}, spots, st.integers(5, 60)),
    min_size=1,
    max_size=6,
)


@settings(max_examples=30)
@given(zones=zones, margin=st.sampled_from([0.0, 1.0, 5.0, 20.0]))
def test_ways_keep_the_margin_whatever_the_fence(zones: list[Any], margin: float) -> None:
    try:
        plan = walled(**{"fence.exclusion": zones, "fence.margin": margin})
        check_transit(plan)
    except (InfeasibleError, PlanError, InputError):
        assume(False)
    area, start, end = plan.keep_in, np.array([0.0, 60.0]), np.array([300.0, 60.0])
    assert area is not None
    home = np.zeros((1, 2))
    for way in (
        np.vstack([home, way_out(plan, start), start]),
        np.vstack([end, way_home(plan, end), home]),
    ):
        assert area.clearance(way) >= margin - 0.013
