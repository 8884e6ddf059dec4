"""From a plan to a result, what it writes, and what is said of it."""

from dataclasses import replace
from pathlib import Path

import pytest
from conftest import MakePlan

from faao_mav import plan_mission, read_mission, read_parameters
from faao_mav.autopilot import ARDUCOPTER
from faao_mav.errors import FaaoError, InfeasibleError, InputError
from faao_mav.optimizer.pricing import MutualInformation
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.bound import Bound
from faao_mav.report import summary
from faao_mav.report.summary import result_lines
from faao_mav.workflow import Result, mission_files, optimize_plan

QUICK = {"radio.fading": "none", "optimizer.starts": ["straight"]}
FENCED = QUICK | {
    "flight.start": [0, 60],
    "flight.end": [60, 0],
    "flight.duration": 30,
    "vehicle.max_speed": 8,
    "flight.start_velocity": "hover",
    "flight.end_velocity": "hover",
    "fence.margin": 3,
    "fence.inclusion": [[-40, -40], [120, -40], [120, 120], [-40, 120]],
    "fence.exclusion": [{"polygon": [[-10, 20], [10, 20], [10, 40], [-10, 40]]}],
}
"""A zone between home and the flight's start."""


@pytest.fixture(scope="module")
def result(small_plan: MakePlan) -> Result:
    return plan_mission(small_plan(QUICK | {"name": "over the hill"}))


@pytest.fixture(scope="module")
def fenced(small_plan: MakePlan) -> Result:
    return plan_mission(small_plan(FENCED))


def test_files_come_together_and_go_when_they_are_no_longer_the_missions(
    result: Result, fenced: Result, small_plan: MakePlan, tmp_path: Path
) -> None:
    def names() -> set[str]:
        return {path.name for path in tmp_path.iterdir()}

    assert result.conversion is not None
    out = tmp_path / "m.waypoints"
    mission, beside = written = result.write(out)
    assert names() == {"m.waypoints", "m.param"}
    assert read_mission(mission).items == result.conversion.mission.items
    assert read_parameters(beside) == result.conversion.parameters
    assert result.write(mission) == written == mission_files(mission, result.solution.plan)
    other = plan_mission(small_plan(QUICK | {"vehicle.autopilot": "px4"}))
    assert {path.name for path in other.write(out)} == names() == {"m.waypoints", "m.params"}
    result.write(out)

    fence = fenced.solution.plan.geofence
    assert [path.name for path in fenced.write(out)][2:] == ["m.fence.waypoints"]
    assert read_mission(out).fence == fence
    in_plan, *_ = fenced.write(tmp_path / "p.plan")
    assert names() == {"m.waypoints", "m.param", "m.fence.waypoints", "p.plan", "p.param"}
    assert read_mission(in_plan).fence == fence
    result.write(out)
    assert "m.fence.waypoints" not in names()

    # a user's own files are not replaced, nor removed
    for name, text in (("m.fence.waypoints", "QGC WPL 110\n"), ("m.param", "WPNAV_SPEED,700\n")):
        own = tmp_path / name
        own.write_text(text)
        with pytest.raises(InputError, match="not of an earlier run"):
            fenced.write(out)
        assert own.read_text() == text


def test_how_near_the_fence_the_flight_comes(fenced: Result, small_plan: MakePlan) -> None:
    assert fenced.flyable
    told = fenced.as_dict()["fence"]
    assert (told["areas"], told["margin"]) == (2, 3)
    assert told["planned_clearance"] >= 3
    assert told["planned_clearance"] > told["predicted_clearance"] > 1
    lines = list(result_lines(fenced))
    first = next(k for k, (label, _) in enumerate(lines) if label == "fence")
    assert lines[first][1] == ", ".join(told["zones"]) == "inclusion polygon, exclusion polygon"
    kept = f"{told['planned_clearance']:.1f} m (margin 3 m)"
    assert lines[first + 1][1].startswith(f"the plan keeps {kept}")
    # a wall on the way, which the flight would cut within the path tolerance
    wall = {"polygon": [[18, 22], [22, 22], [22, 60], [18, 60]]}
    changes = {"fence.margin": 0.3, "fence.exclusion": [wall], "mission.path_tolerance": 3}
    narrow = plan_mission(small_plan(FENCED | changes))
    told = narrow.as_dict()["fence"]
    assert 0.3 <= told["planned_clearance"] < 0.7
    assert told["predicted_clearance"] >= 0
    assert "fence-leg" not in {finding.rule for finding in narrow.findings}


def test_a_flight_without_a_mission_is_a_result(
    result: Result, small_plan: MakePlan, tmp_path: Path
) -> None:
    none = plan_mission(small_plan(QUICK | {"mission.max_items": 4}))
    assert none.solution.rates == result.solution.rates
    assert (none.conversion, none.prediction, none.flyable) == (None, None, False)
    with pytest.raises(InfeasibleError, match=r"mission\.max_items"):
        none.write(tmp_path / "m.plan")
    text, data = summary(none), none.as_dict()
    assert "there is no mission for it" in text
    assert "mission      none: " in text
    assert not any(word in text for word in ("predicted", "checks"))
    assert (data["mission"], data["predicted"], data["validation"]) == (None, None, [])
    assert data["no_mission"] == str(none.no_mission)
    # a row of a study needs no mission
    alone = optimize_plan(result.solution.plan)
    assert (alone.solution.rates, alone.information) == (result.solution.rates, result.information)
    assert (alone.conversion, alone.check, alone.findings) == (None, None, ())
    assert alone.as_dict().keys() == data.keys() == result.as_dict().keys()
    with pytest.raises(FaaoError, match="only optimised"):
        alone.write(tmp_path / "m.plan")
    assert list(tmp_path.iterdir()) == []


def test_a_summary_of_a_flight_without_findings_is_short(result: Result) -> None:
    assert result.check is not None
    quiet = replace(
        result,
        check=replace(result.check, findings=()),
        solution=replace(result.solution, starts={"straight": 1.25, "bs-user": 1.5, "user": 1.0}),
        information=MutualInformation(1.9, 1.8, 1.7, 0.001),
        bound=Bound(2 * result.solution.rates.R_avg, exact=False),
    )
    text = summary(quiet, [Path("m.waypoints"), Path("m.param")])
    assert "; no errors or warnings" in text
    assert len(text.splitlines()) <= 10
    assert "files        m.waypoints, m.param" in text
    for word in ("starts", "iteration", "mutual information", "straight start"):
        assert word not in text
        assert word in summary(quiet, verbose=True)
    stopped = replace(result.solution, converged=False, ending="stopped after 3 steps")
    text = summary(replace(result, solution=stopped))
    assert "NOT CONVERGED" in text
    assert "stopped after 3 steps" in text


def test_a_prediction_that_no_flight_has_confirmed_says_so(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "not compared" not in summary(result, verbose=True)
    uncompared = replace(ARDUCOPTER, body=None)
    monkeypatch.setattr("faao_mav.autopilot.vehicle.vehicle_type", lambda *_: uncompared)
    assert "not compared with recorded flights" in summary(result)
    assert "not compared" in result.as_dict()["predicted"]["assumption"]


def test_it_says_what_planning_for_the_mutual_information_gains(result: Result) -> None:
    wanted = result.solution.plan.changed({"optimizer.rate": "mutual_information"})
    result = replace(result, information=MutualInformation(1.9, 1.8, 1.7, 0.001))
    for gain, doubted in ((0.05, False), (0.0005, True)):
        solution = replace(result.solution, problem=build_problem(wanted), gain=gain)
        text = summary(replace(result, solution=solution), verbose=True)
        assert "of mutual information (base station to UAV" in text
        assert f"{gain:.4f} bit/s/Hz more than by the plan for the cutoff rate" in text
        assert ("below the error of averages over the noise, 0.001" in text) is doubted
        told = replace(result, solution=solution).as_dict()
        assert (told["rate"], told["gain_over_cutoff"]) == ("mutual_information", gain)
    told = result.as_dict()
    assert (told["rate"], told["gain_over_cutoff"]) == ("cutoff", None)
