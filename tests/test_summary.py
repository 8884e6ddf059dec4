"""The summary for people."""

from dataclasses import replace
from pathlib import Path

import pytest
from conftest import MakePlan

from faao_mav.autopilot import ARDUCOPTER
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.pricing import MutualInformation
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.bound import Bound
from faao_mav.report import summary
from faao_mav.validate.check import check
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


def test_a_prediction_that_no_flight_has_confirmed_says_so(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "not compared" not in summary(result, verbose=True)
    uncompared = replace(ARDUCOPTER, body=None)
    monkeypatch.setattr("faao_mav.autopilot.vehicle.vehicle_type", lambda *_: uncompared)
    assert "not compared with recorded flights" in summary(result)
    assert "not compared" in result.as_dict()["predicted"]["assumption"]


def test_a_summary_of_a_flight_without_findings_is_short(result: Result) -> None:
    assert result.check is not None
    result = replace(result, check=replace(result.check, findings=()))
    text = summary(result, [Path("m.waypoints"), Path("m.param")])
    assert "; no errors or warnings" in text
    assert len(text.splitlines()) <= 10
    assert "files        m.waypoints, m.param" in text
    for word in ("starts", "iteration", "mutual information", "straight start"):
        assert word not in text
        assert word in summary(result, verbose=True)


def test_the_summary_and_the_findings_tell_one_flight(result: Result) -> None:
    assert result.check is not None
    link, prediction = result.check.link, result.prediction
    assert link is not None
    assert prediction is not None
    assert link.rms_position_error == prediction.rms_position_error
    assert link.predicted_duration == prediction.duration
    again = check(result.check.mission, result.check.vehicle, solution=result.solution).prediction
    assert again is not None
    assert again.rms_position_error == prediction.rms_position_error


def test_it_says_what_planning_for_the_mutual_information_gains(result: Result) -> None:
    plan = result.solution.plan
    wanted = plan.changed({"optimizer.rate": "mutual_information"})
    for gain, doubted in ((0.05, False), (0.0005, True)):
        solution = replace(result.solution, problem=build_problem(wanted), gain=gain)
        text = summary(replace(result, solution=solution), verbose=True)
        assert "of mutual information (base station to UAV" in text
        assert f"{gain:.4f} bit/s/Hz more than by the plan for the cutoff rate" in text
        assert ("below the error of averages over the noise, 0.001" in text) is doubted
        told = replace(result, solution=solution).as_dict()
        assert told["rate"] == "mutual_information"
        assert told["gain_over_cutoff"] == gain
    assert result.as_dict()["rate"] == "cutoff"
    assert result.as_dict()["gain_over_cutoff"] is None


def test_a_run_that_did_not_converge_says_so(result: Result) -> None:
    stopped = replace(result.solution, converged=False, ending="stopped after 3 steps")
    text = summary(replace(result, solution=stopped))
    assert "NOT CONVERGED" in text
    assert "stopped after 3 steps" in text


def test_a_flight_without_a_mission_says_why_and_has_no_figures_of_it(result: Result) -> None:
    none = Result(result.solution, no_mission=InfeasibleError("more than 4 items"))
    assert "mission      none: more than 4 items" in summary(none)
    assert "predicted" not in summary(none)
    assert "there is no mission for it" in summary(none)
    assert "checks" not in summary(none)
    data = none.as_dict()
    assert data.keys() == result.as_dict().keys()
    assert (data["mission"], data["predicted"], data["validation"]) == (None, None, [])
    assert data["no_mission"] == "more than 4 items"
