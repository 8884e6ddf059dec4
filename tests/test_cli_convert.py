"""`faao-mission convert`."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.mission.formats import read_mission, read_mission_file

MISSIONS = Path(__file__).parent / "data" / "missions"


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["convert", *map(str, arguments)])


def test_a_plan_becomes_a_text_file_and_says_what_it_lost(tmp_path: Path) -> None:
    out = tmp_path / "m.waypoints"
    result = run(MISSIONS / "fence_and_rally.plan", "--out", out)
    assert result.exit_code == 0
    fence = tmp_path / "m.fence.waypoints"
    assert result.stdout == f"5 items written to {out} and {fence}\n"
    assert result.stderr.splitlines() == [
        f"faao-mission: {out}: QGC WPL holds no rally points: 1 point left out",
        f"faao-mission: {out}: not set (NaN) becomes 0: item 1 param4, item 3 param4",
    ]
    assert [item.command for item in read_mission(out).items] == [22, 178, 16, 177, 20]
    assert read_mission(out).fence == read_mission(MISSIONS / "fence_and_rally.plan").fence


def test_whom_a_plan_is_for(tmp_path: Path) -> None:
    out = tmp_path / "m.plan"
    result = run(MISSIONS / "plain.waypoints", "--out", out)
    assert result.stderr == (
        f"faao-mission: {out}: no autopilot is known: the plan is for a generic one\n"
    )
    assert run(MISSIONS / "px4.plan", "--out", out).stderr == ""
    assert read_mission_file(out).firmware == 12
    result = run(MISSIONS / "px4.plan", "--out", out, "--autopilot", "ardupilot")
    assert "not set (NaN) becomes 0: item 1 param4, item 3 param4" in result.stderr
    assert read_mission_file(out).firmware == 3


def test_json_is_one_object(tmp_path: Path) -> None:
    out = tmp_path / "m.kml"
    result = run(MISSIONS / "px4.plan", "--out", out, "--json")
    data = json.loads(result.stdout)
    assert (data["items"], data["written"]) == (5, str(out))
    assert [f"faao-mission: {out}: {line}" for line in data["lost"]] == result.stderr.splitlines()


@pytest.mark.parametrize("command", ["convert", "validate"])
def test_what_is_odd_about_a_file_is_told_once(command: str, tmp_path: Path) -> None:
    arguments = ["--out", str(tmp_path / "m.waypoints")] if command == "convert" else []
    source = str(MISSIONS / "gap.waypoints")
    result = CliRunner().invoke(app, [command, source, *arguments])
    assert result.stderr.splitlines() == [
        f"faao-mission: {source}: line 4, field index: '3': indexes do not count up; rows are "
        "taken in the file's order, in which targets of DO_JUMP count too"
    ]
