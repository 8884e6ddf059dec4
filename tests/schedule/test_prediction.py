"""What the predicted flight of a mission delivers, against the plan."""

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.arrays import Real
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule import convert
from faao_mav.schedule.prediction import price_flight, rates_along

GENTLE = {
    "vehicle.max_speed": 8,
    "vehicle.max_acceleration": 2,
    "flight.duration": 30,
    "radio.fading": "none",
}


@pytest.fixture(scope="module")
def solution(small_plan: MakePlan) -> Solution:
    return optimize(small_plan(GENTLE))


def held(solution: Solution, seconds: float = 30.0) -> tuple[Real, Real]:
    """The plan as a flight that stays at w_F afterwards, finely sampled."""
    t = np.arange(-5.0, solution.t[-1] + seconds, 0.05)
    return t, np.stack([np.interp(t, solution.t, x) for x in solution.w.T], axis=-1)


def test_the_plan_itself_delivers_the_plan(solution: Solution) -> None:
    found = price_flight(solution, *held(solution))
    assert found.rates.R_avg == pytest.approx(solution.rates.R_avg, abs=1e-9)
    assert found.by_position.R_avg == pytest.approx(solution.rates.R_avg, abs=1e-9)
    assert found.duration == pytest.approx(30, abs=0.05)
    assert found.max_position_error == pytest.approx(0, abs=1e-9)
    assert found.max_path_error == pytest.approx(0, abs=0.1)


def test_a_mission_delivers_nearly_the_plan(solution: Solution) -> None:
    conversion = convert(solution)
    track = conversion.schedule.track()
    found = price_flight(solution, track["predicted_t"], track["predicted_w"])
    assert found.rates.R_avg == pytest.approx(solution.rates.R_avg, rel=0.02)
    assert found.duration == pytest.approx(30, abs=1)
    assert found.w == pytest.approx(conversion.schedule.positions(solution.t))
    I_U, I_G = rates_along(solution, found.w)
    assert found.I_U == pytest.approx(I_U)
    assert found.rates.R_G == pytest.approx(I_G.mean())
    rms = conversion.schedule.deviation.rms  # of the trajectory to a millimetre
    assert found.rms_position_error == pytest.approx(rms, abs=1e-3)
    assert 0 < found.rms_position_error <= found.max_position_error
    assert found.max_path_error <= found.max_position_error + 1e-9


@pytest.mark.parametrize("late", [-1.5, 0.7, 3.0, 12.0])
def test_the_duration_is_by_how_much_the_flight_is_late(solution: Solution, late: float) -> None:
    t, w = held(solution)
    found = price_flight(solution, t + late, w)
    assert found.duration == pytest.approx(30 + late, abs=1e-3)
    assert found.rms_position_error > 0.5
    # a radio that goes by position hardly minds
    assert found.by_position.R_avg >= found.rates.R_avg - 1e-3


def test_a_flight_that_goes_on_beyond_w_F_is_not_late(solution: Solution) -> None:
    t, w = held(solution)
    beyond = w + np.outer(np.maximum(t - solution.t[-1], 0.0), [8.0, 0.0])
    assert price_flight(solution, t, beyond).duration == pytest.approx(30, abs=0.05)


def test_a_flight_that_never_comes_near_is_as_late_as_it_is_known(solution: Solution) -> None:
    t, w = held(solution)
    short = solution.w[0] + 0.5 * (w - solution.w[0])
    found = price_flight(solution, t, short)
    assert found.max_path_error > 10
    assert found.duration > 29
