"""`faao-mission validate`, by itself."""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from conftest import FLYABLE, edited
from judged import given, track
from typer.testing import CliRunner

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import plan_target
from faao_mav.cli.main import app
from faao_mav.errors import InfeasibleError
from faao_mav.mission.formats import render_mission
from faao_mav.mission.item import Mission
from faao_mav.validate import RULES

Run = Callable[..., Any]

WAY = "waypoint:0,100,30,6 waypoint:100,150,30 waypoint:200,160,30,10"
SOUND = f"takeoff change_speed=1,8,-1 {WAY} return"
SLOW = "takeoff change_speed=1,0,-1 waypoint:0,200,30 return"  # a warning and nothing worse
BROKEN = "takeoff waypoint:0,9,9/1 return"
LEVEL = track(((0, 0, 0), (0, 0, 30), (0, 100, 30)), [0, 2], 8.0)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command with a prediction that is always the same, or none."""

    def runner(*arguments: object, predicted: bool = False) -> Any:
        def predict(mission: Mission, vehicle: Vehicle, **_: object) -> object:
            if predicted:
                return LEVEL
            raise InfeasibleError(f"no model of {len(mission.items)} items for {vehicle.autopilot}")

        fake = SimpleNamespace(predict=predict)
        monkeypatch.setitem(sys.modules, "faao_mav.autopilot.predict", fake)
        return CliRunner().invoke(app, ["validate", *(str(argument) for argument in arguments)])

    return runner


def rules(result: Any) -> set[str]:
    return {finding["rule"] for finding in json.loads(result.stdout)["findings"]}


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    def written(line: str, name: str = "mission.waypoints", vehicle: Vehicle | None = None) -> Path:
        path = tmp_path / name
        path.write_text(render_mission(given(line).mission, path, plan_target(vehicle)))
        return path

    return written


@pytest.fixture
def sound(write: Callable[..., Path]) -> Path:
    return write(SOUND, "sound.waypoints")


def test_nothing_wrong(run: Run, sound: Path) -> None:
    asked = ["validate", str(sound), "--autopilot", "px4", "--type", "plane"]
    told = CliRunner().invoke(app, asked).stdout
    assert "for PX4 and a plane (as asked)" in told
    assert "flight not predicted: there is no model of how PX4 flies planes" in told
    result = run(sound)
    assert result.exit_code == 0
    assert "sound.waypoints: 6 items, for ArduPilot and a copter (by default" in result.stdout
    assert "flight not predicted: no model of 6 items for ardupilot" in result.stdout
    assert "0 errors, 0 warnings, 0 notes" in result.stdout


def test_errors_fail_and_say_item_rule_and_cure(run: Run, write: Callable[..., Path]) -> None:
    broken, slow = write(BROKEN), write(SLOW, "slow.waypoints")
    result = run(broken)
    assert result.exit_code == 1
    assert "error: item 2: " in result.stdout
    assert "[refused-on-upload]" in result.stdout
    assert "to do: give one of 0, 2, 3" in result.stdout
    answer = json.loads(run(broken, "--json", predicted=True).stdout)
    told = {"autopilot": "ardupilot", "type": "copter", "items": 3, "errors": 1}
    assert answer.items() >= told.items()
    assert answer["predicted"]["duration"] == pytest.approx(float(LEVEL.t[-1]))
    finding = answer["findings"][0]
    assert (finding["level"], finding["rule"], finding["item"]) == ("error", "refused-on-upload", 2)
    assert finding["message"]
    assert finding["action"]
    assert [run(slow).exit_code, run(slow, "--strict").exit_code] == [0, 1]
    half = "waypoint:0,50,30,2.5 waypoint:0,100,30,2.5 waypoint:0,150,30,2.5"
    path = write(f"takeoff {half} change_speed=1,5,-1 waypoint:0,250,30,2.5")
    (found,) = (line for line in run(path).stdout.splitlines() if "[hold-changed]" in line)
    assert "items 2-4, 6: " in found
    assert "(and 3 more like it)" in found


def test_who_flies_it(run: Run, sound: Path, write: Callable[..., Path]) -> None:
    plan = write(SOUND, "px4.plan", Vehicle("px4", "copter"))
    assert "for PX4 and a copter (as the file says)" in run(plan).stdout
    for wrong in (("--autopilot", "betaflight"), ("--type", "boat")):
        assert run(plan, *wrong).exit_code == 2
    slower = sound.with_name("plan.yaml")
    slower.write_text(edited(FLYABLE, {"vehicle.max_speed": 7, "flight.duration": 13}))
    assert rules(run(sound, "--plan", slower, "--json")) == {"speed-above-limit"}


def test_parameters_come_from_a_file(run: Run, sound: Path) -> None:
    given_file, beside = sound.with_name("given.param"), sound.with_suffix(".param")
    for path, options in ((given_file, ("--parameters", given_file)), (beside, ())):
        path.write_text("WPNAV_SPEED,-5\n")
        result = run(sound, *options)
        assert result.exit_code == 2
        assert f"{path}" in result.stderr
        assert "WPNAV_SPEED: -5; give a number of at least" in result.stderr


def test_limits(run: Run, sound: Path) -> None:
    asked = ("--max-altitude", 20, "--max-distance", 150, "--max-duration", 30)
    assert rules(run(sound, *asked, "--json")) == {"above-ceiling", "beyond-distance", "too-long"}
    kept, broken = (run(sound, "--max-duration", s, predicted=True) for s in (17, 16))
    assert "predicted flight: 16 s" in kept.stdout
    assert (kept.exit_code, broken.exit_code) == (0, 1)
    for option, value in (
        ("--max-duration", "nan"),
        ("--max-distance", "inf"),
        ("--max-altitude", "0"),
    ):
        result = run(sound, option, value)
        assert result.exit_code == 2
        assert result.stderr == f"faao-mission: {option} {value}: expected a number above 0\n"


def test_a_mission_is_validated_in_a_wind(write: Callable[..., Path]) -> None:
    path = str(write("takeoff change_speed=1,8,-1 waypoint:0,90,30 waypoint:0,0,30 land"))

    def told(*options: str) -> str:
        return CliRunner().invoke(app, ["validate", path, *options]).output

    slow, quick = (
        json.loads(told("--json", *wind))["predicted"]["duration"]
        for wind in (("--wind", "8,180"), ())
    )
    assert slow > quick + 5
    airframe = "assumes the simulator's airframe (vehicle.body: sitl)"
    assert f"s in 8 m/s of wind; {airframe}" in told("--wind", "8,180")
    on_px4 = told("--wind", "8,180", "--autopilot", "px4")
    assert "s in 8 m/s of wind, as in calm air: its model leaves wind out; assumes" in on_px4
    assert "perhaps for the wind" in told("--wind", "14,0")
    for wind in ("8", "8,400", "fast,90", "-1,90", "nan,90", "8,90,3"):
        assert f"--wind {wind}: expected SPEED,FROM" in told(f"--wind={wind}")


def test_rules_are_listed(run: Run) -> None:
    text = run("--rules")
    assert text.exit_code == 0
    assert len(text.stdout.splitlines()) == len(RULES)
    listed = json.loads(run("--rules", "--json").stdout)["rules"]
    assert [rule["id"] for rule in listed] == [rule.id for rule in RULES]
    assert {"level", "summary", "source", "autopilot", "type"} <= listed[0].keys()


@pytest.mark.usefixtures("unpainted")
def test_a_page_of_a_mission_by_itself(run: Run, sound: Path) -> None:
    page = sound.with_suffix(".html")
    assert run(sound, "--report", page, predicted=True).exit_code == 0
    text = page.read_text()
    for heading in ("Result", "Findings", "Mission", "Flight"):
        assert f"<h2>{heading}</h2>" in text
    assert "<h2>Route</h2>" not in text
    assert sound.name in text
    odd, page = (sound.with_name(os.fsdecode(b"\xff" + end)) for end in (b".waypoints", b".html"))
    odd.write_bytes(sound.read_bytes())
    assert run(odd, "--report", page, "--json", predicted=True).exit_code == 0
    assert r"<title>\udcff.waypoints</title>" in page.read_text()
    wrong = run(sound, "--report", sound)
    assert wrong.exit_code == 2
    assert "--report" in wrong.stderr
