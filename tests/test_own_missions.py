"""What the tool writes passes its own checks, for the vehicle that it is timed for."""

from typing import Any

import pytest
from conftest import MISSIONS, SHORT, SMALL, edited

from faao_mav.plan import parse_plan
from faao_mav.schedule.conversion import Conversion
from faao_mav.validate import Check
from faao_mav.workflow import plan_mission


def checked(text: str, changes: dict[str, Any]) -> tuple[Conversion, Check]:
    """Make a mission; from take-off on it is predicted to fly as the route that it is timed by."""
    result = plan_mission(parse_plan(edited(text, changes)))
    conversion, found, promised = result.conversion, result.check, result.prediction
    assert conversion is not None
    assert found is not None
    assert found.track is not None
    assert promised is not None
    assert found.link is not None
    assert found.link.predicted_rate == pytest.approx(promised.rates.R_avg, rel=0.005)
    assert found.link.rms_position_error == pytest.approx(promised.rms_position_error, abs=1.0)
    assert found.link.path_error == pytest.approx(promised.max_path_error, abs=0.4)
    assert found.link.predicted_duration == pytest.approx(promised.duration, abs=1.0)
    return conversion, found


def complaints(found: Check) -> list[str]:
    return [f"{f.rule}: {f.message}" for f in found.findings if f.level != "note"]


@pytest.mark.parametrize(
    "way",
    [
        "copter_relay ardupilot recommend takeoff rtl",
        "copter_relay px4 recommend takeoff rtl",
        "paper_active ardupilot keep takeoff land",
        "paper_active ardupilot keep airborne rtl",
        "copter_relay ardupilot keep airborne hover",
        "paper_active px4 keep airborne land",
        "copter_relay px4 keep takeoff hover",
    ],
)
def test_the_sample_plans_and_all_ways_to_begin_and_end(way: str) -> None:
    name, autopilot, parameters, begins, ends = way.split()
    changes = SHORT | {
        "vehicle.autopilot": autopilot,
        "mission.parameters": parameters,
        "mission.takeoff": begins == "takeoff",
        "mission.on_finish": ends,
        "radio.fading": "none",
        "optimizer.max_iterations": 2,
    }
    _, found = checked((MISSIONS / f"{name}.yaml").read_text(), changes)
    told = {each.split(":")[0] for each in complaints(found)}
    if parameters == "keep":  # the defaults may be too slow for a plan, and that is said
        told = {rule for rule in told if not rule.startswith("link-")}
    in_the_air = begins == "airborne" and autopilot == "ardupilot"
    assert told == ({"ardupilot-begins-in-the-air"} if in_the_air else set())


def test_the_sample_plane() -> None:
    text = (MISSIONS / "plane_relay.yaml").read_text()
    changes = {
        "flight.duration": 70,
        "flight.time_step": 0.5,
        "radio.fading": "none",
        "radio.causal": False,  # the causal flight begins with a turn that is too tight, as told
    }
    conversion, found = checked(text, changes)
    assert [each for each in complaints(found) if not each.startswith("link-")] == []
    assert found.link is not None
    assert found.link.share > 0.98
    assert conversion.vehicle.kind == "plane"


def test_a_fast_px4_is_told_to_fly_so_fast() -> None:
    fast = {"vehicle.autopilot": "px4", "vehicle.max_speed": 15, "radio.fading": "none"}
    conversion, found = checked(SMALL, fast)
    assert conversion.parameters["MPC_XY_VEL_MAX"] == pytest.approx(16.5)
    assert "px4-speed-capped" not in {finding.rule for finding in found.findings}
