"""The gate of all setpoints, and the ways on which an aircraft is led back through it."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited
from hypothesis import assume, given
from hypothesis import strategies as st

from faao_mav import optimize, parse_plan
from faao_mav.arrays import Real
from faao_mav.fly.course import Setpoint
from faao_mav.fly.gate import LEVEL, NEAR, Gate
from faao_mav.fly.itinerary import Itinerary
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.schedule.transit import way_between

SWIFT: dict[str, Any] = {
    "flight.start_velocity": "hover",
    "flight.end_velocity": "hover",
    "flight.start": [0, 50],
    "flight.end": [200, 0],
    "flight.altitude": 30,
    "flight.duration": 32,
    "vehicle.max_speed": 8,
    "vehicle.max_acceleration": 1.6,
    "radio.ground_user.position": [220, 60],
    "mission.on_finish": "land",
}
"""A plan that never waits: 8 m/s for most of 206 m, 30 m above the ground."""

ZONE = {
    "margin": 3,
    "inclusion": [[-40, -60], [260, -60], [260, 120], [-40, 120]],
    "exclusion": [{"polygon": [[80, -10], [120, -10], [120, 40], [80, 40]]}],
}
"""A fence with a zone across the straight of that flight."""

CAP = NEAR + 8**2 / (2 * 1.6)
PLACES = st.tuples(st.floats(-60, 60), st.floats(-60, 60), st.floats(-40, 40)).map(np.array)


@cache
def swift(*, fenced: bool = False) -> Solution:
    changes = SWIFT | ({"fence": ZONE, "flight.duration": 36} if fenced else {})
    return optimize(parse_plan(edited(FLYABLE, changes)))


def at_rest(place: Real) -> Setpoint:
    return Setpoint(np.asarray(place, dtype=float), np.zeros(3), np.zeros(3))


def plan_with(changes: dict[str, Any]) -> Plan:
    return parse_plan(edited(FLYABLE, SWIFT | changes))


@given(st.lists(st.tuples(st.floats(0, 20), PLACES), min_size=1, max_size=8))
def test_nothing_passes_that_is_farther_off_than_it_can_have_fallen_behind(
    steps: list[tuple[float, Real]],
) -> None:
    gate, t, on_course = Gate(plan_with({})), 0.0, steps[0][0]
    for wait, off in steps:
        t += wait
        across, up = float(np.hypot(*off[:2])), abs(float(off[2]))
        if across <= NEAR and up <= LEVEL:
            on_course = t
        late = t - on_course
        passes = gate.passes(t, np.zeros(3), at_rest(off))
        assert passes == (across <= min(NEAR + 8 * late, CAP) and up <= LEVEL + min(2 * late, 2.0))


def test_the_straight_to_a_setpoint_keeps_the_fence() -> None:
    plan = plan_with({"fence": ZONE})
    west, east = np.array([78.0, 20.0, 30.0]), np.array([96.0, 20.0, 30.0])
    corner, beyond = np.array([78.0, 36.0, 30.0]), np.array([85.0, 42.0, 30.0])

    def passes(place: Real, setpoint: Real) -> bool:
        gate = Gate(plan)
        gate.passes(0.0, place, at_rest(place))
        return gate.passes(60.0, place, at_rest(setpoint))

    assert passes(west, np.array([60.0, 20.0, 30.0]))
    assert not passes(west, east)
    assert not passes(corner, beyond)  # across the corner, 9 m
    inside = np.array([80.5, 20.0, 30.0])
    assert passes(inside, np.array([79.0, 20.0, 30.0]))


def test_a_place_is_believed_where_the_aircraft_can_have_flown() -> None:
    gate, v = Gate(plan_with({})), np.array([8.0, 0.0, 0.0])
    for k in range(20):
        assert gate.believes(k / 10, np.array([0.8 * k, 0.0, 30.0]), v)
    assert gate.believes(30.0, np.array([300.0, 0.0, 30.0]), v)  # after a silence
    jumped = np.array([400.0, 0.0, 30.0])
    for k in range(1, 40):
        assert not gate.believes(30 + k / 10, jumped + 0.8 * k, v)
        assert gate.has_lost_it(30 + k / 10) == (k > 30)
    assert gate.believes(34.0, np.array([316.0, 0.0, 30.0]), v)
    assert gate.told == [
        "its place has jumped: no setpoints are sent",
        "its place is believed again",
    ]


@pytest.mark.parametrize(("speed", "believed"), [(4.0, False), (0.2, True)])
def test_an_aircraft_that_moves_is_elsewhere_a_second_later(speed: float, believed: bool) -> None:
    gate, place, v = Gate(plan_with({})), np.array([1.0, 2.0, 30.0]), np.array([0.0, speed, 0.0])
    held = [gate.believes(k / 10, place, v) for k in range(20)]
    assert all(held[:9])
    assert held[-1] == believed
    assert gate.believes(2.1, place + np.array([0.0, 0.3, 0.0]), v)


@given(
    begin=st.tuples(st.integers(-42, 262), st.integers(-62, 122)),
    end=st.tuples(st.integers(-36, 256), st.integers(-56, 116)),
)
def test_ways_keep_the_margin_from_where_they_have_it(
    begin: tuple[int, int], end: tuple[int, int]
) -> None:
    plan = plan_with({"fence": ZONE})
    area = plan.keep_in
    assert area is not None
    kept = area.inside(2.98)
    assume(kept.covers(np.array([end])).all())
    way = way_between(plan, np.array(begin, dtype=float), np.array(end, dtype=float))
    assert (way is not None) == area.covers(np.array([begin])).all()
    if way is not None:
        assert way[[0, -1]].tolist() == [list(begin), list(end)]
        assert area.covers_path(way)
        near = not kept.covers(np.array([begin])).all()
        assert len(way[near:]) < 2 or kept.covers_path(way[near:])


def carried(
    solution: Solution, place: Real, lost: tuple[float, float]
) -> tuple[Itinerary, Real, Real]:
    """Return an itinerary, its times and places, for an aircraft that is where it is sent.

    While it is `lost`, s, nothing is heard of it; then it is at `place` (3,).
    """
    flight = Itinerary(solution, Gate(solution.plan), takes_off=False)
    now, t, times, places = np.zeros(3), 0.0, list[float](), list[Real]()
    while flight.part != "over" and flight.trouble is None and t < 600:
        t += 0.1
        if lost[0] <= t < lost[1]:
            now = place
            continue
        setpoint = flight.setpoint(t, now, np.zeros(3))
        if setpoint is not None:
            now = setpoint.position
            times.append(t)
            places.append(now)
    return flight, np.array(times), np.array(places)


@given(
    place=st.tuples(st.floats(-30, 250), st.floats(-50, 110), st.floats(1.0, 80.0)).map(np.array),
    begin=st.floats(10.0, 60.0),
    lasting=st.floats(1.0, 40.0),
)
def test_from_wherever_it_is_found_again_it_is_led_to_the_end_inside_the_fence(
    place: Real, begin: float, lasting: float
) -> None:
    solution = swift(fenced=True)
    plan = solution.plan
    area = plan.keep_in
    assert area is not None
    flight, times, places = carried(solution, place, (begin, begin + lasting))
    if not area.covers(place[None, :2]).all():
        found = times[times >= begin + lasting - 1e-9]
        assert flight.trouble == "no way inside the fence leads it back" or not len(found)
        return
    assert flight.trouble is None
    assert flight.part == "over"
    assert np.linalg.norm(places[-1] - flight.relay.p[-1]) < NEAR + 1e-6
    after = times >= begin + lasting - 1e-9
    path = np.vstack([place[None], places[after]])
    steps = np.diff(path, axis=0)
    assert np.hypot(steps[:, 0], steps[:, 1]).max() <= CAP
    for first, second in pairwise(path):
        if np.hypot(*(second - first)[:2]) > NEAR:
            assert area.covers_path(np.array([first[:2], second[:2]]))
    low = path[1:, 2] < 30 - LEVEL - 2.0
    assert np.hypot(steps[:, 0], steps[:, 1])[low].max(initial=0.0) < 0.01  # first it climbs


def test_it_meets_the_plan_where_that_waits() -> None:
    """A plan of a minute for the small flight hovers in the middle: there it is met in time."""
    slow = {"flight.end": [50, 0], "flight.duration": 60, "radio.ground_user.position": [60, 60]}
    solution = optimize(parse_plan(edited(FLYABLE, SWIFT | slow)))
    plan = solution.plan
    flight, times, places = carried(solution, np.array([-60.0, 0.0, 30.0]), (40.0, 42.0))
    assert flight.part == "over"
    assert flight.relay_start is not None
    assert flight.told == [
        "it is off its flight, and led back to it",
        "it is on its plan again",
    ]
    late = times > flight.relay_start + 30
    on_plan = late & (times < flight.relay_start + plan.flight.duration)
    planned = np.array([flight.relay.at(t - flight.relay_start).position for t in times[on_plan]])
    assert np.linalg.norm(places[on_plan] - planned, axis=1).max() < 1e-6


@pytest.mark.parametrize(
    ("place", "trouble"),
    [
        ((100.0, 20.0, 30.0), "no way inside the fence leads it back"),  # in the zone
        ((20.0, 20.0, 0.2), "it has come down to the ground"),
    ],
)
def test_what_cannot_be_led_is_given_up(place: tuple[float, float, float], trouble: str) -> None:
    flight, times, _ = carried(swift(fenced=True), np.array(place), (40.0, 70.0))
    assert flight.trouble == trouble
    assert times[-1] < 40.0


def test_an_aircraft_that_does_not_follow_is_given_up() -> None:
    solution = swift()
    flight, t = Itinerary(solution, Gate(solution.plan), takes_off=True), 0.0
    place = np.array([0.0, 0.0, 30.0])
    sent = list[Real]()
    while flight.trouble is None and t < 600:
        t += 0.1
        setpoint = flight.setpoint(t, place, np.zeros(3))
        sent += [] if setpoint is None else [setpoint.position]
    assert flight.trouble == "it does not follow"
    assert t < 120
    assert max(np.linalg.norm(each - place) for each in sent) <= CAP


def test_a_wind_that_drifts_it_off_again_and_again_is_given_up() -> None:
    solution = swift()
    solution = replace(solution, problem=build_problem(plan_with({})))
    flight, t, place = Itinerary(solution, Gate(solution.plan), takes_off=True), 0.0, np.zeros(3)
    place = np.array([0.0, 0.0, 30.0])
    while flight.trouble is None and flight.part != "over" and t < 900:
        t += 0.1
        flight.setpoint(t, place, np.zeros(3))
        place = place + np.array([0.0, -0.8, 0.0])
    assert flight.trouble == "it does not follow"
    assert t < 120
