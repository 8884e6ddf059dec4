"""From the plan to the vehicle and back: planned, uploaded, flown by the mock, priced."""

import json
from pathlib import Path
from typing import Any, Literal

import pytest
from conftest import MISSIONS, edited, free_port
from served import running
from typer.testing import CliRunner, Result

from faao_mav import download
from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import parameter_path
from faao_mav.cli.main import app
from faao_mav.mission.formats import read_mission
from faao_mav.mission.item import Home
from faao_mav.sim import MockAutopilot, behaviour_of

HOME = Home(-35.363262, 149.165237, 584.0)
SPEEDUP, DURATION = 20.0, 30

SHORTER: dict[str, Any] = {
    "flight.start": [0, 40],
    "flight.end": [40, 0],
    "flight.altitude": 12,
    "flight.duration": DURATION,
    "flight.time_step": 1,
    "radio.ground_user.position": [60, 60],
    "radio.base_station.power_dbm": 0,
    "radio.relay.power_dbm": 0,
    "radio.fading_samples": 4,
    "mission.path_tolerance": 3,
}
"""Of `missions/copter_relay.yaml`: half a minute of flight."""


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_what_is_planned_is_what_the_vehicle_delivers(
    kind: Literal["ardupilot", "px4"], tmp_path: Path
) -> None:
    plan, out, save = (tmp_path / name for name in ("plan.yaml", "m.waypoints", "r.npz"))
    text = (MISSIONS / "copter_relay.yaml").read_text()
    plan.write_text(edited(text, SHORTER | {"vehicle.autopilot": kind}))
    tuned, port = parameter_path(out, kind), free_port()
    mock = MockAutopilot(behaviour_of(kind), home=HOME, speedup=SPEEDUP, beat=0.1)
    with running(mock, f"udpin:127.0.0.1:{port}"):
        connection = f"udpout:127.0.0.1:{port}"
        one = ("--json", "--system", "1")  # without its number others are waited for

        def run(*arguments: object) -> Result:
            return CliRunner().invoke(app, [str(argument) for argument in (*arguments, *one)])

        result = run(plan, "--out", out, "--save", save, "--upload", connection)
        assert result.exit_code == 0, result.output
        told = json.loads(result.stdout)
        assert told["upload"]["verified"] is True
        assert [each for each in told["validation"] if each["level"] != "note"] == []

        mission, vehicle = read_mission(out), Vehicle(kind)
        assert download(connection, system=1).items == tuple(
            map(vehicle.type.dialect.stored, mission.items)
        )

        fly_it = ("fly", out, "--to", connection, "--solution", save, "--arm")
        result = run(*fly_it)
        assert result.exit_code == 1, result.output
        assert "timing-other" in result.output
        assert not mock.armed
        result = run("upload", out, "--to", connection, "--parameters", tuned)
        assert result.exit_code == 0, result.output
        assert json.loads(result.stdout)["parameters"]
        result = run(*fly_it)
        assert result.exit_code == 0, result.output
    *lines, end = map(json.loads, result.stdout.splitlines())
    assert end["ending"] == "finished"
    flown, predicted_ = end["flight"]["flown"], told["predicted"]
    for name in ("average_rate", "delivered_rate"):
        assert flown[name] == pytest.approx(predicted_[name], rel=0.002)
        assert flown[name] == pytest.approx(told[name], rel=0.02)
    assert flown["rms_position_error"] == pytest.approx(predicted_["rms_position_error"], abs=0.3)
    # where the flight begins is known to a fraction of a second: some of the climb may count
    assert end["flight"]["altitude_error"] < 0.5
    stands = [line["plan"] for line in lines if line.get("plan")]
    assert stands
    for each in stands:
        assert each["expected"] == pytest.approx(DURATION * told["delivered_rate"], rel=0.02)
        assert abs(each["late"]) < 2
