"""Missions in files, and what ArduCopter, ArduPlane and PX4 made of missions (tests/data/verdicts).

The verdicts are recorded by `tests/real_autopilots/record_verdicts.py`, which says what each means.
"""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from judged import HOME
from typer.testing import CliRunner

from faao_mav.autopilot import Vehicle
from faao_mav.cli.main import app
from faao_mav.mission.fence import Fence, Polygon
from faao_mav.mission.formats import read_mission_file
from faao_mav.mission.item import Mission, MissionItem
from faao_mav.sim import behaviour_of
from faao_mav.validate import Finding, Level, ValidationContext, validate

DATA = Path(__file__).parent.parent / "data"
CORPUS = DATA / "validate"
ROWS = [
    line.split("\t")
    for line in (CORPUS / "expected.tsv").read_text().splitlines()
    if not line.startswith("#")
]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_each_file_gets_its_errors_and_warnings(row: list[str], tmp_path: Path) -> None:
    """On the command line, which predicts the flight, and never shows a traceback."""
    name, autopilot, kind, parameters, expected = row
    told = ["--autopilot", autopilot, "--type", kind, "--json"]
    if parameters != "-":
        file = tmp_path / "its.param"
        file.write_text("".join(f"{x.replace('=', ',')}\n" for x in parameters.split()))
        told += ["--parameters", str(file)]
    run = CliRunner().invoke(app, ["validate", str(CORPUS / name), *told])
    assert isinstance(run.exception, SystemExit | None)
    if expected == "unreadable":
        assert run.exit_code == 2
        assert name in run.stderr
        return
    found = json.loads(run.stdout)
    assert run.exit_code == (1 if found["errors"] else 0)
    rules = sorted({each["rule"] for each in found["findings"] if each["level"] != "note"})
    assert rules == ([] if expected == "-" else expected.split())


VEHICLES = {
    "arducopter": ("ardupilot", "copter"),
    "arduplane": ("ardupilot", "plane"),
    "px4": ("px4", "copter"),
}
RECORDED: dict[str, dict[str, Any]] = {
    f"{vehicle}/{name}": mission
    for vehicle in VEHICLES
    for name, mission in json.loads((DATA / "verdicts" / f"{vehicle}.json").read_text()).items()
}
NOT_FLOWN = {"refused", "rejected", "not armed", "not started", "on the ground", "crashed"}
CUT_SHORT = {"stuck", "ended early"}

STRICTER = {"px4/home-outside-fence": "PX4 says so and flies: nothing keeps it within the fence"}
"""Missions that were flown in the simulator and are errors here, and why."""

MILDER = {
    "arducopter/700-items": "a warning: boards differ in how many they store",
    "arducopter/nan-hold": "a warning: for what is not set our own upload sends 0",
    "arducopter/script-time": "builds with scripting take it",
}
"""Missions that were not flown as they are written, with less than is asked here, and why."""


def recorded_mission(name: str) -> Mission:
    recorded = RECORDED[name]
    items = []
    for times, its, frame, *values, autocontinue in recorded["items"]:
        p1, p2, p3, p4, x, y, z = (math.nan if v is None else v for v in values)
        items += [MissionItem(its, frame, (p1, p2, p3, p4), x, y, z, bool(autocontinue))] * times
    corners = tuple((latitude, longitude) for latitude, longitude in recorded.get("fence", ()))
    fence = Fence((Polygon(corners, inclusion=True),)) if corners else Fence()
    return Mission(tuple(items), HOME, fence)


def findings(name: str) -> tuple[Finding, ...]:
    vehicle = Vehicle(*VEHICLES[name.split("/")[0]], RECORDED[name]["parameters"])
    return validate(ValidationContext(recorded_mission(name), vehicle))


@pytest.mark.parametrize("name", RECORDED)
def test_the_worst_finding_is_as_bad_as_the_verdict(name: str) -> None:
    recorded, found = RECORDED[name], findings(name)
    errors = [finding for finding in found if finding.level is Level.ERROR]
    warned = errors or [finding for finding in found if finding.level is Level.WARNING]
    if recorded["verdict"] in NOT_FLOWN:
        assert bool(errors) is (name not in MILDER)
    elif recorded["verdict"] in CUT_SHORT:
        assert bool(warned) is (name not in MILDER)
    else:
        assert recorded["verdict"] == "flown"
        assert bool(errors) is (name in STRICTER), errors
    if "item" in recorded and name not in MILDER:
        assert recorded["item"] in {finding.item for finding in errors}


def test_there_are_files_and_verdicts_of_all_kinds_and_flown_missions_have_no_errors() -> None:
    assert {path.name for path in CORPUS.iterdir() if path.suffix != ".tsv"} == {r[0] for r in ROWS}
    assert {name.split("/")[0] for name in RECORDED} == set(VEHICLES)
    kinds = {mission["verdict"] for mission in RECORDED.values()}
    assert kinds == NOT_FLOWN | CUT_SHORT | {"flown"}
    assert set(STRICTER) | set(MILDER) <= set(RECORDED)
    for folder in ("arducopter", "px4"):
        vehicle = Vehicle(*VEHICLES[folder])
        for path in (DATA / "flights" / folder).glob("*.waypoints"):
            found = validate(ValidationContext(read_mission_file(path).mission, vehicle))
            assert [each for each in found if each.level is Level.ERROR] == [], path.name


STRUCTURE = ("takeoff is not the first", "altitude too low", "starts with landing", "unsupported")
"""What PX4 says of the missions that it takes, and does not start for their items alone."""


def test_the_mock_of_px4_starts_what_px4_started() -> None:
    infeasible, refused = behaviour_of("px4").infeasible, 0
    for name, recorded in RECORDED.items():
        if name.startswith("px4/"):
            said = " ".join(recorded.get("said", ()))
            if recorded["verdict"] == "flown":
                assert infeasible(recorded_mission(name)) == "", name
            elif recorded["verdict"] == "rejected" and any(each in said for each in STRUCTURE):
                assert infeasible(recorded_mission(name)) != "", name
                refused += 1
    assert refused >= 10
