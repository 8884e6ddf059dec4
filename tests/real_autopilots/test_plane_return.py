"""Where a real ArduPlane is after its mission, beside where it is predicted to be."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import MISSIONS, edited

from faao_mav import parse_plan, plan_mission

AFTER = 60.0
"""Simulated seconds that are watched after the mission: the way home, the climb, a circle."""


BRIEF = {"flight.duration": 90, "optimizer.starts": ["straight"], "optimizer.max_iterations": 5}
"""Of the sample: what it flies before it returns does not matter here."""


def test_it_circles_over_home_at_its_own_height(autopilots: Path, tmp_path: Path) -> None:
    height = 30.0
    changes = BRIEF | {"vehicle.parameters": {"RTL_ALTITUDE": height}}
    plan = parse_plan(edited((MISSIONS / "plane_relay.yaml").read_text(), changes))
    result = plan_mission(plan)
    (mission,) = result.write(tmp_path / "plane.waypoints")
    track = tmp_path / "track.csv"
    runner = [sys.executable, str(autopilots / "fly_arducopter.py"), str(mission)]
    flight = ["--vehicle", "plane", "--out", str(track), "--speedup", "25"]
    own = ["--params", f"RTL_ALTITUDE={height:g}", "--linger", f"{AFTER:g}"]
    for _ in range(4):  # the simulator may not get ready in time on a busy machine
        run = subprocess.run([*runner, *flight, *own], capture_output=True, text=True, timeout=200)
        if run.returncode != 3 and "pre-arm checks do not pass" not in run.stderr:
            break
    assert run.returncode == 0, run.stdout
    with track.open() as file:
        flown = [float(row["alt_rel_m"]) for row in csv.DictReader(file)]
    assert result.check is not None
    assert result.check.track is not None
    predicted = float(result.check.track.position[-1, 2])
    assert predicted == pytest.approx(height, abs=3)
    assert flown[-1] == pytest.approx(predicted, abs=5)
