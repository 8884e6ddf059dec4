"""Real autopilots beside their plans and predicted flights: what is delivered, when, from where."""

from pathlib import Path
from typing import Any

import pytest
from conftest import MISSIONS, edited
from flown import flown
from record import flown_by

from faao_mav import parse_plan, plan_mission
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

RETURN_HEIGHT = 30.0
PLANE = {
    "vehicle.parameters": {"RTL_ALTITUDE": RETURN_HEIGHT},
    "flight.duration": 90,
    "optimizer.starts": ["straight"],
    "optimizer.max_iterations": 5,
}
"""Of the sample: what the plane flies before it returns does not matter here."""


@pytest.mark.parametrize(
    ("autopilot", "changes", "metres", "share"),
    [("ardupilot", {}, 0.5, 0.005), ("px4", SHORT, 1.5, 0.007)],
)
def test_a_mission_is_flown_and_delivers_as_planned(
    autopilot: str,
    changes: dict[str, Any],
    metres: float,
    share: float,
    autopilots: Path,
    tmp_path: Path,
) -> None:
    result = plan_mission(plan_of(changes, autopilot, "recommend"))
    real, predicted = flown(autopilots, autopilot, result, tmp_path), result.prediction
    assert predicted is not None
    assert real.rms_position_error == pytest.approx(predicted.rms_position_error, abs=metres)
    assert real.delivered_rate == pytest.approx(result.solution.delivered_rate, rel=share)
    if autopilot == "px4":
        assert real.duration == pytest.approx(predicted.duration, abs=1)


def test_a_plane_circles_over_home_at_its_own_height(autopilots: Path, tmp_path: Path) -> None:
    """A minute after the mission: the way home, the climb, a circle."""
    plan = parse_plan(edited((MISSIONS / "plane_relay.yaml").read_text(), PLANE))
    result = plan_mission(plan)
    (mission,) = result.write(tmp_path / "plane.waypoints")
    options = ["--vehicle", "plane", "--speedup", "25", "--linger", "60"]
    options += ["--params", f"RTL_ALTITUDE={RETURN_HEIGHT:g}"]
    track = flown_by(autopilots / "fly_arducopter.py", mission, options)
    assert result.check is not None
    assert result.check.track is not None
    predicted = float(result.check.track.position[-1, 2])
    assert predicted == pytest.approx(RETURN_HEIGHT, abs=3)
    assert float(track[-1]["alt_rel_m"]) == pytest.approx(predicted, abs=5)
