"""From a plan to a result, and what it writes."""

from pathlib import Path

import pytest
from conftest import SMALL, MakePlan, edited

from faao_mav import (
    Vehicle,
    check,
    parse_plan,
    plan_mission,
    read_mission,
    read_parameters,
)
from faao_mav.errors import FaaoError, InfeasibleError, InputError
from faao_mav.report.summary import result_lines
from faao_mav.workflow import Result, mission_files, optimize_plan

QUICK = {"radio.fading": "none", "optimizer.starts": ["straight"]}


@pytest.fixture(scope="module")
def result(small_plan: MakePlan) -> Result:
    return plan_mission(small_plan(QUICK))


@pytest.fixture(scope="module")
def too_many_items(small_plan: MakePlan) -> Result:
    return plan_mission(small_plan(QUICK | {"mission.max_items": 4}))


def test_a_mission_comes_with_the_parameters_that_it_is_timed_for(
    result: Result, tmp_path: Path
) -> None:
    assert result.conversion is not None
    mission, beside = result.write(tmp_path / "m.waypoints")
    assert (mission.name, beside.name) == ("m.waypoints", "m.param")
    assert read_mission(mission).items == result.conversion.mission.items
    assert read_parameters(beside) == result.conversion.parameters
    assert result.write(mission) == (mission, beside)  # its own may be replaced
    assert mission_files(mission, result.solution.plan) == (mission, beside)


def test_what_is_written_is_in_time(tmp_path: Path) -> None:
    lively = {"vehicle.max_speed": 8, "flight.end": [120, 0], "flight.duration": 40}
    result = plan_mission(parse_plan(edited(SMALL, QUICK | lively)))
    out, beside = result.write(tmp_path / "m.plan")
    mission, loaded = read_mission(out), Vehicle(parameters=read_parameters(beside))
    checked = check(mission, loaded, solution=result.solution)
    assert [finding.rule for finding in checked.findings if finding.level != "note"] == []
    without = check(mission, Vehicle(), solution=result.solution)
    assert "link-late" in {finding.rule for finding in without.findings}


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
def fenced(small_plan: MakePlan) -> Result:
    return plan_mission(small_plan(FENCED))


def test_the_fence_goes_with_the_mission(fenced: Result, tmp_path: Path) -> None:
    assert fenced.flyable
    fence = fenced.solution.plan.geofence
    in_plan, *_ = fenced.write(tmp_path / "m.plan")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.param", "m.plan"]
    assert read_mission(in_plan).fence == fence
    assert [path.name for path in fenced.write(tmp_path / "m.waypoints")] == [
        "m.waypoints",
        "m.param",
        "m.fence.waypoints",
    ]
    assert read_mission(tmp_path / "m.waypoints").fence == fence


def test_how_near_the_fence_the_flight_comes(fenced: Result) -> None:
    told = fenced.as_dict()["fence"]
    assert (told["areas"], told["margin"]) == (2, 3)
    assert told["planned_clearance"] >= 3
    assert told["planned_clearance"] > told["predicted_clearance"] > 1
    lines = list(result_lines(fenced))
    first = next(k for k, (label, _) in enumerate(lines) if label == "fence")
    assert lines[first][1] == ", ".join(told["zones"]) == "inclusion polygon, exclusion polygon"
    kept = f"{told['planned_clearance']:.1f} m (margin 3 m)"
    assert lines[first + 1][1].startswith(f"the plan keeps {kept}")


def test_a_fence_is_removed_with_its_mission(
    result: Result, fenced: Result, tmp_path: Path
) -> None:
    beside = tmp_path / "m.fence.waypoints"
    fenced.write(tmp_path / "m.waypoints")
    assert beside.is_file()
    result.write(tmp_path / "m.waypoints")
    assert not beside.exists()
    beside.write_text("QGC WPL 110\n")
    with pytest.raises(InputError, match="fence is to go there, but it is not of an earlier run"):
        fenced.write(tmp_path / "m.waypoints")
    assert beside.read_text() == "QGC WPL 110\n"


def test_a_narrow_margin_makes_a_finer_route(small_plan: MakePlan) -> None:
    """A wall on the way, which the flight would cut within the path tolerance."""
    wall = {"polygon": [[18, 22], [22, 22], [22, 60], [18, 60]]}
    changes = {"fence.margin": 0.3, "fence.exclusion": [wall], "mission.path_tolerance": 3}
    narrow = plan_mission(small_plan(FENCED | changes))
    assert narrow.fence is not None
    assert 0.3 <= narrow.fence.planned_clearance < 0.7
    assert narrow.fence.predicted_clearance is not None
    assert narrow.fence.predicted_clearance >= 0
    assert "fence-leg" not in {finding.rule for finding in narrow.findings}


def test_the_vehicles_own_parameters_are_not_replaced(result: Result, tmp_path: Path) -> None:
    (tmp_path / "m.param").write_text("WPNAV_SPEED,700\n")
    with pytest.raises(InputError, match="not of an earlier run"):
        result.write(tmp_path / "m.waypoints")
    assert [path.name for path in tmp_path.iterdir()] == ["m.param"]


def test_a_vehicle_that_keeps_its_parameters_gets_a_mission_alone(
    small_plan: MakePlan, tmp_path: Path
) -> None:
    kept = plan_mission(small_plan(QUICK | {"mission.parameters": "keep"}))
    assert kept.write(tmp_path / "m.plan") == (tmp_path / "m.plan",)


@pytest.mark.parametrize(
    "changes", [{"mission.parameters": "keep"}, {"vehicle.autopilot": "px4"}], ids=["keep", "px4"]
)
def test_parameters_of_an_earlier_mission_do_not_stay_beside_the_new_one(
    result: Result, small_plan: MakePlan, tmp_path: Path, changes: dict[str, str]
) -> None:
    _, outdated = result.write(tmp_path / "m.waypoints")
    own = tmp_path / "n.param"
    own.write_text("WPNAV_SPEED,700\n")
    anew = plan_mission(small_plan(QUICK | changes))
    written = anew.write(tmp_path / "m.waypoints")
    assert outdated not in written
    assert sorted(tmp_path.iterdir()) == sorted({*written, own})
    anew.write(tmp_path / "n.waypoints")
    assert own.read_text() == "WPNAV_SPEED,700\n"  # no run has written it


def test_a_flight_without_a_mission_is_a_result(too_many_items: Result, tmp_path: Path) -> None:
    assert too_many_items.solution.rates.R_avg > 0
    assert (too_many_items.conversion, too_many_items.prediction) == (None, None)
    assert not too_many_items.flyable
    assert "mission.max_items" in str(too_many_items.no_mission)
    with pytest.raises(InfeasibleError, match=r"mission\.max_items"):
        too_many_items.write(tmp_path / "m.plan")
    with pytest.raises(FaaoError, match="only optimised"):
        optimize_plan(too_many_items.solution.plan).write(tmp_path / "m.plan")
    assert list(tmp_path.iterdir()) == []


def test_a_row_of_a_study_needs_no_mission(result: Result) -> None:
    alone = optimize_plan(result.solution.plan)
    assert alone.solution.rates == result.solution.rates
    assert alone.information == result.information
    assert (alone.conversion, alone.check, alone.findings) == (None, None, ())
    assert alone.as_dict().keys() == result.as_dict().keys()
