"""The summary for people."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.pricing import MutualInformation
from faao_mav.optimizer.search.bound import Bound
from faao_mav.report import summary
from faao_mav.schedule import Conversion
from faao_mav.vehicle import ARDUCOPTER
from faao_mav.workflow import Result, plan_mission


@pytest.fixture(scope="module")
def result(small_plan: MakePlan) -> Result:
    found = plan_mission(small_plan({"radio.fading": "none", "name": "over the hill"}))
    starts = {"straight": 1.25, "bs-user": 1.5, "user": 1.0}
    return replace(
        found,
        solution=replace(found.solution, starts=starts),
        information=MutualInformation(1.9, 1.8, 1.7, 0.001),
        bound=Bound(2 * found.solution.rates.R_avg, exact=False),
        seconds_optimize=1.0,
        seconds_total=2.0,
    )


@pytest.fixture(scope="module")
def conversion(result: Result) -> Conversion:
    assert result.conversion is not None
    return result.conversion


def test_a_prediction_that_no_flight_has_confirmed_says_so(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "not compared" not in summary(result)
    assert result.as_dict()["predicted"]["calibrated"] is True
    uncompared = replace(ARDUCOPTER, calibrated=False)
    monkeypatch.setattr("faao_mav.vehicle.vehicle.vehicle_type", lambda *_: uncompared)
    assert "not compared with recorded flights" in summary(result)
    assert result.as_dict()["predicted"]["calibrated"] is False


def test_it_says_what_was_found(result: Result) -> None:
    lines = summary(result).splitlines()
    assert lines[0] == "over the hill"
    assert f"{result.solution.rates.R_avg:.4f} bit/s/Hz of at most 2" in lines[1]
    text = "\n".join(lines)
    assert "mutual information 1.800 +- 0.001, 1.700 delivered" in text
    assert "more than by the plan" not in text
    assert "3, from 1.0000 (user) to 1.5000 (bs-user) bit/s/Hz" in text
    assert "within 50 % of the best that any route can do" in text
    assert "(numerical)" in text
    assert "converged after" in text
    assert "nothing: give --out" in text


def test_it_says_what_planning_for_the_mutual_information_gains(result: Result) -> None:
    plan = result.solution.plan
    wanted = plan.changed({"optimizer.rate": "mutual_information"})
    for gain, doubted in ((0.05, False), (0.0005, True)):
        solution = replace(result.solution, plan=wanted, gain=gain)
        text = summary(replace(result, solution=solution))
        assert "of mutual information (base station to UAV" in text
        assert f"{gain:.4f} bit/s/Hz more than by the plan for the cutoff rate" in text
        assert ("below the error of averages over the noise, 0.001" in text) is doubted
        told = replace(result, solution=solution).as_dict()
        assert told["rate"] == "mutual_information"
        assert told["gain_over_cutoff"] == gain
    assert result.as_dict()["rate"] == "cutoff"
    assert result.as_dict()["gain_over_cutoff"] is None


def test_a_vehicle_that_keeps_its_parameters_is_told_of_none(
    result: Result, conversion: Conversion
) -> None:
    kept = replace(result, conversion=replace(conversion, parameters={}))
    assert "parameters" not in summary(kept)
    assert kept.as_dict()["mission"]["parameters"] == {}


def test_a_run_that_did_not_converge_says_so(result: Result) -> None:
    stopped = replace(result.solution, converged=False, ending="stopped after 3 steps")
    text = summary(replace(result, solution=stopped))
    assert "NOT CONVERGED" in text
    assert "stopped after 3 steps" in text


def test_numbers_for_programs_are_the_solutions(result: Result, conversion: Conversion) -> None:
    data = result.as_dict()
    assert data["average_rate"] == result.solution.rates.R_avg
    assert data["upper_bound"] == 2 * result.solution.rates.R_avg
    prediction = result.prediction
    assert prediction is not None
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


def test_it_says_how_the_mission_will_fly_and_what_it_needs(
    result: Result, conversion: Conversion
) -> None:
    text, prediction = summary(result), result.prediction
    assert prediction is not None
    assert f"predicted    {prediction.rates.R_avg:.4f} bit/s/Hz" in text
    assert f"{prediction.rms_position_error:.1f} m rms from the plan" in text
    for name, value in conversion.parameters.items():
        assert f"{name} {value:g}" in text


def test_a_flight_without_a_mission_says_why_and_has_no_figures_of_it(result: Result) -> None:
    none = Result(result.solution, no_mission=InfeasibleError("more than 4 items"))
    assert "mission      none: more than 4 items" in summary(none)
    assert "predicted" not in summary(none)
    assert "checked" not in summary(none)
    data = none.as_dict()
    assert data.keys() == result.as_dict().keys()
    assert (data["mission"], data["predicted"], data["validation"]) == (None, None, [])
    assert data["no_mission"] == "more than 4 items"
