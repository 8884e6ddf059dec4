"""A real flight beside its plan: when it began, how it stands, what became of it."""

from functools import cache

import numpy as np
import pytest
from conftest import SMALL, edited
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Real
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import parse_plan
from faao_mav.schedule.prediction import price_flight
from faao_mav.validate.flown import Line, debriefing, plan_start, planned_line, standing

CHANGES = {
    "flight.start": [0, 120],
    "flight.end": [150, 0],
    "flight.duration": 45,
    "flight.start_velocity": "hover",
    "flight.end_velocity": "hover",
    "vehicle.max_speed": 8,
    "vehicle.max_acceleration": 1.5,
    "radio.fading": "none",
    "radio.causal": True,
}


@cache
def solved(start: str = "hover") -> Solution:
    return optimize(parse_plan(edited(SMALL, CHANGES | {"flight.start_velocity": start})))


def flown(
    solution: Solution, begun: float, *, pause: float = 0.0, at: float = 25.0, way: float = 60.0
) -> Line:
    """Return the flight of the plan, from home and back, with a `pause` at the plan's time `at`."""
    t = np.arange(0.0, 45.0, 0.2)
    w = np.stack([np.interp(t, solution.t, x) for x in solution.w.T], axis=-1)
    if solution.v[0].any():  # it comes to its start at speed
        run_in = np.arange(-8.0, 0.0, 0.2)
        t, w = np.append(run_in, t), np.vstack([w[0] + run_in[:, None] * solution.v[0], w])
    t = t + np.where(t > at, pause, 0.0)
    out, home = np.array([t[0] - way, t[0] - 5.0]), np.array([t[-1] + 2.0, t[-1] + way])
    ways = np.array([[0.0, 0.0], w[0], w[-1], [0.0, 0.0]])
    t = np.concatenate([out, t, home]) + begun
    w = np.vstack([ways[:2], w, ways[2:]])
    dense = np.arange(t[0], t[-1], 0.2)
    return Line(dense, np.stack([np.interp(dense, t, x) for x in w.T], axis=-1))


@settings(max_examples=25)
@given(
    begun=st.floats(100.0, 900.0),
    pause=st.floats(0.0, 40.0),
    off=st.floats(-2.0, 2.0),
    seed=st.integers(0, 99),
    start=st.sampled_from(["hover", "free"]),
)
def test_the_departure_is_found_whatever_comes_later(
    begun: float, pause: float, off: float, seed: int, start: str
) -> None:
    solution = solved(start)
    flight = flown(solution, begun, pause=pause)
    noise = np.random.default_rng(seed).normal(0.0, 0.3, flight.w.shape)
    found = plan_start(solution, planned_line(solution), Line(flight.t, flight.w + noise + off))
    assert found == pytest.approx(begun, abs=0.7)  # 2.8 m off to one side, at 8 m/s
    exact = plan_start(solution, planned_line(solution), flight)
    assert exact == pytest.approx(begun, abs=0.05)


def test_a_flight_by_setpoints_is_on_the_clock_of_the_plan_and_not_of_its_mission() -> None:
    solution = solved()
    line = planned_line(solution)
    mission = Line(line.t, np.stack([np.interp(line.t - 0.4, line.t, x) for x in line.w.T], axis=1))
    for followed in (line, mission):
        flight = flown(solution, 200.0)
        w = np.stack([np.interp(flight.t - 200.0, followed.t, x) for x in followed.w.T], axis=1)
        near = (flight.t > 195.0) & (flight.t < 230.0)
        found = plan_start(solution, mission, Line(flight.t[near], w[near]))
        assert found == pytest.approx(200.0, abs=0.05)


def test_what_is_not_the_flight_is_not_taken_for_it() -> None:
    solution, line = solved(), planned_line(solved())
    flight = flown(solution, 200.0)
    before = flight.t < 199.0  # on the way, and waiting at w_I
    assert plan_start(solution, line, Line(flight.t[before], flight.w[before])) is None
    assert plan_start(solution, line, Line(flight.t, flight.w + 30.0)) is None
    assert plan_start(solution, line, Line(flight.t[:3], flight.w[:3])) is None


def test_what_became_of_it_is_priced_as_a_prediction_is() -> None:
    solution = solved()
    flight = flown(solution, 200.0, pause=12.0)
    height = np.full(len(flight.t), 38.5)
    found = debriefing(solution, planned_line(solution), flight, height, 200.0)
    priced = price_flight(solution, flight.t - 200.0, flight.w)
    assert found.flown.delivered_rate == pytest.approx(priced.delivered_rate, rel=1e-4)
    assert found.flown.delivered_rate < 0.995 * solution.delivered_rate
    assert found.predicted.delivered_rate == pytest.approx(solution.delivered_rate)
    assert found.flown.duration - 45 == pytest.approx(12, abs=0.3)
    assert found.altitude_error == pytest.approx(1.5)
    assert found.missing == 0


@pytest.mark.parametrize("now", [5.0, 15.0, 24.0, 30.0, 36.8, 50.0])
def test_how_a_flight_stands(now: float) -> None:
    """A pause of 12 s at 25 s of the plan: lateness grows to 12 s, and the rest is expected so."""
    solution, line = solved(), planned_line(solved())
    flight = flown(solution, 0.0, pause=12.0)
    until = flight.t <= now + 1e-9
    found = standing(solution, line, Line(flight.t[until], flight.w[until]))
    late = float(np.clip(now - 25.0, 0.0, 12.0))
    assert found.late == pytest.approx(late, abs=0.5)
    place = np.array([np.interp(min(now, 45.0), solution.t, x) for x in solution.w.T])
    assert found.apart == pytest.approx(np.linalg.norm(flight.w[until][-1] - place), abs=0.1)
    assert found.astray < 0.1
    expected = price_flight(solution, *delayed(solution, min(now, 25.0), late))
    assert found.expected == pytest.approx(45 * expected.delivered_rate, rel=0.01)
    slots = int(min(now, 45.0) / 0.5)
    assert found.delivered == pytest.approx(
        0.5 * expected.relayed.forwarded[:slots].sum(), rel=0.02
    )
    assert found.delivered <= found.expected + 1e-9
    assert not found.over


def delayed(solution: Solution, at: float, late: float) -> tuple[Real, Real]:
    t = np.append(solution.t, solution.t[-1] + 30) + np.where(
        np.append(solution.t, 99) > at, late, 0
    )
    return t, np.vstack([solution.w, solution.w[-1:]])


def test_it_is_over_at_the_end() -> None:
    solution, line = solved(), planned_line(solved())
    flight = flown(solution, 0.0)
    for now, over in ((44.0, False), (45.2, True), (90.0, True)):
        until = flight.t <= now
        found = standing(solution, line, Line(flight.t[until], flight.w[until]))
        assert found.over == over
    assert found.delivered == pytest.approx(found.expected)
