"""`faao-mission validate`, by itself."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import FLYABLE, edited
from judged import given
from typer.testing import CliRunner

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import plan_target
from faao_mav.cli.main import app
from faao_mav.mission.formats import render_mission
from faao_mav.validate import RULES

WAY = "waypoint:0,100,30,6 waypoint:100,150,30 waypoint:200,160,30,10"
SOUND = f"takeoff change_speed=1,8,-1 {WAY} return"
Write = Callable[..., Path]


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["validate", *map(str, arguments)])


def found(*arguments: object) -> Any:
    return json.loads(run(*arguments, "--json").stdout)


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(line: str, name: str = "m.waypoints", vehicle: Vehicle | None = None) -> Path:
        path = tmp_path / name
        path.write_text(render_mission(given(line).mission, path, plan_target(vehicle)))
        return path

    return written


def test_errors_fail_and_say_item_rule_and_cure(write: Write) -> None:
    path = write(SOUND)
    result = run(path)
    assert result.exit_code == 0
    assert "m.waypoints: 6 items, for ArduPilot and a copter (by default" in result.stdout
    assert "0 errors, 0 warnings, 0 notes" in result.stdout
    unknown = run(path, "--autopilot", "px4", "--type", "plane").stdout
    assert "for PX4 and a plane (as asked)" in unknown
    assert "flight not predicted: there is no model of how PX4 flies planes" in unknown
    path = write("takeoff waypoint:0,9,9/1 return")
    result = run(path)
    assert result.exit_code == 1
    assert "error: item 2: " in result.stdout
    assert "[refused-on-upload]" in result.stdout
    assert "to do: give one of 0, 2, 3" in result.stdout
    answer = found(path)
    told = {"autopilot": "ardupilot", "type": "copter", "items": 3, "errors": 1}
    assert answer.items() >= told.items()
    finding = answer["findings"][0]
    assert (finding["level"], finding["rule"], finding["item"]) == ("error", "refused-on-upload", 2)
    assert finding["message"]
    assert finding["action"]
    path = write("takeoff change_speed=1,0,-1 waypoint:0,200,30 return")  # a warning, no worse
    assert [run(path).exit_code, run(path, "--strict").exit_code] == [0, 1]
    half = "waypoint:0,50,30,2.5 waypoint:0,100,30,2.5 waypoint:0,150,30,2.5"
    path = write(f"takeoff {half} change_speed=1,5,-1 waypoint:0,250,30,2.5")
    (line,) = (line for line in run(path).stdout.splitlines() if "[hold-changed]" in line)
    assert "items 2-4, 6: " in line
    assert "(and 3 more like it)" in line


def test_who_flies_it_within_which_limits(write: Write) -> None:
    plan = write(SOUND, "px4.plan", Vehicle("px4", "copter"))
    assert "for PX4 and a copter (as the file says)" in run(plan).stdout
    for wrong in (("--autopilot", "betaflight"), ("--type", "boat")):
        assert run(plan, *wrong).exit_code == 2
    sound = write(SOUND)
    slower = sound.with_name("plan.yaml")
    slower.write_text(edited(FLYABLE, {"vehicle.max_speed": 7, "flight.duration": 13}))
    asked = ("--max-altitude", 20, "--max-distance", 150, "--max-duration", 30)
    for limits, rules in (
        (("--plan", slower), {"speed-above-limit"}),
        (asked, {"above-ceiling", "beyond-distance", "too-long"}),
    ):
        assert rules <= {each["rule"] for each in found(sound, *limits)["findings"]}
    duration = found(sound)["predicted"]["duration"]
    kept, broken = (run(sound, "--max-duration", share * duration) for share in (1.01, 0.5))
    assert f"predicted flight: {duration:.0f} s" in kept.stdout
    assert (kept.exit_code, broken.exit_code) == (0, 1)
    for option, value in (("duration", "nan"), ("distance", "inf"), ("altitude", "0")):
        result = run(sound, f"--max-{option}", value)
        expected = f"faao-mission: --max-{option} {value}: expected a number above 0\n"
        assert (result.exit_code, result.stderr) == (2, expected)
    given_file, beside = sound.with_name("given.param"), sound.with_suffix(".param")
    for path, options in ((given_file, ("--parameters", given_file)), (beside, ())):
        path.write_text("WPNAV_SPEED,-5\n")
        result = run(sound, *options)
        assert result.exit_code == 2
        assert f"{path}" in result.stderr
        assert "WPNAV_SPEED: -5; give a number of at least" in result.stderr


def test_a_mission_is_validated_in_a_wind(write: Write) -> None:
    path = write("takeoff change_speed=1,8,-1 waypoint:0,90,30 waypoint:0,0,30 land")
    slow, quick = (
        found(path, *wind)["predicted"]["duration"] for wind in (("--wind", "8,180"), ())
    )
    assert slow > quick + 5
    airframe = "assumes the simulator's airframe (vehicle.body: sitl)"
    assert f"s in 8 m/s of wind; {airframe}" in run(path, "--wind", "8,180").stdout
    on_px4 = run(path, "--wind", "8,180", "--autopilot", "px4").stdout
    assert "s in 8 m/s of wind, as in calm air: its model leaves wind out; assumes" in on_px4
    assert "perhaps for the wind" in run(path, "--wind", "14,0").output
    for wind in ("8", "8,400", "fast,90", "-1,90", "nan,90", "8,90,3"):
        assert f"--wind {wind}: expected SPEED,FROM" in run(path, f"--wind={wind}").stderr


def test_rules_are_listed() -> None:
    text = run("--rules")
    assert (text.exit_code, len(text.stdout.splitlines())) == (0, len(RULES))
    listed = found("--rules")["rules"]
    assert [rule["id"] for rule in listed] == [rule.id for rule in RULES]
    assert {"level", "summary", "source", "autopilot", "type"} <= listed[0].keys()


@pytest.mark.usefixtures("unpainted")
def test_a_page_of_a_mission_by_itself(write: Write) -> None:
    sound = write(SOUND)
    page = sound.with_suffix(".html")
    assert run(sound, "--report", page).exit_code == 0
    text = page.read_text()
    for heading in ("Result", "Findings", "Mission", "Flight"):
        assert f"<h2>{heading}</h2>" in text
    assert "<h2>Route</h2>" not in text
    assert sound.name in text
    odd, page = (sound.with_name(os.fsdecode(b"\xff" + end)) for end in (b".waypoints", b".html"))
    odd.write_bytes(sound.read_bytes())
    assert run(odd, "--report", page, "--json").exit_code == 0
    assert r"<title>\udcff.waypoints</title>" in page.read_text()
    wrong = run(sound, "--report", sound)
    assert (wrong.exit_code, "--report" in wrong.stderr) == (2, True)
