"""The feasible set, and flights to start from: straight, and by way of the stations."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan
from hypothesis import given
from hypothesis import strategies as st
from test_interior import copter, worst

from faao_mav.errors import InfeasibleError, PlanError
from faao_mav.optimizer.design import design
from faao_mav.optimizer.direct import _Search
from faao_mav.optimizer.interior.rewards import StageValues
from faao_mav.optimizer.kinematics import Kinematics, Trajectory, kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.starts import COARSE_SLOTS, block_stage, improve_starts, starts
from faao_mav.optimizer.search.straight import even_speed, straight_flight
from faao_mav.plan import Wind, read_plan

STATIONS = {"bs": np.array([0.0, 0.0]), "user": np.array([300.0, 300.0])}
NAMES = ["straight", "bs", "user", "bs-user", "user-bs"]


def test_every_start_can_be_flown_and_goes_as_far_as_it_can() -> None:
    for seconds in (68.0, 75.0, 300.0):
        k = copter(seconds, start_velocity=None, end_velocity=None)
        found = starts(k, NAMES, STATIONS)
        assert "straight" in found
        for flight in found.values():
            assert max(k.residuals(flight).values()) < 1e-9
    assert list(found) == NAMES
    for name, sign in (("bs-user", 1), ("user-bs", -1)):
        away = [np.linalg.norm(found[name].w - p, axis=1) for p in STATIONS.values()]
        assert np.sign(away[1].argmin() - away[0].argmin()) == sign
        assert all(np.count_nonzero(each < 1e-6) > 20 for each in away)  # it hovers there
    shares = []
    for seconds in (75.0, 80.0, 90.0, 120.0):  # a stop on the way alone takes 5 s
        flight = starts(copter(seconds), ["bs"], STATIONS)["bs"]
        shares.append(np.linalg.norm(flight.w - STATIONS["bs"], axis=1).min())
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 100
    assert shares[-1] < 1e-6
    # what cannot be had is left out
    assert list(starts(copter(68.0), ["bs", "user"], STATIONS)) == ["straight"]
    across = copter(300, start_velocity=np.array([1.0, 1.0]))
    assert list(starts(across, ["bs"], STATIONS)) == ["straight"]


def test_a_block_has_the_mean_of_its_slots() -> None:
    rng = np.random.default_rng(0)
    slope = rng.normal(size=(2, 2, 501))

    def stage(w: np.ndarray) -> StageValues:
        value = np.einsum("cjn,cn->jn", slope, w)
        return StageValues(value, slope, np.zeros((3, 2, 501)))

    w, shift = rng.normal(size=(2, 2, COARSE_SLOTS))
    blocks = block_stage(stage, 501, COARSE_SLOTS)
    found = blocks(w)
    held = w[:, np.rint(np.arange(501) * (COARSE_SLOTS - 1) / 500).astype(int)]
    assert found.value.mean(axis=1) == pytest.approx(stage(held).value.mean(axis=1))
    moved = blocks(w + shift).value - found.value
    assert moved == pytest.approx(np.einsum("cjn,cn->jn", found.gradient, shift))


def test_what_is_rejected_would_not_have_won() -> None:
    """The paper's plan at T = 80 s and 0 dBm: it has several local optima."""
    powers = {f"radio.{name}.power_dbm": 0 for name in ("base_station", "relay")}
    changes: dict[str, Any] = powers | {"flight.duration": 80}
    changes |= {"flight.time_step": 0.5, "optimizer.method": "direct"}
    plan = read_plan(MISSIONS / "paper_active.yaml").changed(changes)
    solution = optimize(plan)
    assert list(solution.starts) == NAMES
    alone = [optimize(plan.changed({"optimizer.starts": [name]})).rates.R_avg for name in NAMES]
    assert solution.rates.R_avg == pytest.approx(max(alone), abs=plan.optimizer.tolerance)
    problem = build_problem(plan)
    routes = starts(problem.kinematics, NAMES, STATIONS)
    improved = improve_starts(problem, rate_field(problem, design(plan)), routes, 50)
    assert all(value <= solution.rates.R_avg for value in solution.starts.values())
    for flight in improved.values():
        assert max(problem.kinematics.residuals(flight).values()) < 1e-7


def test_of_equal_flights_the_first_is_best_whatever_rounding_says(small_plan: MakePlan) -> None:
    problem = build_problem(small_plan())
    scheme = design(problem.plan)
    (flight,) = starts(problem.kinematics, ["straight"], {}).values()
    search = _Search(problem, scheme, rate_field(problem, scheme))
    values = {"bs": 0.5, "user": 0.5 + 1e-15}
    assert search.best(values, dict.fromkeys(values, flight)) == "bs"


def make(**changes: Any) -> Kinematics:
    values = {"start": np.array([0.0, 50.0]), "end": np.array([50.0, 0.0]), "slots": 21}
    return copter(0, **(values | {"max_speed": 20.0, "max_acceleration": 5.0} | changes))


ENDS = [(None, None), ([0, 0], None), ([3, -3], [5, -5]), ([0, 6], [4, 1]), ([-5, 5], None)]


@given(st.floats(0.05, 1), st.floats(0, 1), st.integers(3, 60), st.booleans(), st.integers(0, 2))
def test_plans_that_are_accepted_can_be_flown(
    small_plan: MakePlan, step: float, share: float, slots: int, bounded: bool, ends: int
) -> None:
    """The closed form of the reader and the start agree on what is possible."""
    step = round(step, 2)
    duration = round(step * slots, 6)
    distance = share * 20 * duration
    kinds = [("hover", "hover"), ("hover", "free"), ("free", "hover")][ends]
    flight = {
        "time_step": step,
        "duration": duration,
        "start": [0, 0],
        "end": [distance, 0],
        "start_velocity": kinds[0],
        "end_velocity": kinds[1],
        "bound_first_acceleration": bounded,
    }
    try:
        plan = small_plan({f"flight.{key}": value for key, value in flight.items()})
    except PlanError as error:
        assert "too short" in str(error)
        return
    kin = kinematics(plan)
    assert worst(kin, straight_flight(kin)) < 1e-6


COPTER = make(
    start=np.zeros(2),
    end=np.array([100.0, 50.0]),
    slots=81,
    max_speed=8.0,
    max_acceleration=2.0,
    max_airspeed=9.0,
)
FREE = replace(COPTER, start_velocity=None, end_velocity=None)


def test_starts_in_wind_keep_the_limits_or_there_is_none() -> None:
    there = {"bs": np.zeros(2), "user": np.array([80.0, 90.0])}
    for calm, (speed, degrees) in product(
        (COPTER, FREE), ((3.0, 135.0), (7.0, 20.0), (8.9, 250.0))
    ):
        kin = replace(calm, wind=Wind(speed=speed, from_degrees=degrees).velocity)
        try:
            flights = starts(kin, ["straight", "bs", "user-bs"], there)
        except InfeasibleError:
            distance = float(np.hypot(*kin.end))
            assert even_speed(kin, kin.end / distance, distance) is None
        else:
            for flight in flights.values():
                assert worst(kin, flight) < 1e-7


def test_the_frame_of_the_air_is_calm() -> None:
    windy = replace(FREE, wind=(4.0, -3.0), min_speed=3.0, max_speed=20.0)
    flight = straight_flight(windy.in_the_air())
    assert worst(windy.in_the_air(), flight) < 1e-9
    assert worst(windy, windy.over_ground(flight)) < 1e-9


def test_the_straight_start_is_feasible_at_all_ends() -> None:
    for ends, bounded, end in product(ENDS, (True, False), ([50.0, 0.0], [0.0, 50.0])):
        first, last = (None if v is None else np.array(v, dtype=float) for v in ends)
        kin = make(
            start_velocity=first,
            end_velocity=last,
            bound_first_acceleration=bounded,
            end=np.array(end),
        )
        flight = straight_flight(kin)
        assert flight.w.shape == flight.v.shape == flight.a.shape == (21, 2)
        assert worst(kin, flight) < 1e-7
    with pytest.raises(InfeasibleError, match="end velocities"):
        straight_flight(make(start_velocity=np.array([20.0, 0.0]), slots=5))


def test_hover_to_hover_is_straight_and_even() -> None:
    flight = straight_flight(make())
    assert flight.w @ np.array([1.0, 1.0]) == pytest.approx(50)
    speed = np.linalg.norm(flight.v, axis=1)
    assert speed == pytest.approx(speed[::-1], abs=1e-9)
    # 10 s of which two ramps at 5 m/s²: 70.7 m = v (10 - v / 5), up to the discretisation
    assert speed.max() == pytest.approx(8.5, abs=0.1)


def test_residuals_see_every_violation() -> None:
    kin = make()
    flight = straight_flight(kin)
    w, v, a = flight.w.copy(), flight.v.copy(), flight.a.copy()
    w[5] += 1
    v[7] += [30, 0]
    a[3] += [9, 0]
    v[0] += 0.5
    v[-1] += 0.25
    w[-1] += 2
    found = kin.residuals(Trajectory(w, v, a))
    assert found["(11) position"] > 1
    assert found["(12) velocity"] > 20
    assert found["(13d) ends"] == pytest.approx(2)
    assert found["(13e) speed"] > 10
    assert found["(13f) acceleration"] > 3
    assert found["start velocity"] == pytest.approx(0.5)
    assert found["end velocity"] == pytest.approx(0.25)
    free = make(bound_first_acceleration=False)
    flight = straight_flight(free)
    assert np.linalg.norm(flight.a[0]) > free.max_acceleration
    assert worst(free, flight) < 1e-9
    assert worst(kin, flight) > 1
