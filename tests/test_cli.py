"""The command line: one pass through every command, and what each says of work that went wrong.

What is refused before any work is in `test_cli_refused.py`.
"""

import json
import os
import re
import select
import socket
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, MISSIONS, edited, free_port
from hypothesis import given, settings
from hypothesis import strategies as st
from served import HOME, vehicle
from typer.testing import CliRunner

from faao_mav.autopilot import Vehicle, autopilots, kinds
from faao_mav.cli.main import app
from faao_mav.mission.fence import Circle, Fence
from faao_mav.mission.formats import read_mission, read_mission_file, write_mission
from faao_mav.mission.formats.parameter_file import read_parameters
from faao_mav.mission.item import Mission, MissionItem
from faao_mav.plan.keys import reference
from faao_mav.wire.protocol import MavResult

pytestmark = pytest.mark.usefixtures("planned_once")

DATA = Path(__file__).parent / "data"
SCRIPT = Path(sys.executable).with_name("faao-mission")
GENTLE = edited(FLYABLE, {"vehicle.max_speed": 8, "vehicle.max_acceleration": 1.5,
                          "flight.duration": 16, "name": "gentle"})  # fmt: skip


def run(*arguments: object, **options: Any) -> Any:
    return CliRunner().invoke(app, [str(each) for each in arguments], **options)


def record(*arguments: object) -> Any:
    """Return the object that a command prints, and nothing else, with --json."""
    result = run(*arguments, "--json")
    assert (result.exit_code, result.stdout.count("\n")) == (0, 1), result.output
    return json.loads(result.stdout)


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(GENTLE)
    return path


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "m.waypoints"


def test_one_pass_through_every_command(plan: Path, out: Path, tmp_path: Path) -> None:
    slow = {"vehicle.max_speed": 6, "mission.on_finish": "land", "flight.altitude": 10}
    ends = {f"flight.{end}_velocity": "hover" for end in ("start", "end")}
    plan.write_text(edited(FLYABLE, slow | ends | {"flight.duration": 16}))
    save, page, figure, table, log, back = (
        tmp_path / name for name in ("r.npz", "r.html", "f.png", "p.csv", "f.tlog", "back.plan")
    )
    told = record(plan, "--out", out, "--save", save, "--report", page, "--figure", figure,
                  "--precoders", table)  # fmt: skip
    assert told["average_rate"] == min(told["rate_bs_uav"], told["rate_uav_user"])
    assert told["average_rate"] < told["mutual_information"] < 2
    assert (told["upper_bound"], told["fresh_rate"], told["upload"]) == (None, None, None)
    assert told["iterations"] == len(told["history"]) - 1
    assert 0 < told["seconds"]["optimize"] <= told["seconds"]["total"]
    assert max(told["residuals"].values()) < 1e-6
    assert told["mission"]["items"] == len(read_mission(out).items)
    assert told["mission"]["duration"] == told["predicted"]["duration"] > 15
    assert told["predicted"]["rms_position_error"] <= told["predicted"]["max_position_error"]
    assert {"rule", "item", "level", "message", "action"} <= told["validation"][0].keys()
    with np.load(save) as archive:
        promised = "t w v a P_B P_U H_rB H_rU I_U I_G received forwarded queue R_avg R_U R_G"
        assert {*promised.split(), "history", "plan"} < {*archive}
        assert archive["w"].shape == (32, 2)
        assert archive["predicted_t"].shape == archive["predicted_w"].shape[:1]
        come, gone, waiting = (archive[name] for name in ("received", "forwarded", "queue"))
        assert archive["R_del"] == told["delivered_rate"] == pytest.approx(gone.mean())
    assert np.diff(waiting) == pytest.approx((come - gone)[:-1], abs=1e-12)
    parameters = read_parameters(out.with_suffix(".param"))
    assert parameters["WPNAV_ACCEL"] == pytest.approx(100 * parameters["WP_ACC"])
    names = {path.name for path in (plan, out, save, page, figure, table)} | {"m.param"}
    assert {path.name for path in tmp_path.iterdir()} == names

    judged = record("validate", out, "--plan", plan)
    assert judged["link"]["planned_rate"] == told["average_rate"]
    rate = told["predicted"]["average_rate"]
    assert judged["link"]["predicted_rate"] == pytest.approx(rate, rel=0.01)
    assert judged["findings"] == told["validation"]
    assert judged == record("validate", out, "--solution", save)

    with (
        vehicle(speedup=8.0, parameters={"GUID_TIMEOUT": 1.0}) as (to, _),
        socket.socket(type=socket.SOCK_DGRAM) as radio,
    ):
        radio.bind(("127.0.0.1", 0))
        assert record("upload", out, "--to", to)["verified"] is True
        assert run("download", "--from", to, "--out", back).exit_code == 0
        stored = map(Vehicle("ardupilot").type.dialect.stored, read_mission(out).items)
        assert read_mission(back).items == tuple(stored)
        port = radio.getsockname()[1]
        flown = run("fly", out, "--to", to, "--solution", save, "--arm", "--stream", "--json",
                    "--log", log, "--radio", f"udp:127.0.0.1:{port}")  # fmt: skip
        assert flown.exit_code == 0, flown.output
        heard = []  # on a busy machine not all of the 32 are told
        while select.select([radio], [], [], 0.1)[0]:
            heard.append(json.loads(radio.recv(65_536)))
    slots, planned = [line["slot"] for line in heard], np.load(save)["w"]
    assert all(slot != then for slot, then in pairwise(slots))  # back if it is led back
    timed = [line for line in heard if line["t"] is not None]
    away = [np.hypot(*(planned[line["slot"]] - (line["east"], line["north"]))) for line in timed]
    assert max(away) < 6  # m: within a slot's way, 5 m, a slot is that of the place
    assert len(slots) > 4
    *lines, end = map(json.loads, flown.stdout.splitlines())
    assert (end["ending"], slots[0]) == ("finished", 0)
    assert end["flight"]["flown"]["delivered_rate"] > 0.97 * told["delivered_rate"]
    stands = [line["plan"] for line in lines if line.get("plan")]
    assert max(abs(each["late"]) for each in stands) < 2
    assert stands[-1]["expected"] == pytest.approx(16 * told["delivered_rate"], rel=0.05)
    again = record("debrief", log, "--solution", save)
    assert again["planned"] == end["flight"]["planned"]
    rate = end["flight"]["flown"]["delivered_rate"]
    assert again["flown"]["delivered_rate"] == pytest.approx(rate, rel=0.02)

    made = record("convert", back, "--out", tmp_path / "m.kml")
    assert made == {"items": told["mission"]["items"], "lost": made["lost"],
                    "written": str(tmp_path / "m.kml")}  # fmt: skip
    (row,) = record("study", plan, "--power", "10", "--jobs", "1")["rows"]
    assert row["delivered"] == pytest.approx(told["delivered_rate"])


@pytest.mark.usefixtures("coarse_map")
def test_bound_and_algorithm_1_by_option(plan: Path) -> None:
    plan.write_text(edited(FLYABLE, {"radio.fading": "ergodic", "radio.fading_samples": 4}))
    data = record(plan, "--bound")
    assert data["average_rate"] <= data["upper_bound"] <= 2
    assert data["upper_bound_exact"] is False
    assert data["fresh_rate"] == pytest.approx(data["average_rate"], abs=0.2)
    assert 0 < data["fresh_rate_error"] < 0.2
    assert data["starts"]["straight"] <= data["average_rate"] + 1e-3
    plan.write_text(edited(FLYABLE, {"radio.fading": "realization"}))
    data = record(plan, "--method", "algorithm1")
    assert (data["fresh_rate"], data["starts"]) == (None, {})
    assert "less than 0.0001" in data["ending"]


def test_what_is_made_of_a_plan_for_px4_and_a_plane(plan: Path, tmp_path: Path) -> None:
    plan.write_text(edited(GENTLE, {"vehicle.autopilot": "px4"}))
    for name, words in (("m.waypoints", ""), ("m.plan", "plan"), ("m.kml", "")):
        assert run(*words.split(), plan, "--out", tmp_path / name, "--quiet").output == ""
    read = read_mission_file(tmp_path / "m.plan")
    assert (read.firmware, read.vehicle_type) == (12, 2)
    assert read.mission == read_mission(tmp_path / "m.waypoints")
    assert "<LineString>" in (tmp_path / "m.kml").read_text()
    out, save = tmp_path / "m.waypoints", tmp_path / "r.npz"
    told = record(plan, "--out", out, "--save", save)
    with vehicle("px4", speedup=20.0) as (to, mock):
        flight = ("fly", out, "--to", to, "--solution", save, "--arm", "--json")
        assert run("upload", out, "--to", to).exit_code == 0
        early = run(*flight)
        assert (early.exit_code, mock.armed, "timing-other" in early.output) == (1, False, True)
        set_up = record("upload", out, "--to", to, "--parameters", out.with_suffix(".params"))
        assert set_up["parameters"]
        end = json.loads(run(*flight).stdout.splitlines()[-1])
    assert end["ending"] == "finished"
    for name in ("average_rate", "delivered_rate"):
        assert end["flight"]["flown"][name] == pytest.approx(told["predicted"][name], rel=0.005)
    assert end["flight"]["altitude_error"] < 0.5
    level = {"vehicle.min_speed": 12, "vehicle.max_speed": 16, "vehicle.type": "plane"}
    free = {"flight.start_velocity": "free", "flight.end_velocity": "free", "flight.duration": 20}
    far = {"flight.start": [0, 200], "flight.end": [200, 0], "flight.time_step": 1}
    plan.write_text(edited(GENTLE, level | free | far))
    with vehicle(aircraft="plane") as (to, _):
        told = record(plan, "--out", tmp_path / "p.waypoints", "--upload", to)["upload"]
    assert (told["verified"], told["vehicle"]["type"]) == (True, "plane")


def test_what_a_vehicle_holds_is_downloaded_and_no_other_mission_flown(
    plan: Path, out: Path, tmp_path: Path
) -> None:
    up = MissionItem(22, 3, x=HOME.latitude, y=HOME.longitude, z=20.0)
    over = MissionItem(16, 3, x=HOME.latitude, y=HOME.longitude, z=30.0)
    fence = Fence(circles=(Circle((HOME.latitude, HOME.longitude), 90.0, inclusion=True),))
    write_mission(Mission((up, over, MissionItem(20, 2)), HOME, fence), out)
    with vehicle("px4") as (to, mock):
        assert run("upload", out, "--to", to).exit_code == 0
        told = run("download", "--from", to, "--out", tmp_path / "back.waypoints")
        assert run("download", "--from", to, "--out", tmp_path / "b.plan").exit_code == 0
        out.write_text(out.read_text().replace("30", "40"))
        result = run("fly", out, "--to", to, "--arm", "--json")
        assert (result.exit_code, mock.armed) == (1, False)
    assert "vehicle      PX4 copter (system 1, component 1, disarmed)" in told.stdout
    assert "5003" in (tmp_path / "back.fence.waypoints").read_text()
    assert read_mission_file(tmp_path / "b.plan").firmware == 12
    end = json.loads(result.stdout.splitlines()[-1])
    assert end["ending"] == "different"
    assert end["differences"] == ["mission item 2: z: sent 40.0, found 30.0"]
    result = run("debrief", DATA / "logs" / "arducopter.tlog", "--plan", plan)
    assert result.exit_code == 1
    assert "the plan's flight is not in it" in result.output


def test_a_mission_with_errors_is_kept_but_not_called_good(plan: Path, out: Path) -> None:
    plan.write_text(edited(GENTLE, {"mission.takeoff": False}))
    warned = run(plan, "--out", out)
    assert (warned.exit_code, warned.stderr) == (0, "")
    assert "checks       1 warning" in warned.stdout
    assert "             warning: there is no take-off" in warned.stdout
    flat = {"vehicle.power": {}, "vehicle.battery": {"capacity_wh": 1}}
    plan.write_text(edited(GENTLE, flat))
    for option in ("--verbose", "--json", "--quiet"):
        result = run(plan, "--out", out, "--upload", f"udpout:127.0.0.1:{free_port()}", option)
        assert result.exit_code == 1
        assert re.search(r"^faao-mission: error: .* \[battery-reserve\]; ", result.stderr, re.M)
        assert "does not pass validation; do not fly it" in result.stderr
        assert ("checks       1 error" in result.stdout) is (option == "--verbose")
        assert (json.loads(result.stdout)["upload"] is None) if option == "--json" else True
    assert read_mission(out).items


@pytest.mark.usefixtures("unpainted")
def test_a_plan_without_a_mission_is_information_where_nobody_flies_it(
    plan: Path, out: Path, tmp_path: Path
) -> None:
    plan.write_text(edited(GENTLE, {"mission.max_items": 4}))
    save, page, figure = (tmp_path / name for name in ("r.npz", "r.html", "r.png"))
    data = record(plan, "--save", save, "--report", page, "--figure", figure)
    assert data["mission"] is data["predicted"] is None
    assert "mission.max_items" in page.read_text()
    assert figure.exists()
    assert re.search(r"^mission      none: .*mission\.max_items", run(plan).stdout, re.M)
    out.write_text("precious")
    save.unlink()
    for where in (("--out", out), ("--upload", "udpout:127.0.0.1:14550")):
        asked = run(plan, *where, "--save", save)
        assert (asked.exit_code, asked.stdout) == (1, "")
        assert "mission.max_items" in asked.stderr
        assert "mission.max_items" in data["no_mission"]
    assert save.exists()
    assert out.read_text() == "precious"


@pytest.mark.usefixtures("unpainted")
def test_a_plan_beyond_its_vehicle_gets_a_mission_by_force_alone(
    plan: Path, out: Path, tmp_path: Path
) -> None:
    brief = {"flight.duration": 20, "flight.time_step": 1}
    plan.write_text(edited((MISSIONS / "paper_fig3.yaml").read_text(), brief))  # 100 m/s
    told = run(plan, "--report", tmp_path / "r.html")
    assert (told.exit_code, told.stderr) == (0, "")
    assert re.search(r"^checks       \d+ warnings, ", told.stdout, re.M)
    assert run(plan, "--out", out).exit_code == 2
    assert not out.exists()
    assert run(plan, "--out", out, "--force").exit_code == 0


def test_an_upload_that_fails_or_is_refused_leaves_the_files(plan: Path, out: Path) -> None:
    with vehicle(refusals={(0, 2): MavResult.UNSUPPORTED}) as (to, _):
        result, told = (run(plan, "--out", out, "--upload", to, *end) for end in ((), ("--json",)))
    assert result.exit_code == told.exit_code == 1
    assert "the mission is not verified; do not fly it" in result.stderr
    assert "failed       mission: refused: UNSUPPORTED" in result.stdout
    assert json.loads(told.stdout)["upload"]["verified"] is False
    assert read_mission(out).items
    with vehicle() as (to, mock):
        mock.flight.arm(0.0)
        refused = run(plan, "--out", out, "--upload", to)
        assert (refused.exit_code, "--allow-armed" in refused.stderr) == (1, True)
        assert "files  " in refused.stdout
        assert run(plan, "--upload", to, "--allow-armed", "--quiet").exit_code == 0


def test_parameters_beside_a_mission_say_whose_it_is_and_are_used(plan: Path, out: Path) -> None:
    plan.write_text(edited(GENTLE, {"vehicle.autopilot": "px4"}))
    run(plan, "--out", out)
    beside, other = out.with_suffix(".params"), out.with_suffix(".param")
    told = run("validate", out).stdout
    assert "for PX4 and a copter (as m.params beside it says)" in told
    assert f"parameters: {beside}, beside the mission" in told
    given = run("validate", out, "--parameters", beside).stdout
    assert "for PX4 and a copter (as its parameters say)" in given
    assert f"parameters: {beside}\n" in given
    other.write_text("WPNAV_ACCEL,50\n")
    both = run("validate", out)
    assert (both.exit_code, f"{other} and {beside}: only one of them can" in both.stderr) == (
        2,
        True,
    )
    assert "for PX4" in run("validate", out, "--autopilot", "px4").stdout
    other.write_text(beside.read_text())
    for path, options in ((beside, ("--parameters", beside)), (other, ())):
        wrong = run("validate", out, "--autopilot", "ardupilot", *options)
        told = f"{path}: parameters of PX4, but the mission is for ArduPilot (as asked)"
        assert (wrong.exit_code, told in wrong.stderr) == (2, True)
        path.unlink()
    assert "parameters: defaults" in run("validate", out).stdout
    content = json.loads((DATA / "missions" / "px4.plan").read_text())
    content["mission"]["vehicleType"] = 10  # MAV_TYPE_GROUND_ROVER
    (rover := out.with_name("rover.plan")).write_text(json.dumps(content))
    refused = run("validate", rover)
    assert refused.exit_code == 2
    assert f"{rover}: vehicleType 10 (a MAV_TYPE) is not supported" in refused.stderr
    assert "and a plane (as asked)" in run("validate", rover, "--type", "plane").stdout


def test_the_mock_has_its_parameters(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made: list[Any] = []
    monkeypatch.setattr("faao_mav.sim.faults.serve", lambda *parts, **_: made.extend(parts))
    (slow := tmp_path / "slow.param").write_text("WPNAV_ACCEL,50\n")
    listen = ("--listen", f"udpin:127.0.0.1:{free_port()}")
    assert run("autopilot", *listen, "--parameters", slow).exit_code == 0
    mock, transport = made
    transport.close()
    assert mock.flight.vehicle.parameters["WPNAV_ACCEL"] == 50


def test_what_is_odd_about_a_file_is_told(tmp_path: Path) -> None:
    source, made = DATA / "missions", tmp_path / "m.plan"
    result = run("convert", source / "plain.waypoints", "--out", made)
    told = "no autopilot is known: the plan is for a generic one"
    assert result.stderr == f"faao-mission: {made}: {told}\n"
    for options, firmware in (((), 12), (("--autopilot", "ardupilot"), 3)):
        result = run("convert", source / "px4.plan", "--out", made, *options)
        assert ("not set (NaN) becomes 0" in result.stderr) is (firmware == 3)
        assert read_mission_file(made).firmware == firmware
    gap = source / "gap.waypoints"
    for command in (("convert", gap, "--out", made.with_suffix(".txt")), ("validate", gap)):
        assert run(*command).stderr.splitlines() == [
            f"faao-mission: {gap}: line 4, field index: '3': indexes do not count up; rows are "
            "taken in the file's order, in which targets of DO_JUMP count too"
        ]


def test_a_plan_may_have_any_name_or_be_piped_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("valley", "convert"):
        Path(name).write_text(FLYABLE)
    assert run("valley", "--quiet", "--out", "out.waypoints").exit_code == 0
    assert run("./convert", "--quiet").exit_code == 0
    odd = os.fsdecode(b"m\xff")  # no Unicode
    piped = run("-", "--out", f"{odd}.waypoints", "--quiet", input=FLYABLE)
    assert (piped.exit_code, piped.stderr) == (0, "")
    assert Path(f"{odd}.param").read_text().startswith("# for m?.waypoints")


def test_help_tells_how_to_plan_and_every_command() -> None:
    shown = run("--help").stdout
    assert "faao-mission PLAN.yaml --out MISSION" in shown
    commands = "validate upload download fly debrief link convert autopilot study app"
    assert all(f"\n  {command} " in shown for command in commands.split())
    assert run("-h").stdout == shown
    assert "--method" in run("plan.yaml", "--help").stdout
    validates = run("validate", "--help").stdout
    assert all(name in validates for name in (*autopilots(), *kinds()))
    listed = run("link", "--help").stdout.partition("Options:")[2]
    order = ["--station", "--out", "--power", "--map", "--terrain", "--report"]
    assert order == sorted(order, key=listed.index)  # what is asked for most stands first
    assert "Commands:" in run().stderr


def test_as_a_program(tmp_path: Path) -> None:
    """The installed script: errors are one line."""

    def script(*arguments: object, **options: Any) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([SCRIPT, *map(str, arguments)], text=True, **options)

    where = tmp_path / "no.yaml"
    bad = script(where, capture_output=True)
    assert bad.returncode == 2
    assert bad.stderr == f"faao-mission: {where}: cannot be read: No such file or directory\n"
    mission = tmp_path / "ü.waypoints"
    mission.write_text("QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t400\t1\n")
    if Path("/dev/full").exists():
        with Path("/dev/full").open("w") as full:
            done = script("validate", mission, stdout=full, stderr=subprocess.PIPE)
        told = "faao-mission: standard output: cannot be used: No space left on device\n"
        assert (done.returncode, done.stderr) == (2, told)
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = script("validate", mission, capture_output=True, env=ascii_only)
    assert (done.returncode, done.stderr) == (1, "")
    assert "\\xfc.waypoints: 0 items" in done.stdout


TINY = edited(FLYABLE, {"flight.duration": 3, "flight.end": [5, 45], "optimizer.max_iterations": 1})
ODD: list[Any] = [
    None,
    True,
    False,
    float("nan"),
    float("inf"),
    10**20,
    "hover",
    "free",
    "mrt",
    "land",
    {},
    "",
]
NUMBERS = st.integers(-3, 300) | st.floats(-500, 500)
VALUES = st.sampled_from(ODD) | NUMBERS | st.text(max_size=8) | st.lists(NUMBERS, max_size=3)
PATHS = [*(path for path in reference() if not path.startswith(("goal", "study"))), "flight.extra"]


@settings(max_examples=15)
@given(st.dictionaries(st.sampled_from(PATHS), VALUES, min_size=1, max_size=3))
def test_no_mutation_gives_a_traceback_or_a_partial_file(
    tmp_path_factory: pytest.TempPathFactory, changes: dict[str, Any]
) -> None:
    folder = tmp_path_factory.mktemp("fuzz")
    plan, out = folder / "plan.yaml", folder / "m.waypoints"
    # a section that is replaced has no keys to change
    sections = {path for path in changes if any(other.startswith(f"{path}.") for other in changes)}
    plan.write_text(edited(TINY, {p: value for p, value in changes.items() if p not in sections}))
    result = run(plan, "--out", out, "--json")
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    written = {path.name for path in folder.iterdir()}
    if result.stdout:
        assert result.exit_code in (0, 1)
        json.loads(result.stdout)
        assert read_mission(out).items
        assert written - {"m.param"} == {"m.waypoints", "plan.yaml"}
    else:
        assert result.exit_code in (1, 2)
        assert result.stderr
        assert written == {"plan.yaml"}
