"""A real plane beside its predicted flight; `test_fly.py` has copters."""

from pathlib import Path

import pytest
from conftest import MISSIONS, edited
from record import flown_by

from faao_mav import parse_plan, plan_mission

RETURN_HEIGHT = 30.0
PLANE = {
    "vehicle.parameters": {"RTL_ALTITUDE": RETURN_HEIGHT},
    "flight.duration": 90,
    "optimizer.starts": ["straight"],
    "optimizer.max_iterations": 5,
}
"""Of the sample: what the plane flies before it returns does not matter here."""


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
