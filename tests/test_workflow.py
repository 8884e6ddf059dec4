"""From a plan to a result, what it writes, what is said of it, and what its relay delivers."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav import read_mission, read_parameters
from faao_mav.autopilot import ARDUCOPTER
from faao_mav.errors import FaaoError, InfeasibleError, InputError
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import MutualInformation, saturation
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.bound import Bound
from faao_mav.report import summary
from faao_mav.report.figures import plan_figures
from faao_mav.report.summary import result_lines
from faao_mav.schedule.prediction import price_flight
from faao_mav.workflow import Result, mission_files, optimize_plan, plan_mission

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
    for name, text in (("m.param", "# for me\nRALLY,7\n"), ("m.fence.waypoints", "QGC WPL 110\n")):
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


def test_what_summaries_say(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
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
    assert result.check is not None
    quiet = replace(
        result,
        check=replace(result.check, findings=()),
        solution=replace(result.solution, starts={"straight": 1.25, "bs-user": 1.5, "user": 1.0}),
        information=MutualInformation(1.9, 1.8, 1.7, 0.001),
        bound=Bound(2 * result.solution.rates.R_avg, exact=False),
    )
    text = summary(quiet, [Path("m.waypoints"), Path("m.param")])
    assert "not compared" not in summary(quiet, verbose=True)
    assert "; no errors or warnings" in text
    assert len(text.splitlines()) <= 10
    assert "files        m.waypoints, m.param" in text
    for word in ("starts", "iteration", "mutual information", "straight start"):
        assert word not in text
        assert word in summary(quiet, verbose=True)
    stopped = replace(result.solution, converged=False, ending="stopped after 3 steps")
    # a type of vehicle that no recorded flight has confirmed, and a method that was stopped
    uncompared = replace(ARDUCOPTER, body=None)
    monkeypatch.setattr("faao_mav.autopilot.vehicle.vehicle_type", lambda *_: uncompared)
    text = summary(replace(result, solution=stopped))
    for word in ("NOT CONVERGED", "stopped after 3 steps", "not compared with recorded flights"):
        assert word in text
    assert "not compared" in result.as_dict()["predicted"]["assumption"]


BAND = {"radio.fading": "none", "radio.bandwidth_mhz": 20}
HALF = {"radio.causal": True, "radio.duplex": "half", "radio.relay.buffer_mbytes": 30}


@pytest.mark.parametrize("kind", [{}, HALF])
def test_everything_tells_the_same(small_plan: MakePlan, kind: dict[str, Any]) -> None:
    result = plan_mission(small_plan(BAND | kind))
    told, solution = result.as_dict(), result.solution
    assert told["delivered_rate"] == solution.delivered_rate <= told["average_rate"] + 1e-12
    # bit/s/Hz on 20 MHz for 10 s, 8 bits a byte
    assert told["delivered_mbytes"] == pytest.approx(25 * solution.delivered_rate)
    assert told["mbit_per_second"]["average_rate"] == pytest.approx(20 * told["average_rate"])
    predicted, flown = told["predicted"], result.prediction
    assert flown is not None
    assert predicted["delivered_rate"] == flown.delivered_rate == flown.relayed.rate
    assert predicted["delivered_mbytes"] == pytest.approx(25 * flown.delivered_rate)
    assert predicted["delivered_rate_by_position"] == flown.delivered_by_position

    # the queue is in megabytes of a bit/s/Hz for half a second on 20 MHz
    (axes,) = next(each.figure.axes for each in plan_figures(result) if each.heading == "Queue")
    assert axes.get_ylabel() == "waiting, megabytes"
    lines = {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.lines}
    assert lines["planned"] == pytest.approx(1.25 * solution.relayed.queue)
    if "buffer" in lines:
        assert lines["planned"].max() <= 30 + 1e-6
    assert ("buffer" in lines) == ("radio.relay.buffer_mbytes" in kind)

    # the mission is judged by it
    assert result.check is not None
    link = result.check.link
    assert link is not None
    assert link.planned_delivered == solution.delivered_rate
    assert link.predicted_delivered == pytest.approx(flown.delivered_rate, rel=1e-2)
    assert link.predicted_mbytes == pytest.approx(25 * link.predicted_delivered)
    worse = replace(link, predicted_rate=0.5 * link.planned_rate)
    assert worse.share == (link.share if link.causal else 0.5)
    worse = replace(link, predicted_delivered=0.4 * link.planned_delivered)
    assert worse.share == pytest.approx(0.4)

    # the planned flight delivers the plan
    t = np.append(solution.t, solution.t[-1] + 30)
    planned = price_flight(solution, t, np.vstack([solution.w, solution.w[-1:]]))
    assert planned.delivered_rate == pytest.approx(solution.delivered_rate, abs=1e-9)


def test_saturation_is_of_the_rate_that_is_planned_for(small_plan: MakePlan) -> None:
    strong = {"radio.base_station.power_dbm": 50, "radio.relay.power_dbm": 50,
              "radio.fading": "none", "radio.causal": True}  # fmt: skip
    found = optimize(small_plan(strong))
    told, full = Result(found).as_dict(), saturation(found)
    assert told["delivered_rate"] > 0
    assert told["delivered_mbytes"] is told["mbit_per_second"] is None  # without a bandwidth
    assert full.ceiling == pytest.approx(2 * 19 / 20)  # nothing is forwarded in the first slot
    assert 0 < full.spare_db < 300
    half = saturation(optimize(small_plan(strong | {"radio.duplex": "half"})))
    assert half.ceiling == pytest.approx(1.0)
    assert half.saturated
