"""Missions predicted in a wind that is given."""

import json
from pathlib import Path

import numpy as np
import pytest
from judged import COPTER, HOME, at
from typer.testing import CliRunner

from faao_mav.autopilot.predict import predict
from faao_mav.cli.main import app
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.formats.wpl import write_wpl
from faao_mav.mission.item import Mission, MissionItem
from faao_mav.plan import Wind
from faao_mav.validate.check import check


def there_and_back(speed: float) -> Mission:
    """North for 300 m, and back."""
    items = [at(0, 0, 30, command=Command.NAV_TAKEOFF)]
    items += [MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, (1.0, speed, -1.0, 0.0))]
    items += [at(0, 0, 30, 5), at(0, 300, 30), at(0, 0, 30)]
    items += [at(0, 0, 0, command=Command.NAV_LAND)]
    return Mission(tuple(items), HOME)


def test_a_flight_that_the_wind_carries_away_ends() -> None:
    carried = check(there_and_back(8), COPTER, wind=Wind(speed=14, from_degrees=0).velocity)
    assert carried.track is None
    assert "perhaps for the wind" in carried.unpredicted


def test_a_wind_across_is_held_without_a_trace() -> None:
    mission = there_and_back(6)
    calm, windy = (
        predict(mission, COPTER, wind=Wind(speed=each, from_degrees=90).velocity) for each in (0, 6)
    )
    assert abs(windy.t[-1] - calm.t[-1]) < 0.5
    assert np.abs(windy.position[:, 0]).max() < 0.5


def validated(folder: Path, *options: str) -> tuple[int, str]:
    path = folder / "mission.waypoints"
    path.write_text(write_wpl(there_and_back(8)))
    done = CliRunner().invoke(app, ["validate", str(path), *options])
    return done.exit_code, done.stdout + done.stderr


def test_a_mission_is_validated_in_a_wind(tmp_path: Path) -> None:
    _, calm = validated(tmp_path, "--json")
    _, windy = validated(tmp_path, "--json", "--wind", "8,180")
    slow, quick = (json.loads(each)["predicted"]["duration"] for each in (windy, calm))
    assert slow > quick + 20
    told = validated(tmp_path, "--wind", "8,180")[1]
    assert "s in 8 m/s of wind; assumes the simulator's airframe (vehicle.body: sitl)" in told
    on_px4 = validated(tmp_path, "--wind", "8,180", "--autopilot", "px4")[1]
    assert "s in 8 m/s of wind, as in calm air: its model leaves wind out; assumes" in on_px4


@pytest.mark.parametrize("given", ["8", "8,400", "fast,90", "-1,90", "nan,90", "8,90,3"])
def test_a_wind_that_is_none_is_refused(tmp_path: Path, given: str) -> None:
    status, told = validated(tmp_path, f"--wind={given}")
    assert status == 2
    assert f"--wind {given}: expected SPEED,FROM" in told
