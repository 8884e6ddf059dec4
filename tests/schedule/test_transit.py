"""The ways between home and the relay route."""

from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from faao_mav import Vehicle
from faao_mav.autopilot.predict import predict
from faao_mav.errors import InfeasibleError, InputError, PlanError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Mission
from faao_mav.plan import Plan, parse_plan
from faao_mav.schedule.assemble import assemble, check_transit, way_home, way_out
from faao_mav.schedule.conversion import check_vehicle
from faao_mav.schedule.route import initial_route, with_run_in

WALL = {"polygon": [[-60, 15], [60, 15], [60, 30], [-60, 30]]}
ROUND = {"center": [150, 25], "radius": 20}
T, W = np.arange(0.0, 61.0), np.linspace([0.0, 60.0], [300.0, 60.0], 61)


def plan_with(**changes: Any) -> Plan:
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
    plan = plan_with(**{"vehicle.autopilot": autopilot})
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


def test_a_way_that_is_not_needed_is_not_there() -> None:
    aside = plan_with(**{"fence.exclusion": [{"center": [150, 200], "radius": 20}]})
    without = parse_plan(edited(aside.text, {"fence": None}))
    route = initial_route(T, W, aside)
    assert assemble(route, aside).items == assemble(route, without).items
    landing = plan_with(**{"mission.on_finish": "land"})
    assert len(way_home(landing, np.array([300.0, 60.0]))) == 0
    assert len(way_out(landing, np.array([0.0, 60.0]))) == 2


def test_homes_and_ways_that_cannot_be_are_named_before_the_work() -> None:
    wall = {"polygon": [[-400, 15], [400, 15], [400, 30], [-400, 30]]}
    cell = [[-300, -100], [400, -100], [400, 300], [-300, 300]]
    for error, told, zones in (
        (
            InputError,
            r"site\.origin: home, .* 3\.0 m inside exclusion circle.*; move it out",
            {"fence.exclusion": [{"center": [5, 0], "radius": 8}]},
        ),
        (
            InputError,
            r"2\.0 m from exclusion circle, less than fence\.margin",
            {"fence.exclusion": [{"center": [10, 0], "radius": 8}]},
        ),
        (
            InfeasibleError,
            r"no way leads from home \(site\.origin\) to flight\.start that keeps 4 m "
            r"\(fence\.margin\).*give a smaller margin, move home",
            {"fence.exclusion": [wall], "fence.inclusion": cell},
        ),
    ):
        with pytest.raises(error, match=told):
            check_vehicle(plan_with(**zones))


def test_a_run_in_has_to_be_free_as_well() -> None:
    at_speed = {"flight.start_velocity": [8, 0], "fence.exclusion": [WALL]}
    behind = {"polygon": [[-30, 40], [-10, 40], [-10, 80], [-30, 80]]}
    free, blocked = (
        plan_with(**(at_speed | {"fence.exclusion": zones})) for zones in ([WALL], [WALL, behind])
    )
    for plan in (free, blocked):
        route = initial_route(T, W, plan)
        route = with_run_in(route, T, W, plan.aircraft.flight_model(), 8.0)
        assert route.first == 1
        if plan is free:
            assert assemble(route, plan).items
        else:
            with pytest.raises(
                InfeasibleError, match=r"before flight\.start.*give flight\.start_v"
            ):
                assemble(route, plan)


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
        plan = plan_with(**{"fence.exclusion": zones, "fence.margin": margin})
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
