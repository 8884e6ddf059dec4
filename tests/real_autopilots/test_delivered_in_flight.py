"""What a real ArduCopter that flies the sample's mission delivers, beside what was planned."""

from pathlib import Path

import pytest
from conftest import MISSIONS
from flown import flown

from faao_mav import plan_mission, read_plan


def test_the_sample_delivers_what_was_planned(autopilots: Path, tmp_path: Path) -> None:
    result = plan_mission(read_plan(MISSIONS / "copter_relay.yaml"))
    real = flown(autopilots, "ardupilot", result, tmp_path)
    assert real.delivered_rate == pytest.approx(result.solution.delivered_rate, rel=0.005)
    assert result.prediction is not None
    predicted = result.prediction.rms_position_error
    assert real.rms_position_error == pytest.approx(predicted, abs=0.5)
