"""What commands refuse, before any work: one clear error, exit status 2, nothing written."""

import shlex
import shutil
from pathlib import Path

import pytest
from conftest import FLYABLE, MISSIONS, edited
from typer.testing import CliRunner

from faao_mav.cli.main import app

DATA = Path(__file__).parent / "data"

STANDS_FOR = {
    "NOWHERE": "udpout:127.0.0.1:9",
    "AT_900": "FLAT --frequency 900",
    "FLAT": "--terrain N47E008.hgt --station PLACE",
    "PLACE": "-35.36,149.16,5.0",
}


def test_what_cannot_be_done_is_said_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("plan.yaml", "plan.txt"):
        Path(name).write_text(edited(FLYABLE, {"radio.fading": "ergodic"}))
    Path("bad.yaml").write_text(edited(FLYABLE, {"flight.altitude": -1}))
    useless = {"vehicle.parameters": {"WPNAV_JERK": 0}}
    Path("useless.yaml").write_text(edited(FLYABLE, useless))
    useless = {"vehicle.parameters": {"AIRSPEED_MIN": -1}}
    plane = (MISSIONS / "plane_relay.yaml").read_text()
    Path("useless_plane.yaml").write_text(edited(plane, useless))
    beyond = {"vehicle.max_speed": 22, "vehicle.max_acceleration": 5.5}
    Path("beyond.yaml").write_text(edited(FLYABLE, beyond))
    shutil.copy(DATA / "missions" / "two_current.waypoints", "two_current.waypoints")
    shutil.copy(DATA / "missions" / "plain.waypoints", "m.waypoints")
    shutil.copy(DATA / "logs" / "arducopter.tlog", "log.tlog")
    Path("link.waypoints").symlink_to("m.waypoints")
    Path("still.param").write_text("WPNAV_ACCEL,0\n")
    Path("flight.csv").write_text("time_s,latitude,longitude,altitude_m,rssi_dbm\n")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    wrong = []
    for line in (DATA / "cli" / "refused.txt").read_text().splitlines()[2:]:
        command, part = line.split(" | ")
        for name, words in STANDS_FOR.items():
            command = command.replace(name, words)
        result = CliRunner().invoke(app, shlex.split(command))
        clean = isinstance(result.exception, SystemExit) and result.stdout == ""
        if (result.exit_code, clean) != (2, True) or part not in " ".join(result.stderr.split()):
            wrong.append((command, result.exit_code, result.output, result.exception))
        assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before, command
    assert wrong == []
