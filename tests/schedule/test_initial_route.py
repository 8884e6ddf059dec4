"""The initial route for a trajectory, and the commands that are found from the flight they make."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from relay_flights import Trajectory, dash, dash_hover_dash, items_of, plan_with

from faao_mav.arrays import Real
from faao_mav.autopilot import FlightPath, Flown, Vehicle
from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.errors import InputError
from faao_mav.plan import Plan
from faao_mav.schedule.assemble import assemble
from faao_mav.schedule.prediction import Schedule
from faao_mav.schedule.route import Route, initial_route
from faao_mav.schedule.scheduler import CopterScheduler
from faao_mav.schedule.timing import MOST_LEAD, SHORTEST_HOLD
from faao_mav.vector import distances_to_path, lengths

STEP = 0.2


def nominal(route: Route) -> float:
    """How long the route takes without ramps, s."""
    return float(route.waits.sum() + (route.leg_lengths / route.speeds).sum())


def check(t: Real, w: Real, plan: Plan) -> Route:
    """What holds of every conversion; returns the route."""
    route = initial_route(t, w, plan)
    positions, speeds, holds = items_of(assemble(route, plan), plan)
    assert positions == pytest.approx(route.positions, abs=1e-3)
    assert distances_to_path(w, positions).max() <= plan.mission.path_tolerance
    assert positions[0] == pytest.approx(w[0], abs=1e-3)
    assert positions[-1] == pytest.approx(w[-1], abs=1e-3)
    assert all(0 < speed <= plan.vehicle.max_speed for speed in speeds)
    assert all(hold == round(hold) >= 0 for hold in holds)
    assert (route.departures >= route.arrivals).all()
    assert (route.arrivals[1:] > route.departures[:-1]).all()
    return route


@st.composite
def trajectories(draw: st.DrawFn) -> Trajectory:
    """Smooth flights within 8 m/s and 1.5 m/s², with stops here and there."""
    n = draw(st.one_of(st.integers(2, 20), st.integers(20, 600)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    t = STEP * np.arange(float(n)) + draw(st.floats(0, 100))
    pieces = draw(st.integers(1, 8))
    top = rng.uniform(0, 1, pieces) * rng.integers(0, 2, pieces)
    speed = np.interp(t, np.linspace(t[0], t[-1], pieces), 8 * top)
    heading = np.interp(t, np.linspace(t[0], t[-1], pieces), rng.uniform(-6, 6, pieces))
    v = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    for k in range(1, n):
        change = v[k] - v[k - 1]
        v[k] = v[k - 1] + change * min(1, 1.5 * STEP / max(np.hypot(*change), 1e-12))
    w: Real = rng.uniform(-300, 300, 2) + np.cumsum(v, axis=0) * STEP
    return t, w


@given(
    trajectories(),
    st.sampled_from(["ardupilot", "px4"]),
    st.floats(0.1, 20),
    st.sampled_from([8.0, 7.9999, 5.0]),
)
def test_any_flight_keeps_to_its_path(
    trajectory: Trajectory, autopilot: str, tolerance: float, max_speed: float
) -> None:
    plan = plan_with(
        autopilot=autopilot, path_tolerance=tolerance, max_speed=max_speed, max_items=5000
    )
    t, w = trajectory
    route = check(t, w, plan)
    if max_speed == 8.0 and len(route.speeds) and route.speeds.max() < 8.0:
        assert nominal(route) == pytest.approx(t[-1] - t[0], abs=1.0 + 5e-3 * len(route.speeds))


def test_hovers_are_holds() -> None:
    t, w = dash_hover_dash(hover=40.0)
    route = check(t, w, plan_with())
    assert route.waits.tolist() == [0, 41, 0]  # below 0.75 m/s for half a second on each side
    assert nominal(route) == pytest.approx(t[-1] - t[0], abs=1)
    assert route.positions == pytest.approx(np.array([w[0], [150.0, 150.0], w[-1]]), abs=0.05)
    t = np.arange(0, 100, STEP)
    route = check(t, np.outer(dash(0, 200, 8, 1.5, np.maximum(t - 20.3, 0)), [1, 0]), plan_with())
    assert route.waits[0] == pytest.approx(20.3, abs=1)
    assert route.waits[-1] == pytest.approx(t[-1] - 20.3 - 200 / 8 - 8 / 1.5, abs=1)
    assert route.waits[1:-1].sum() == 0
    turn = 2 * np.pi * t / t[-1]
    for w in (np.full((len(t), 2), 12.5), 0.8 * np.stack([np.cos(turn), np.sin(turn)], axis=1)):
        route = check(t, w, plan_with())
        assert (route.positions.shape, route.waits.tolist()) == ((1, 2), [100])
    route = check(t, np.outer(t / 100, [0.5, 0.0]), plan_with())
    assert len(route.positions) == 2


def test_a_swing_past_a_hover_belongs_to_it() -> None:
    """Such a plan brakes as hard as it may, `far` past the hover, and comes back to it."""
    t = np.arange(0, 100, STEP)
    on = dash(0, 200, 8, 2.0, np.maximum(t - 65, 0))
    for far in (1.0, 2.6):
        there = dash(0, 200 + far, 8, 2.0, t) - dash(0, far, 8, 0.8, np.maximum(t - 29.5, 0))
        route = check(t, np.outer(there, [0.6, 0.8]) + np.outer(on, [0.8, -0.6]), plan_with())
        assert len(route.positions) == 3
        assert route.waits[1] > 30
        assert np.hypot(*(route.positions[1] - [120, 160])) < 1


def test_a_creep_is_short_ways_and_waits() -> None:
    for speed in (0.25, 0.05):
        t = np.arange(0, 60, STEP)
        w = np.outer(speed * t, [0.0, 1.0])
        route = check(t, w, plan_with())
        assert 2 <= np.count_nonzero(route.waits) <= 6
        assert (route.speeds >= 0.75).all()
        at = np.stack([np.interp(t, route.departures, x) for x in route.positions.T], axis=-1)
        assert lengths(at - w).max() <= 2.5


def test_a_plan_that_dithers_about_a_place_waits_there() -> None:
    """8 s on a circle of 0.8 m at 1.3 m/s between legs at 5 m/s, as spare time may be filled."""
    t = STEP * np.arange(0.0, 40.0 / STEP)
    angle = 1.6 * np.clip(t - 16, 0, 8)
    along = np.clip(5 * (t - 16), None, 0) + np.clip(5 * (t - 24), 0, None)
    w = np.stack([along + 0.8 * np.sin(angle), 0.8 * np.cos(angle)], axis=-1)
    route = check(t, w, plan_with())
    assert 3 <= route.waits[1:-1].max() <= 9


VEHICLE = Vehicle("ardupilot", "copter", {"WPNAV_ACCEL": 400.0, "WPNAV_JERK": 10.0})
PLACES = np.array([[0.0, 0.0], [120, 0], [240, 60], [240, 200], [100, 200]])
SPEEDS = np.array([7.0, 4.0, 6.0, 3.0])
WAITS = np.array([0.0, 0.0, 12.4, 0.0, 3.0])


def route_with(speeds: Real, waits: Real) -> Route:
    still, last = np.zeros(len(waits)), len(waits) - 1
    return Route(PLACES[: len(waits)], still, still, speeds, waits, still, first=0, last=last)


def scheduler_for(t: Real, w: Real) -> CopterScheduler:
    return CopterScheduler(t, w, VEHICLE, VEHICLE.flight_model(), 0.1, 8.0, tolerance=2.0)


def as_planned(route: Route, *, ahead: float = 0.0) -> CopterScheduler:
    """The flight of `route` as a plan whose clock starts `ahead` seconds into it."""
    flight = scheduler_for(np.arange(2.0), np.zeros((2, 2))).flight(route).flown
    t = np.arange(0.0, flight.departures[-1] - ahead, 0.2)
    w = np.stack([np.interp(t + ahead, flight.t, x) for x in flight.position.T[:2]], axis=-1)
    return scheduler_for(t, w)


def fitted(scheduler: CopterScheduler, begin: Route, **options: Any) -> Schedule:
    return scheduler.fitted(begin, **options)


GUESS = route_with(np.full(4, 5.0), np.where(WAITS > 5, 8.0, WAITS))


def test_setting_out_before_the_plan_is_found() -> None:
    begin = route_with(SPEEDS, WAITS)
    found = fitted(as_planned(begin, ahead=0.8), begin).route
    assert found.lead == pytest.approx(0.8, abs=0.1)
    assert found.speeds == pytest.approx(SPEEDS, abs=0.1)
    assert fitted(as_planned(begin, ahead=9.0), begin).route.lead <= MOST_LEAD
    at_speed = replace(
        begin, first=1, arrivals=as_planned(begin).flight(begin).flown.arrivals - 0.8
    )
    assert fitted(as_planned(begin, ahead=0.8), at_speed).route.lead == 0


def test_groups_bounds_and_holds_are_kept() -> None:
    begin = route_with(SPEEDS, WAITS)
    speeds = fitted(as_planned(begin), begin, groups=np.array([0, 0, 1, 1])).route.speeds
    assert speeds[0] == speeds[1] != speeds[2] == speeds[3]
    narrow = replace(as_planned(begin), min_speed=3.5, max_speed=5.5)
    speeds = fitted(narrow, route_with(np.full(4, 5.0), WAITS)).route.speeds
    assert speeds[[0, 3]] == pytest.approx([5.5, 3.5])
    waits = fitted(as_planned(route_with(SPEEDS, np.zeros(5))), begin).route.waits
    assert waits[2] == pytest.approx(SHORTEST_HOLD, abs=0.3)
    assert waits[[0, 1, 3, 4]] == pytest.approx(WAITS[[0, 1, 3, 4]])
    alone = fitted(
        scheduler_for(np.arange(5.0), np.zeros((5, 2))), route_with(np.zeros(0), np.array([7.0]))
    )
    assert alone.route.waits.tolist() == [7]


def test_the_commands_that_made_a_flight_are_found_in_few(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, fly, flights = as_planned(route_with(SPEEDS, WAITS)), ArduCopter.fly, []

    def counted(model: ArduCopter, path: FlightPath) -> Flown:
        flights.append(path)
        return fly(model, path)

    monkeypatch.setattr(ArduCopter, "fly", counted)
    again = fitted(plan, GUESS)
    assert again.route.speeds == pytest.approx(SPEEDS, abs=0.1)
    assert again.route.waits == pytest.approx(WAITS, abs=0.5)
    assert again.route.lead == pytest.approx(0, abs=0.1)
    assert again.deviation.max < 0.5
    assert len(flights) <= 6


def test_a_flight_without_an_end_is_not_the_one_that_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, fly = as_planned(route_with(SPEEDS, WAITS)), ArduCopter.fly

    def followed(model: ArduCopter, path: FlightPath) -> Flown:
        if not np.allclose(path.speeds, GUESS.speeds):
            raise InputError("the flight would take more than 21600 s")
        return fly(model, path)

    monkeypatch.setattr(ArduCopter, "fly", followed)
    assert fitted(plan, GUESS).route.speeds == pytest.approx(GUESS.speeds)
