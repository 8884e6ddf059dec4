"""Flights by setpoints: the plan, the gate of setpoints, the ways on which it is led back."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited
from flight_logs import heights
from hypothesis import given
from hypothesis import strategies as st
from scenes import CAP, PLANS, Scene, is_setpoint, planned, staged, under
from stations import VEHICLE, a_mission, vehicle_of

from faao_mav import optimize, parse_plan
from faao_mav.arrays import Real
from faao_mav.autopilot import vehicle_type
from faao_mav.errors import InfeasibleError, InputError
from faao_mav.fly.itinerary import LEVEL, NEAR, Course, Gate, Itinerary, at_rest
from faao_mav.fly.preflight import Clearance, Flight
from faao_mav.fly.stream import OwnClock, Stream
from faao_mav.geodesy import LocalFrame
from faao_mav.wire import messages
from faao_mav.wire.jobs import Held
from faao_mav.wire.parameters import Reading
from faao_mav.wire.protocol import GROUND_STATION
from faao_mav.wire.transfer import Peer

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
FENCE = {
    "margin": 2,
    "inclusion": [[-30, -30], [80, -30], [80, 80], [-30, 80]],
    "exclusion": [{"polygon": [[-5, 20], [20, 20], [20, 30], [-5, 30]]}],
}


@pytest.mark.parametrize(("kind", "loss"), [("ardupilot", 0.0), ("px4", 0.2)])
def test_a_plan_is_kept_in_time(kind: str, loss: float) -> None:
    solution, scene = planned("low"), staged("low", kind, {"loss": f"{loss}", "seed": "3"})
    assert scene.run() == "finished"
    assert not scene.mock.armed
    record, begin = scene.watch.seen.record(), scene.watch.relay_start
    found = record.line(solution, begin).priced(solution)
    assert found.rms_position_error < (0.3 if not loss else 0.6)
    assert found.delivered_rate > 0.997 * solution.delivered_rate
    during = (record.t > begin) & (record.t < begin + solution.plan.flight.duration)
    np.testing.assert_allclose(heights(record)[during], 6, atol=0.2)
    sent: list[Any] = [*filter(is_setpoint, scene.client.sent)]
    steps = np.diff([each.time_boot_ms for each in sent])
    assert steps.min() >= 80
    assert loss or steps.max() <= 120
    assert {each.type_mask for each in sent} == {3072}
    assert scene.client.wrong == []


def test_only_copters_are_flown_by_setpoints() -> None:
    plane = Peer(GROUND_STATION, VEHICLE, vehicle_type("ardupilot", "plane"))
    flight = Flight(a_mission(5), solution=planned("low"))
    with pytest.raises(InputError, match="only copters"):
        Stream(Clearance(flight, plane, Held({}, Reading({}))))


@pytest.mark.parametrize("finish", ["rtl", "hover"])
def test_it_ends_as_the_plan_says_inside_its_fence(finish: str) -> None:
    solution = under({"mission.on_finish": finish, "fence": FENCE})
    scene = Scene("ardupilot", solution=solution)
    assert scene.run() == "finished"
    assert scene.mock.armed == (finish == "hover")
    record, area = scene.watch.seen.record(), solution.plan.keep_in
    assert area is not None
    path = record.line(solution).w
    assert np.linalg.norm(path[-1] - (solution.w[-1] if finish == "hover" else 0)) < 1
    assert heights(record)[-1] == pytest.approx(6 if finish == "hover" else 0, abs=1)
    first = int(np.argmax(heights(record) > 5.9))
    assert area.inside(1.0).covers(path[first:][heights(record)[first:] > 1]).all()
    velocity = solution.v.copy()
    velocity[0] = [20, 0]  # its run-in begins west of the fence
    with pytest.raises(InfeasibleError, match="fence"):
        Scene("ardupilot", solution=replace(solution, v=velocity))


@KINDS
@given(north=st.floats(-5e3, 5e3), east=st.floats(-5e3, 5e3), latitude=st.floats(-60, 60))
def test_local_frames_go_there_and_back(
    kind: str, north: float, east: float, latitude: float
) -> None:
    vehicle = vehicle_of(kind)
    assert vehicle is not None
    frame = vehicle.family.local_frame(latitude, 179.99)
    there = np.array([east, north])
    np.testing.assert_allclose(frame.to_local(*frame.to_geodetic(there)), there, atol=1e-3)
    own = LocalFrame(latitude, 179.99)
    apart = np.linalg.norm(own.to_local(*frame.to_geodetic(there)) - there)
    assert apart <= 0.0075 * np.linalg.norm(there) + 1e-4  # each has another Earth


def test_what_others_asked_tells_nothing_of_the_link() -> None:
    clock = OwnClock()
    for now in (1.0, 2.0, 3.0):
        own = clock.ask(now).ts1
        clock.hear(messages.Timesync(int(2e9 * now), own), now + 0.1)
        others = messages.Timesync(int(2e9 * now), own - 500_000_000)
        clock.hear(others, now + 0.2)
    assert clock.speed == pytest.approx(2.0)
    assert clock.lead == pytest.approx(0.2)


# ---- the gate of setpoints, and the ways back

PLACES = st.tuples(st.floats(-60, 60), st.floats(-60, 60), st.floats(-40, 40)).map(np.array)


@given(st.lists(st.tuples(st.floats(0, 20), PLACES), min_size=1, max_size=8))
def test_nothing_passes_that_is_farther_off_than_it_can_have_fallen_behind(
    steps: list[tuple[float, Real]],
) -> None:
    gate, t, on_course = Gate(planned("swift").plan, print), 0.0, steps[0][0]
    for wait, off in steps:
        t += wait
        across, up = float(np.hypot(*off[:2])), abs(float(off[2]))
        if across <= NEAR and up <= LEVEL:
            on_course = t
        late = t - on_course
        passes = gate.passes(t, np.zeros(3), at_rest(off))
        assert passes == (across <= min(NEAR + 8 * late, CAP) and up <= LEVEL + min(2 * late, 2.0))


def test_the_straight_to_a_setpoint_keeps_the_fence() -> None:
    for place, setpoint, passes in (
        ((78.0, 20.0), (60.0, 20.0), True),
        ((78.0, 20.0), (96.0, 20.0), False),  # across the zone
        ((78.0, 36.0), (85.0, 42.0), False),  # across its corner, 9 m
        ((80.5, 20.0), (79.0, 20.0), True),  # out of it
    ):
        gate, here = Gate(planned("fenced").plan, print), np.array([*place, 30.0])
        gate.passes(0.0, here, at_rest(here))
        assert gate.passes(60.0, here, at_rest(np.array([*setpoint, 30.0]))) == passes


def carried(
    name: str, place: Real, lost: tuple[float, float], told: list[str]
) -> tuple[Itinerary, Real, Real]:
    """Return an itinerary, its times and places, for an aircraft that is where it is sent.

    While it is `lost`, s, nothing is heard of it; then it is at `place` (3,).
    """
    flight = Itinerary(planned(name), told.append, takes_off=False)
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
    area = planned("fenced").plan.keep_in
    assert area is not None
    flight, times, places = carried("fenced", place, (begin, begin + lasting), [])
    if not area.covers(place[None, :2]).all():
        found = times[times >= begin + lasting - 1e-9]
        assert flight.trouble == "no way inside the fence leads it back" or not len(found)
        return
    assert (flight.trouble, flight.part) == (None, "over")
    assert np.linalg.norm(places[-1] - flight.relay.p[-1]) < NEAR + 1e-6
    path = np.vstack([place[None], places[times >= begin + lasting - 1e-9]])
    kept = area.inside(2.98).covers(path[:, :2])
    assert kept[np.argmax(kept) :].all()
    steps = np.diff(path, axis=0)
    assert np.hypot(steps[:, 0], steps[:, 1]).max() <= CAP
    for first, second in pairwise(path):
        if np.hypot(*(second - first)[:2]) > NEAR:
            assert area.covers_path(np.array([first[:2], second[:2]]))
    level = np.hypot(steps[:, 0], steps[:, 1])[path[1:, 2] < 30 - LEVEL - 2.0]
    assert level[:1].max(initial=0.0) <= NEAR  # onto its course, if that is there
    assert level[1:].max(initial=0.0) < 0.01  # first it climbs


def test_it_meets_the_plan_where_that_waits() -> None:
    solution, told = planned("waiting"), list[str]()
    flight, times, places = carried("waiting", np.array([-60.0, 0.0, 30.0]), (40.0, 42.0), told)
    assert flight.part == "over"
    assert flight.relay_start is not None
    assert told[2:4] == ["it is off its flight, and led back to it", "it is on its plan again"]
    late = times > flight.relay_start + 30
    on_plan = late & (times < flight.relay_start + solution.plan.flight.duration)
    meant = np.array([flight.relay.at(t - flight.relay_start).position for t in times[on_plan]])
    assert np.linalg.norm(places[on_plan] - meant, axis=1).max() < 1e-6


def test_an_aircraft_that_does_not_follow_is_given_up() -> None:
    """A wind drifts it off again and again; scenes have one that stays where it is."""
    t, place = 0.0, np.array([0.0, 0.0, 30.0])
    flight = Itinerary(planned("swift"), print, takes_off=True)
    while flight.trouble is None and flight.part != "over" and t < 900:
        t += 0.1
        setpoint = flight.setpoint(t, place, np.zeros(3))
        assert setpoint is None or np.linalg.norm(setpoint.position - place) <= CAP
        place = place - [0.0, 0.8, 0.0]
    assert flight.trouble == "it does not follow"
    assert t < 120


def test_a_course_is_what_its_pieces_add_up_to() -> None:
    plan = parse_plan(edited(FLYABLE, PLANS["swift"] | {"flight.start_velocity": [3.0, 4.0]}))
    at_speed = optimize(plan)
    corners = [[0, 0, 0], [0, 0, 30], [40, 30, 30], [40, 31, 30]]
    for course in (Course.of(at_speed), Course.through(corners, [(2.0, 1.0), *[(8.0, 1.6)] * 2])):
        t = np.linspace(course.begin - 1, course.end + 1, 4001)
        p, v = (np.array([course.at(each)[n] for each in t]) for n in (0, 1))
        np.testing.assert_allclose(np.gradient(p, t, axis=0)[1:-1], v[1:-1], atol=0.05)
        assert np.linalg.norm(v[0]) == np.linalg.norm(v[-1]) == 0
    course = Course.of(at_speed)
    for t, w, v in zip(at_speed.t, at_speed.w, at_speed.v, strict=True):
        np.testing.assert_allclose(course.at(t - 1e-9).position[:2], w, atol=1e-6)
        np.testing.assert_allclose(course.at(t - 1e-9).velocity[:2], v, atol=1e-6)
