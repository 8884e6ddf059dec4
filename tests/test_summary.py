"""The summary for people."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.cli.summary import Result, as_dict, as_text
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import MutualInformation, saturation
from faao_mav.optimizer.search.bound import Bound
from faao_mav.schedule import convert
from faao_mav.schedule.prediction import predict_delivery


@pytest.fixture(scope="module")
def result(small_plan: MakePlan) -> Result:
    plan = small_plan({"radio.fading": "none", "name": "over the hill"})
    solution = optimize(plan)
    conversion = convert(solution)
    return Result(
        solution=replace(solution, starts={"straight": 1.25, "bs-user": 1.5, "user": 1.0}),
        information=MutualInformation(1.9, 1.8, 0.001),
        fresh=None,
        saturation=saturation(solution),
        bound=Bound(2 * solution.rates.R_avg, exact=False),
        conversion=conversion,
        prediction=predict_delivery(solution, conversion),
        seconds_optimize=1.0,
        seconds_total=2.0,
        written=(),
    )


def test_a_prediction_that_no_flight_has_confirmed_says_so(result: Result) -> None:
    vehicle = replace(result.conversion.vehicle, kind="plane")
    plane = replace(result, conversion=replace(result.conversion, vehicle=vehicle))
    assert "not compared with recorded flights" in as_text(plane)
    assert as_dict(plane)["predicted"]["calibrated"] is False
    assert "not compared" not in as_text(result)
    assert as_dict(result)["predicted"]["calibrated"] is True


def test_it_says_what_was_found(result: Result) -> None:
    lines = as_text(result).splitlines()
    assert lines[0] == "over the hill"
    assert f"{result.solution.rates.R_avg:.4f} bit/s/Hz of at most 2" in lines[1]
    text = "\n".join(lines)
    assert "mutual information 1.800 +- 0.001" in text
    assert "3, from 1.0000 (user) to 1.5000 (bs-user) bit/s/Hz" in text
    assert "within 50 % of the best that any route can do" in text
    assert "(numerical)" in text
    assert "converged after" in text
    assert "nothing: give --out" in text


def test_a_vehicle_that_keeps_its_parameters_is_told_of_none(result: Result) -> None:
    kept = replace(result, conversion=replace(result.conversion, parameters={}))
    assert "parameters" not in as_text(kept)
    assert as_dict(kept)["mission"]["parameters"] == {}


def test_a_run_that_did_not_converge_says_so(result: Result) -> None:
    stopped = replace(result.solution, converged=False, ending="stopped after 3 steps")
    text = as_text(replace(result, solution=stopped))
    assert "NOT CONVERGED" in text
    assert "stopped after 3 steps" in text


def test_numbers_for_programs_are_the_solutions(result: Result) -> None:
    data = as_dict(result)
    assert data["average_rate"] == result.solution.rates.R_avg
    assert data["upper_bound"] == 2 * result.solution.rates.R_avg
    conversion, prediction = result.conversion, result.prediction
    assert data["mission"]["items"] == len(conversion.mission.items)
    assert data["mission"]["parameters"] == conversion.parameters
    route = conversion.schedule.route
    relay = route.positions[route.first : route.last + 1]
    assert data["mission"]["distance"] == pytest.approx(
        np.linalg.norm(np.diff(relay, axis=0), axis=1).sum()
    )
    predicted = data["predicted"]
    assert predicted["average_rate"] == min(predicted["rate_bs_uav"], predicted["rate_uav_user"])
    assert predicted["duration"] == data["mission"]["duration"] == prediction.duration
    assert predicted["rms_position_error"] == prediction.rms_position_error
    assert data["seconds"] == {"optimize": 1.0, "total": 2.0}


def test_it_says_how_the_mission_will_fly_and_what_it_needs(result: Result) -> None:
    text = as_text(result)
    assert f"predicted    {result.prediction.rates.R_avg:.4f} bit/s/Hz" in text
    assert f"{result.prediction.rms_position_error:.1f} m rms from the plan" in text
    for name, value in result.conversion.parameters.items():
        assert f"{name} {value:g}" in text
