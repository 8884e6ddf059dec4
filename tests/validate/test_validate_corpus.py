"""Broken and odd mission files, and missions that real autopilots accepted and flew."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer
from typer.testing import CliRunner

from faao_mav.autopilot import Vehicle
from faao_mav.cli.validate import validate as command
from faao_mav.errors import InfeasibleError, MissionFileError
from faao_mav.mission.formats import read_mission, read_mission_file
from faao_mav.validate import Level, validate

DATA = Path(__file__).parent.parent / "data"
CORPUS = DATA / "validate"
ROWS = [
    line.split("\t")
    for line in (CORPUS / "expected.tsv").read_text().splitlines()
    if not line.startswith("#")
]
FLIGHTS = [
    (autopilot, path)
    for folder, autopilot in (("arducopter", "ardupilot"), ("px4", "px4"))
    for path in sorted((DATA / "flights" / folder).glob("*.waypoints"))
]


def vehicle_of(autopilot: str, kind: str, parameters: str) -> Vehicle:
    pairs = [] if parameters == "-" else [pair.split("=") for pair in parameters.split()]
    return Vehicle(autopilot, kind, {name: float(value) for name, value in pairs})


def test_the_table_is_about_the_files() -> None:
    files = {path.name for path in CORPUS.iterdir()} - {"expected.tsv"}
    assert files == {row[0] for row in ROWS}
    assert len(files) >= 40


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_each_file_gets_its_errors_and_warnings(row: list[str]) -> None:
    name, autopilot, kind, parameters, expected = row
    if expected == "unreadable":
        with pytest.raises(MissionFileError, match=name):
            read_mission(CORPUS / name)
        return
    mission = read_mission(CORPUS / name)
    found = validate(mission, vehicle_of(autopilot, kind, parameters))
    rules = sorted({finding.rule for finding in found if finding.level is not Level.NOTE})
    assert rules == ([] if expected == "-" else expected.split())


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_the_command_never_shows_a_traceback(
    row: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def predict(*_: object, **__: object) -> None:
        raise InfeasibleError("no model")

    fake = SimpleNamespace(predict=predict)
    monkeypatch.setitem(sys.modules, "faao_mav.autopilot.predict", fake)
    app = typer.Typer()
    app.command()(command)
    name, autopilot, kind, _, expected = row
    arguments = [str(CORPUS / name), "--autopilot", autopilot, "--type", kind, "--json"]
    run = CliRunner().invoke(app, arguments)
    assert isinstance(run.exception, SystemExit | None)
    if expected == "unreadable":
        assert run.exit_code == 2
        assert name in run.stderr
    else:
        answer = json.loads(run.stdout)
        assert run.exit_code == (1 if answer["errors"] else 0)


@pytest.mark.parametrize(
    ("autopilot", "path"), FLIGHTS, ids=lambda value: getattr(value, "name", value)
)
def test_missions_that_were_flown_have_no_errors(autopilot: str, path: Path) -> None:
    found = validate(read_mission_file(path).mission, Vehicle(autopilot, "copter"))
    assert [finding for finding in found if finding.level is Level.ERROR] == []


def test_there_are_flights_of_both_autopilots() -> None:
    assert {autopilot for autopilot, _ in FLIGHTS} == {"ardupilot", "px4"}
