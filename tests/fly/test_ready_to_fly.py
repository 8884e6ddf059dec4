"""From the command line: uploads say where the vehicle stands, nothing is armed past the gate."""

import json
from pathlib import Path

import pytest
from scenes import away
from served import vehicle
from stations import FENCE, RALLY, a_mission
from typer.testing import CliRunner, Result

from faao_mav.cli.main import app
from faao_mav.mission import Mission
from faao_mav.mission.formats import PlanTarget, render_mission
from faao_mav.wire import upload


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "m.waypoints"
    path.write_text(render_mission(a_mission(6), path))
    return path


def test_an_upload_says_where_the_vehicle_stands(mission: Path) -> None:
    with vehicle(home=away(1_500.0, -32.0)) as (to, _):
        result = run("upload", mission, "--to", to)
        assert result.exit_code == 0, result.output
        stands = "stands       1500 m from the mission's home, 32 m lower: it is not armed there"
        assert stands in result.stdout.splitlines()
        told = json.loads(run("upload", mission, "--to", to, "--json").stdout)
    assert told["stands"]["from_home"] == pytest.approx(1500, abs=1)
    assert told["stands"]["higher"] == pytest.approx(-32, abs=0.1)
    assert told["stands"]["is_meant"] is False
    with vehicle(place=1e9) as (to, _):
        result = run("upload", mission, "--to", to)
        assert result.exit_code == 0, result.output
        assert "stands       not known how far from the mission's home" in result.stdout


def test_a_mission_for_another_vehicle_is_not_uploaded(tmp_path: Path) -> None:
    plan, beside = tmp_path / "m.plan", tmp_path / "w.waypoints"
    plan.write_text(render_mission(a_mission(6), plan, PlanTarget(firmware=3, vehicle_type=20)))
    beside.write_text(render_mission(a_mission(6), beside))
    beside.with_suffix(".params").write_text("1\t1\tMPC_XY_CRUISE\t8.0\t9\n")
    for mission, aircraft in ((plan, "copter"), (beside, "plane")):
        with vehicle(aircraft=aircraft) as (to, mock):
            result = run("upload", mission, "--to", to)
            assert result.exit_code == 1
            assert "the mission is for" in result.stderr
            told = f"the vehicle is ardupilot and a {aircraft}: nothing is uploaded"
            assert told in result.stderr
            assert mock.mission().items == ()


def test_no_parameters_are_set_but_the_missions_own(mission: Path) -> None:
    file = mission.with_name("own.param")
    with vehicle() as (to, mock):
        before = dict(mock.parameters.values)
        for lines, status, told in (
            *(
                (f"WPNAV_ACCEL,400\n{name},1", 2, f"{name}: not among what a mission is timed for")
                for name in ("FENCE_ENABLE", "FS_THR_ENABLE", "RTL_ALT", "ARMING_CHECK")
            ),
            ("MPC_ACC_HOR,4", 1, "the vehicle has no MPC_ACC_HOR: nothing was set or uploaded"),
        ):
            file.write_text(lines)
            result = run("upload", mission, "--to", to, "--parameters", file)
            assert result.exit_code == status, result.output
            assert told in result.output
            assert mock.parameters.values == before
            assert mock.mission().items == ()


def test_nothing_is_armed_past_the_gate_but_what_an_option_overrules(
    mission: Path,
) -> None:
    """It stands elsewhere, and another mission has left its fence and rally points."""
    with vehicle(home=away(200.0), speedup=60.0, parameters={"FENCE_ENABLE": 0}) as (to, mock):
        assert upload(a_mission(5, fence=FENCE, rally=RALLY), to).verified
        assert run("upload", mission, "--to", to).exit_code == 0
        result = run("fly", mission, "--to", to, "--arm")
        assert result.exit_code == 1
        for told in (
            "refused      nothing was started: it stands 200 m from the mission's home, not within",
            "warning: it holds a fence (4 items) that the file has not, and does nothing about it",
            "error: it holds rally points (2 items) that the file has not",
        ):
            assert told in result.stdout
        assert not mock.armed
        result = run("upload", mission, "--to", to, "--clear-rest")
        assert result.exit_code == 0, result.output
        assert mock.mission() == Mission(mock.mission().items, mock.mission().home)
        result = run("fly", mission, "--to", to, "--arm", "--elsewhere", "--json")
        assert result.exit_code == 0, result.output
        end = json.loads(result.stdout.splitlines()[-1])
        (here,) = (each for each in end["findings"] if each["rule"] == "place-home")
        assert (here["level"], here["action"]) == ("warning", "--elsewhere: flown all the same")
