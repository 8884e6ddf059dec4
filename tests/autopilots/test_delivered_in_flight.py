"""What a real ArduCopter that flies the sample's mission delivers, beside what was planned."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import MISSIONS

from faao_mav import plan_mission, read_plan
from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.prediction import Prediction, price_flight


def flown_by_arducopter(runner: Path, files: tuple[Path, ...], track: Path) -> tuple[Real, Real]:
    """Fly a mission with its parameters; return times (k,) s and latitude, longitude (k, 2)."""
    mission, parameters = files
    command = [sys.executable, str(runner), str(mission), "--param-file", str(parameters)]
    for _ in range(4):  # the simulator may not get ready in time on a busy machine
        run = subprocess.run(
            [*command, "--out", str(track), "--speedup", "25"],
            capture_output=True,
            text=True,
            timeout=200,
        )
        if run.returncode != 3 and "pre-arm checks do not pass" not in run.stderr:
            break
    assert run.returncode == 0, run.stdout
    with track.open() as file:
        rows = [(row["t_s"], row["lat"], row["lon"]) for row in csv.DictReader(file)]
    flown = np.array(rows, dtype=float)
    return flown[:, 0], flown[:, 1:]


def along(solution: Solution, t: Real, w: Real) -> Prediction:
    """Price a flight whose clock is shifted so that it is nearest to the plan at equal times."""

    def apart(start: float) -> float:
        at = np.stack([np.interp(solution.t + start, t, x) for x in w.T], axis=-1)
        return float(((at - solution.w) ** 2).sum(axis=1).mean())

    begin = min(np.arange(t[0], t[-1] - solution.t[-1] + 5, 0.5).tolist(), key=apart)
    begin = min(np.arange(begin - 0.6, begin + 0.6, 0.02).tolist(), key=apart)
    return price_flight(solution, t - begin, w)


def test_the_sample_delivers_what_was_planned(autopilots: Path, tmp_path: Path) -> None:
    plan = read_plan(MISSIONS / "copter_relay.yaml")
    result = plan_mission(plan)
    files = result.write(tmp_path / "relay.waypoints")
    t, places = flown_by_arducopter(autopilots / "fly_arducopter.py", files, tmp_path / "track.csv")
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    flown = along(result.solution, t, frame.to_local(*places.T))
    assert flown.delivered_rate == pytest.approx(result.solution.delivered_rate, rel=0.005)
    assert result.prediction is not None
    predicted = result.prediction.rms_position_error
    assert flown.rms_position_error == pytest.approx(predicted, abs=0.5)
