"""A real flight beside its plan: when it began, how it stands, what became of it."""

from functools import cache

import numpy as np
import pytest
from conftest import SMALL, edited
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import parse_plan
from faao_mav.schedule.prediction import positions_at, price_flight
from faao_mav.schedule.timing import MOST_LEAD
from faao_mav.validate.comparison import predicted_line
from faao_mav.validate.flown import FlightRecord, Line, debriefing, plan_start, standing

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


def track(solution: Solution, t: Real, w: Real, reached: Real) -> Track:
    """Return the flight through `w` (n, 2) at 40 m as a predicted one."""
    frame = LocalFrame(solution.plan.origin.latitude, solution.plan.origin.longitude)
    place = np.column_stack([w, np.full(len(t), 40.0)])
    return Track(t, place, 0 * place, np.zeros(len(t), dtype=int), reached, frame)


def flown(
    solution: Solution, begun: float, *, pause: float = 0.0, at: float = 25.0, way: float = 60.0
) -> Line:
    """Return the flight of the plan, from home and back, with a `pause` at the plan's time `at`."""
    t = np.arange(0.0, 45.0, 0.2)
    w = Line.planned(solution).at(t)
    if solution.v[0].any():  # it comes to its start at speed
        run_in = np.arange(-8.0, 0.0, 0.2)
        t, w = np.append(run_in, t), np.vstack([w[0] + run_in[:, None] * solution.v[0], w])
    t = t + np.where(t > at, pause, 0.0)
    out, home = np.array([t[0] - way, t[0] - 5.0]), np.array([t[-1] + 2.0, t[-1] + way])
    ways = np.array([[0.0, 0.0], w[0], w[-1], [0.0, 0.0]])
    t, w = np.concatenate([out, t, home]) + begun, np.vstack([ways[:2], w, ways[2:]])
    dense = np.arange(t[0], t[-1], 0.2)
    return Line(dense, positions_at(dense, t, w), np.full(len(dense), 38.5))


def within(flight: Line, begin: float, end: float) -> Line:
    kept = (flight.t >= begin) & (flight.t <= end + 1e-9)
    return Line(*(each[kept] for each in flight))


@settings(max_examples=12)
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
    flight, line = flown(solution, begun, pause=pause), Line.planned(solution)
    noise = np.random.default_rng(seed).normal(off, 0.3, flight.w.shape)
    found = plan_start(solution, line, flight._replace(w=flight.w + noise))
    assert found == pytest.approx(begun, abs=0.7)  # 2.8 m off to one side, at 8 m/s
    assert plan_start(solution, line, flight) == pytest.approx(begun, abs=0.05)


def test_flights_by_setpoints_and_what_is_not_the_flight() -> None:
    """Setpoints are on the clock of the plan and not of its mission."""
    solution, line = solved(), Line.planned(solved())
    mission = line._replace(w=line.at(line.t - 0.4))
    for followed in (line, mission):
        t = np.arange(-5.0, 30.0, 0.2)
        flight = Line(t + 200.0, followed.at(t), t)
        assert plan_start(solution, mission, flight) == pytest.approx(200.0, abs=0.05)
    flight = flown(solution, 200.0)
    for other in (
        within(flight, 0.0, 199.0),  # on the way, and waiting at w_I
        flight._replace(w=flight.w + 30.0),
        within(flight, 0.0, flight.t[2]),
    ):
        assert plan_start(solution, line, other) is None


def test_the_clock_of_a_prediction_is_that_of_its_departure() -> None:
    """Not that of an item near w_I behind it: the flight comes by there once more on its end."""
    solution = solved()
    flight = flown(solution, 200.0)
    t = np.append(flight.t, flight.t[-1] + np.arange(1.0, 60.0))
    w = np.vstack([flight.w, np.linspace(flight.w[-1], solution.w[0], 59)])
    found = predicted_line(solution, track(solution, t, w, np.array([200.0, 245.0, t[-1]])))
    assert t[0] - found.t[0] == pytest.approx(200.0, abs=0.15)
    # No departure of this one is like it: it is first near [0, 120] on its way to [30, 150].
    t, w = flight.t, flight.w + 30.0
    near = t[np.argmax(w[:, 1] > 108.9)]  # within 32 m, which is 2 m more than it is at [30, 120]
    found = predicted_line(solution, track(solution, t, w, np.array([200.0])))
    assert t[0] - found.t[0] == pytest.approx(near, abs=MOST_LEAD + 0.2)


def test_what_became_of_it_is_priced_as_a_prediction_is() -> None:
    solution = solved()
    flight, origin = flown(solution, 200.0, pause=12.0), solution.plan.origin
    place = LocalFrame(origin.latitude, origin.longitude).to_geodetic(flight.w)
    home = np.where(flight.t < 190.0, 500.0, 510.0)  # set again before the departure
    record = FlightRecord(flight.t, *place, 510.0 + flight.up, home, np.zeros((len(home), 2)), home)
    for start in (None, 200.0):
        found = debriefing(solution, Line.planned(solution), record, start)
        assert found is not None
        priced = price_flight(solution, flight.t - found.start, flight.w)
        assert found.flown.delivered_rate == pytest.approx(priced.delivered_rate, rel=1e-4)
        assert found.flown.delivered_rate < 0.995 * solution.delivered_rate
        assert found.predicted.delivered_rate == pytest.approx(solution.delivered_rate)
        assert found.flown.duration - 45 == pytest.approx(12, abs=0.3)
        assert found.altitude_error == pytest.approx(1.5)
        assert found.seen == pytest.approx(found.flown.delivered_rate / solution.delivered_rate)
        assert found.missing == 0
        assert not found.broken_off
    stays = flight.at(np.minimum(flight.t, 220.0))
    place = LocalFrame(origin.latitude, origin.longitude).to_geodetic(stays)
    record = FlightRecord(flight.t, *place, 510.0 + flight.up, home, np.zeros((len(home), 2)), home)
    found = debriefing(solution, Line.planned(solution), record, 200.0)
    assert found is not None
    assert found.broken_off
    assert found.from_end == pytest.approx(np.linalg.norm(stays[-1] - solution.w[-1]))


def test_how_a_flight_stands() -> None:
    """A pause of 12 s at 25 s of the plan: lateness grows to 12 s, and the rest is expected so."""
    solution, line = solved(), Line.planned(solved())
    whole = flown(solution, 0.0, pause=12.0)
    for now in (5.0, 15.0, 24.0, 30.0, 36.8, 50.0):
        flight = within(whole, -np.inf, now)
        found = standing(solution, line, flight)
        late = float(np.clip(now - 25.0, 0.0, 12.0))
        assert found.late == pytest.approx(late, abs=0.5)
        apart = np.linalg.norm(flight.w[-1] - line.at(np.array([now]))[0])
        assert found.apart == pytest.approx(apart, abs=0.1)
        assert found.astray < 0.1
        t = np.append(solution.t, solution.t[-1] + 30)
        t += np.where(np.append(solution.t, 99) > min(now, 25.0), late, 0)
        expected = price_flight(solution, t, np.vstack([solution.w, solution.w[-1:]]))
        assert found.expected == pytest.approx(45 * expected.delivered_rate, rel=0.01)
        forwarded = expected.relayed.forwarded[: int(min(now, 45.0) / 0.5)]
        assert found.delivered == pytest.approx(0.5 * forwarded.sum(), rel=0.02)
        assert found.delivered <= found.expected + 1e-9
        assert not found.over
    whole = flown(solution, 0.0)
    for now, over in ((44.0, False), (45.2, True), (90.0, True)):
        found = standing(solution, line, within(whole, -np.inf, now))
        assert found.over == over
    assert found.delivered == pytest.approx(found.expected)
