"""`fly` and `debrief` on the command line: what they refuse, and what they compare first."""

import json
import socket
from pathlib import Path

import pytest
from conftest import FLYABLE, edited, free_port
from served import running
from typer.testing import CliRunner, Result

from faao_mav.cli.main import app
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.formats import render_mission
from faao_mav.sim import MockAutopilot, behaviour_of

HOME = Home(-35.363262, 149.165237, 584.0)
LOG = Path(__file__).parent / "data" / "logs" / "arducopter.tlog"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    up, over = (
        MissionItem(command, 3, x=HOME.latitude, y=HOME.longitude, z=height)
        for command, height in ((22, 20.0), (16, 30.0))
    )
    path = tmp_path / "mission.waypoints"
    path.write_text(render_mission(Mission((up, over, MissionItem(20, 2)), HOME), path))
    return path


def test_a_flight_of_another_plan_is_not_in_the_log(tmp_path: Path) -> None:
    plan = tmp_path / "plan.yaml"
    plan.write_text(FLYABLE)
    result = run("debrief", LOG, "--plan", plan)
    assert result.exit_code == 1
    assert "the plan's flight is not in it" in result.output


def test_a_plan_is_streamed_and_its_radio_told(tmp_path: Path) -> None:
    plan, made, saved = (tmp_path / name for name in ("p.yaml", "m.waypoints", "r.npz"))
    slow = {"vehicle.max_speed": 6, "flight.duration": 16, "mission.on_finish": "land"}
    ends = {f"flight.{end}_velocity": "hover" for end in ("start", "end")}
    plan.write_text(edited(FLYABLE, slow | ends | {"flight.altitude": 10}))
    assert run(plan, "--out", made, "--save", saved, "--quiet").exit_code == 0
    port = free_port()
    to = ("--to", f"udpout:127.0.0.1:{port}", "--json")
    quick = {"GUID_TIMEOUT": 1.0}
    mock = MockAutopilot(
        behaviour_of("ardupilot"), home=HOME, beat=0.1, speedup=8.0, parameters=quick
    )
    with running(mock, f"udpin:127.0.0.1:{port}"), socket.socket(type=socket.SOCK_DGRAM) as radio:
        radio.bind(("127.0.0.1", 0))
        told = ("--radio", f"udp:127.0.0.1:{radio.getsockname()[1]}")
        assert run("upload", made, *to).exit_code == 0
        result = run("fly", made, *to, "--solution", saved, "--arm", "--stream", *told)
        assert result.exit_code == 0, result.output
        radio.settimeout(0.1)
        slots = [json.loads(radio.recv(65_536))["slot"] for _ in range(20)]
    end = json.loads(result.stdout.splitlines()[-1])
    assert end["ending"] == "finished"
    flown, planned = end["flight"]["flown"], end["flight"]["planned"]
    assert flown["delivered_rate"] > 0.97 * planned["delivered_rate"]
    assert slots[0] == 0
    assert slots == sorted(set(slots))


def test_another_mission_is_not_flown(mission: Path) -> None:
    port = free_port()
    connection = f"udpout:127.0.0.1:{port}"
    mock = MockAutopilot(behaviour_of("px4"), home=HOME, beat=0.1)
    with running(mock, f"udpin:127.0.0.1:{port}"):
        assert run("upload", mission, "--to", connection).exit_code == 0
        mission.write_text(mission.read_text().replace("30", "40"))
        result = run("fly", mission, "--to", connection, "--arm", "--json")
        assert result.exit_code == 1
        told = json.loads(result.stdout.splitlines()[-1])
        assert told["ending"] == "different"
        assert told["differences"] == ["mission item 1: z: sent 40.0, found 30.0"]
        assert not mock.armed
