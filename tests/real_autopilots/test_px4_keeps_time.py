"""A real PX4 beside its plan and the predicted flight."""

from pathlib import Path

import pytest
from flown import flown

from faao_mav import plan_mission
from missions import plan_of

SHORT = {
    "flight.duration": 60,
    "flight.altitude": 20,
    "flight.start": [0, 200],
    "flight.end": [200, 0],
    "vehicle.max_speed": 6,
    "radio.ground_user.position": [200, 200],
    "mission.on_finish": "land",
}


def test_a_mission_is_flown_as_planned(autopilots: Path, tmp_path: Path) -> None:
    result = plan_mission(plan_of(SHORT, "px4", "recommend"))
    real = flown(autopilots, "px4", result, tmp_path)
    assert result.prediction is not None
    assert real.rms_position_error == pytest.approx(result.prediction.rms_position_error, abs=1.5)
    assert real.duration == pytest.approx(result.prediction.duration, abs=1)
    assert real.delivered_rate == pytest.approx(result.solution.delivered_rate, rel=0.007)
