"""The gate before a flight: what it finds, what overrules it, that nothing is armed past it.

A line of `tests/data/fly/gate.txt` says before the bar what the vehicle is and what is to be flown:

- `stands=EAST,HIGHER`, metres from home, or `abroad`, `antipode`, `nowhere`; `returns=EAST`: its
  own home; `battery=PERCENT`, `mode=NUMBER`, `armed`, `station`, `stranger`;
- `file` and `holds`: the mission of the file, and what the vehicle holds, if it is another one than
  that of five items; `unread=LIST`; `made=AUTOPILOT,TYPE`: whom the mission was made for;
- NAME=VALUE: its parameters; those that it `has` and `lacks` beside; `timed=NAME:VALUE,...`: those
  that the mission is timed for; `elsewhere`, `untimed`, `streamed`.

Behind the bar stand the rules of all errors, then what an error (`errs`), a warning (`warns`) or a
note (`notes`) says.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import FLYABLE, edited
from scenes import DATA, away, held_by, holding
from served import vehicle
from stations import FENCE, HOME, RALLY, a_mission, mock_of, peer_of
from typer.testing import CliRunner, Result

from faao_mav import parse_plan, plan_mission
from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import MadeFor
from faao_mav.cli.main import app
from faao_mav.fly.preflight import Clearance, Flight
from faao_mav.fly.telemetry import Telemetry
from faao_mav.mission import Home, Mission
from faao_mav.mission.fence import Circle, Fence
from faao_mav.mission.formats import PlanTarget, render_mission
from faao_mav.sim import MockAutopilot
from faao_mav.validate import Finding, Level
from faao_mav.wire import upload
from faao_mav.wire.messages import Heartbeat, SysStatus
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.transfer import PartReport
from faao_mav.wire.whereabouts import Whereabouts

LEVELS = {"errs": Level.ERROR, "warns": Level.WARNING, "notes": Level.NOTE}
PLACES = {
    "abroad": Home(47.4, 8.5, 584.0),
    "antipode": Home(35.363262, -30.834763, 584.0),
    "nowhere": None,
}


def within(radius: float) -> Mission:
    circle = Circle((HOME.latitude, HOME.longitude), radius, inclusion=True)
    return a_mission(5, fence=Fence(circles=(circle,)))


FAR = a_mission(5, shift=0.02)
MISSIONS: dict[str, Mission] = {
    "": a_mission(5),
    "homeless": replace(a_mission(5), home=None),
    "heightless": replace(a_mission(5), home=Home(HOME.latitude, HOME.longitude, math.nan)),
    "far": replace(FAR, items=FAR.items[1:]),  # 2 km from its home
    "shifted": a_mission(5, shift=1e-4),
    "rally": a_mission(5, rally=RALLY),
    "fenced": within(2000.0),
    "wide": within(5000.0),
    "otherwise": a_mission(5, fence=FENCE),
}


def found(flight: Flight, mock: MockAutopilot, told: Mapping[str, str]) -> dict[str, Finding]:
    """Return by rule what is found of a mission that `mock` holds, which stands at home.

    It has a full battery and rests, but for what is `told`.
    """
    held = held_by(mock, told.get("lacks", "").split(","))
    if "returns" in told:
        held = replace(held, home=away(float(told["returns"])))
    if "unread" in told:
        part = MissionType[told["unread"].upper()]
        lists = {each: rows for each, rows in held.lists.items() if each is not part}
        held = replace(held, lists=lists, missing={part: PartReport(part, "silent")})
    peer = peer_of(mock.behaviour.family.key)
    seen = Telemetry(peer, ())
    stands = told.get("stands", "0")
    seen.place = PLACES[stands] if stands in PLACES else away(*map(float, stands.split(",")))
    seen.stations = {"system 250, component 190"} if "station" in told else set()
    seen.strangers = {"192.168.1.7:14550"} if "stranger" in told else set()
    seen.status = SysStatus(0, 0, int(told.get("battery", 100)))
    autopilot, armed = mock.vehicle.family.mav_autopilot, 128 * ("armed" in told)
    seen.heartbeat = Heartbeat(2, autopilot, armed | 1, int(told.get("mode", mock.mode)), 4)
    gate = Clearance(flight, peer, held, "elsewhere" in told, "untimed" in told)
    return {each.rule: each for each in gate.found(seen)}


def errors(findings: Mapping[str, Finding]) -> set[str]:
    return {rule for rule, each in findings.items() if each.level is Level.ERROR}


def numbers(text: str) -> dict[str, float]:
    """Return values by name of NAME:VALUE,NAME:VALUE."""
    pairs = (each.split(":") for each in text.split(",") if each)
    return {name: float(value) for name, value in pairs}


def rows() -> Iterator[Any]:
    for line in (DATA / "gate.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            (kind, *words), (first, *rest) = (
                part.split(separator)
                for part, separator in zip(line.split("|"), (None, "&"), strict=True)
            )
            told = dict(word.partition("=")[::2] for word in words)
            yield pytest.param(kind, told, first.split(), [each.split() for each in rest], id=line)


@pytest.mark.parametrize(("kind", "told", "wrong", "says"), [*rows()])
def test_what_stands_against_a_flight(
    kind: str, told: dict[str, str], wrong: list[str], says: list[list[str]]
) -> None:
    values = {name: float(value) for name, value in told.items() if name.isupper()}
    mock = holding(MISSIONS[told.get("holds", "")], mock_of(kind, parameters=values))
    mock.parameters.values.update(numbers(told.get("has", "")))
    autopilot, _, made = told.get("made", "").partition(",")
    flight = Flight(
        MISSIONS[told.get("file", "")],
        Vehicle(kind, "copter", numbers(told.get("timed", ""))),
        MadeFor(autopilot or None, made or None, "as told") if autopilot else MadeFor(),
        streamed="streamed" in told,
    )
    findings = found(flight, mock, told)
    assert errors(findings) == set(wrong)
    for level, rule, *text in says:
        finding = findings[rule]
        assert finding.level is LEVELS[level]
        assert " ".join(text) in f"{finding.message} {finding.action}"


def test_a_plan_tells_what_the_flight_takes_of_the_battery() -> None:
    changes = {
        "vehicle.max_speed": 6,
        "flight.duration": 16,
        "vehicle.power": {},
        "vehicle.battery": {"capacity_wh": 20, "reserve": 20},
        **{f"flight.{end}_velocity": "hover" for end in ("start", "end")},
    }
    result = plan_mission(parse_plan(edited(FLYABLE, changes)))
    conversion, check = result.conversion, result.check
    assert conversion is not None
    assert check is not None
    assert check.energy is not None
    takes = 100 * check.energy.total / 20
    flight = Flight.planned(conversion, result.solution)
    tuned = mock_of("ardupilot", parameters=conversion.vehicle.parameters)
    mock = holding(conversion.mission, tuned)
    findings = found(flight, mock, {"battery": f"{int(takes) + 19}"})
    assert errors(findings) == {"battery-low"}
    assert f"takes {takes:.0f} %, and is to leave 20 %" in findings["battery-low"].message
    assert errors(found(flight, mock, {"battery": f"{int(takes) + 22}"})) == set()
    slow = holding(conversion.mission, mock_of("ardupilot"))
    assert errors(found(flight, slow, {})) >= {"timing-other"}
    assert errors(found(flight, slow, {"untimed": ""})) == set()


# ---- from the command line


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "m.waypoints"
    path.write_text(render_mission(a_mission(6), path))
    return path


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
            ("WPNAV_SPEED,-5", 2, "WPNAV_SPEED: -5; give a number of at least 10"),
            ("MPC_ACC_HOR,4", 1, "the vehicle has no MPC_ACC_HOR: nothing was set or uploaded"),
        ):
            file.write_text(lines)
            result = run("upload", mission, "--to", to, "--parameters", file)
            assert (result.exit_code, told in result.output) == (status, True), result.output
            assert mock.parameters.values == before
            assert mock.mission().items == ()


def test_nothing_is_armed_past_the_gate_but_what_an_option_overrules(mission: Path) -> None:
    """It stands elsewhere, and another mission has left its fence and rally points."""
    home, fenceless = away(200.0, -8.0), {"FENCE_ENABLE": 0}
    with vehicle(home=home, speedup=60.0, parameters=fenceless) as (to, mock):
        assert upload(a_mission(5, fence=FENCE, rally=RALLY), to).verified
        stands = "stands       200 m from the mission's home, 8 m lower: it is not armed there\n"
        assert stands in run("upload", mission, "--to", to).stdout
        result = run("fly", mission, "--to", to, "--arm")
        assert result.exit_code == 1
        for told in (
            "refused      nothing was started: it stands 200 m from the mission's home, not within",
            "warning: it holds a fence (4 items) that the file has not, and does nothing about it",
            "error: it holds rally points (2 items) that the file has not",
        ):
            assert told in result.stdout
        assert not mock.armed
        result = run("upload", mission, "--to", to, "--clear-rest", "--json")
        place = json.loads(result.stdout)["stands"]
        assert (place["from_home"], place["higher"]) == pytest.approx((200, -8), abs=1)
        assert place["is_meant"] is False
        assert mock.mission() == Mission(mock.mission().items, mock.mission().home)
        result = run("fly", mission, "--to", to, "--arm", "--elsewhere", "--json")
        assert result.exit_code == 0, result.output
        end = json.loads(result.stdout.splitlines()[-1])
        (here,) = (each for each in end["findings"] if each["rule"] == "place-home")
        assert (here["level"], here["action"]) == ("warning", "--elsewhere: flown all the same")
    near = [Whereabouts(19.9, up, None).is_meant for up in (9.9, -10.1, 10.1, None)]
    assert near == [True, False, False, True]
    with vehicle(place=1e9) as (to, _):
        told = run("upload", mission, "--to", to).stdout
        assert "stands       not known how far from the mission's home" in told
