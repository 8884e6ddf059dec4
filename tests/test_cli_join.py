"""Commands joined: plan and validate, plan and upload, a saved solution, parameters beside."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from conftest import MISSIONS, SMALL, edited, free_port
from served import running
from typer.testing import CliRunner

from faao_mav import upload
from faao_mav.cli.main import app
from faao_mav.mission.fence import Circle, Fence
from faao_mav.mission.formats import read_mission
from faao_mav.mission.formats.parameter_file import read_parameters
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.sim import MockAutopilot, behaviour_of
from faao_mav.wire.messages import ParamRequestRead, ParamValue
from faao_mav.wire.protocol import Address, MavResult
from faao_mav.wire.transport import Transport

HOME = Home(-35.363262, 149.165237, 584.0)
GENTLE = edited(
    SMALL,
    {
        "vehicle.max_speed": 8,
        "vehicle.max_acceleration": 1.5,
        "flight.duration": 16,
        "radio.fading": "none",
        "name": "gentle",
    },
)


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(a) for a in arguments])


def edit_plan(path: Path, changes: dict[str, object]) -> Path:
    path.write_text(edited(path.read_text(), changes))
    return path


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(GENTLE)
    return path


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "m.waypoints"


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
        assert read_mission(out).items
        if option == "--json":
            found = json.loads(result.stdout)
            assert found["validation"][0]["level"] == "error"
            assert found["upload"] is None
        else:
            assert ("checks       1 error" in result.stdout) is (option == "--verbose")


def test_a_download_brings_the_fence_in_a_file_of_its_own(tmp_path: Path) -> None:
    port, out = free_port(), tmp_path / "back.waypoints"
    sent = Mission(
        (MissionItem(16, 3, x=-35.36, y=149.16, z=50),),
        HOME,
        Fence(circles=(Circle((-35.36, 149.16), 90.0, inclusion=True),)),
    )
    mock = MockAutopilot(behaviour_of("px4"), home=HOME, beat=0.1)
    with running(mock, f"udpin:127.0.0.1:{port}"):
        assert upload(sent, f"udpout:127.0.0.1:{port}").verified
        result = run("download", "--from", f"udpout:127.0.0.1:{port}", "--out", out)
        again = run("download", "--from", f"udpout:127.0.0.1:{port}", "--out", tmp_path / "b.plan")
    assert result.exit_code == 0, result.output
    assert "5003" in (tmp_path / "back.fence.waypoints").read_text()
    assert "vehicle      PX4 copter (system 1, component 1, disarmed)" in again.stdout
    assert json.loads((tmp_path / "b.plan").read_text())["mission"]["firmwareType"] == 12


def test_a_planes_mission_on_a_plane(out: Path, tmp_path: Path) -> None:
    plan = tmp_path / "plane.yaml"
    level = {"vehicle.min_speed": 12, "vehicle.type": "plane", "flight.duration": 20}
    free = {"flight.start_velocity": "free", "flight.end_velocity": "free"}
    far = {"flight.start": [0, 200], "flight.end": [200, 0], "flight.time_step": 1}
    plan.write_text(edited(GENTLE, level | free | far | {"vehicle.max_speed": 16}))
    port = free_port()
    mock = MockAutopilot(behaviour_of("ardupilot"), aircraft="plane", home=HOME, beat=0.1)
    with running(mock, f"udpin:127.0.0.1:{port}"):
        result = run(plan, "--out", out, "--upload", f"udpout:127.0.0.1:{port}", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)["upload"]
    assert told["verified"] is True
    assert told["vehicle"]["type"] == "plane"


def test_a_plan_beyond_the_vehicle_is_refused_before_the_work(
    plan: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("faao_mav.workflow.plan_mission", lambda *_, **__: pytest.fail("worked"))
    beyond = {"vehicle.max_speed": 22, "vehicle.max_acceleration": 5.5}
    plan.write_text(edited(GENTLE, beyond))
    end = "give that or less, or --force to make the mission all the same"
    for where in (("--out", out), ("--upload", f"udpout:127.0.0.1:{free_port()}")):
        result = run(plan, *where)
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.splitlines() == [
            f"faao-mission: {plan}: vehicle.max_speed: 22 m/s; ArduCopter keeps plans of at most "
            f"20 m/s (the most that it is told); {end}",
            f"{plan}: vehicle.max_acceleration: 5.5 m/s^2; ArduCopter keeps plans of at most "
            f"5 m/s^2 (WP_ACC); {end}",
        ]
        assert not out.exists()


def test_what_only_the_simulators_airframe_cannot_fly_is_a_note(plan: Path, out: Path) -> None:
    edit_plan(plan, {"flight.duration": 30})
    assert "assumes the simulator's airframe (vehicle.body: sitl)" in run(plan).stdout
    edit_plan(plan, {"vehicle.body": {"linear_drag": 0.9}})
    told = json.loads(run(plan, "--out", out, "--json").stdout)
    assert told["predicted"]["assumption"] == "assumes the airframe of vehicle.body"
    assert [e["level"] for e in told["validation"] if e["rule"] == "speed-lean"] == ["note"]
    assert {e["level"] for e in told["validation"]} <= {"note", "warning"}


def test_an_upload_that_fails_leaves_the_files(plan: Path, out: Path) -> None:
    port = free_port()
    mock = MockAutopilot(
        behaviour_of("ardupilot", refusals={(0, 2): MavResult.UNSUPPORTED}), home=HOME, beat=0.1
    )
    asked = (plan, "--out", out, "--upload", f"udpout:127.0.0.1:{port}")
    with running(mock, f"udpin:127.0.0.1:{port}"):
        result, told = run(*asked), run(*asked, "--json")
    assert result.exit_code == told.exit_code == 1
    assert "the mission is not verified; do not fly it" in result.stderr
    assert "failed       mission: refused: UNSUPPORTED" in result.stdout
    assert json.loads(told.stdout)["upload"]["verified"] is False
    assert read_mission(out).items


def test_a_vehicle_in_flight_keeps_its_mission(plan: Path, out: Path) -> None:
    port = free_port()
    mock = MockAutopilot(behaviour_of("ardupilot"), home=HOME, beat=0.1)
    mock.flight.arm(0.0)
    connection = f"udpout:127.0.0.1:{port}"
    with running(mock, f"udpin:127.0.0.1:{port}"):
        refused = run(plan, "--out", out, "--upload", connection)
        assert refused.exit_code == 1
        assert "--allow-armed" in refused.stderr
        assert "files  " in refused.stdout
        assert run(plan, "--upload", connection, "--allow-armed", "--quiet").exit_code == 0


def test_validate_with_the_plan(plan: Path, out: Path, tmp_path: Path) -> None:
    save = tmp_path / "r.npz"
    told = json.loads(run(plan, "--out", out, "--save", save, "--json").stdout)
    by_plan = run("validate", out, "--plan", plan, "--json")
    assert by_plan.exit_code == 0, by_plan.output
    found = json.loads(by_plan.stdout)
    assert found["link"]["planned_rate"] == told["average_rate"]
    assert found["link"]["predicted_rate"] == pytest.approx(
        told["predicted"]["average_rate"], rel=0.01
    )
    named = [
        [(f["rule"], f["item"]) for f in each] for each in (found["findings"], told["validation"])
    ]
    assert named[0] == named[1]
    assert found == json.loads(run("validate", out, "--solution", save, "--json").stdout)


def test_parameters_beside_a_mission_say_whose_it_is_and_are_used(plan: Path, out: Path) -> None:
    run(edit_plan(plan, {"vehicle.autopilot": "px4"}), "--out", out)
    beside, other = out.with_suffix(".params"), out.with_suffix(".param")
    told = run("validate", out).stdout
    assert "for PX4 and a copter (as m.params beside it says)" in told
    assert f"parameters: {beside}, beside the mission" in told
    given = run("validate", out, "--parameters", beside).stdout
    assert "for PX4" in given
    assert f"parameters: {beside}\n" in given
    other.write_text("WPNAV_ACCEL,50\n")
    both = run("validate", out)
    assert both.exit_code == 2
    assert f"{other} and {beside}: only one of them can" in both.stderr
    assert "for PX4" in run("validate", out, "--autopilot", "px4").stdout
    asked = run("validate", out, "--autopilot", "ardupilot", "--parameters", beside)
    other.write_text(beside.read_text())
    wrong = run("validate", out, "--autopilot", "ardupilot")
    assert asked.exit_code == wrong.exit_code == 2
    assert "parameters of PX4, but the mission is for ArduPilot (as asked)" in asked.stderr
    assert f"{other}: parameters of PX4" in wrong.stderr
    for path in (beside, other):
        path.unlink()
    assert "parameters: defaults" in run("validate", out).stdout


def test_a_mission_of_another_type_of_vehicle_is_not_judged_unasked(plan: Path, out: Path) -> None:
    file = out.with_suffix(".plan")
    run(plan, "--out", file)
    content = json.loads(file.read_text())
    content["mission"]["vehicleType"] = 10  # MAV_TYPE_GROUND_ROVER
    file.write_text(json.dumps(content))
    refused = run("validate", file)
    assert refused.exit_code == 2
    assert f"{file}: vehicleType 10 (a MAV_TYPE) is not supported" in refused.stderr
    assert "and a plane (as asked)" in run("validate", file, "--type", "plane").stdout


def test_the_mock_flies_by_its_parameters(
    plan: Path, out: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run(plan, "--out", out)
    mission, made = read_mission(out), []

    def serve(mock: MockAutopilot, transport: Transport, **_: object) -> None:
        transport.close()
        made.append(mock)

    monkeypatch.setattr("faao_mav.sim.serve.serve", serve)
    listen = ["--listen", f"udpin:127.0.0.1:{free_port()}"]
    slow = tmp_path / "slow.param"
    slow.write_text("WPNAV_ACCEL,50\nWPNAV_SPEED,300\n")
    assert run("autopilot", *listen, "--parameters", out.with_suffix(".param")).exit_code == 0
    assert run("autopilot", *listen, "--parameters", slow).exit_code == 0
    flights = [mock.flight._fly(mission, mock.flight.vehicle) for mock in made]
    quick, late = (flight.t[-1] for flight in flights)
    assert late > quick + 20
    (answer,) = made[1].parameters.on(ParamRequestRead(Address(1, 1), "WPNAV_ACCEL", -1))
    assert isinstance(answer, ParamValue)
    assert answer.param_value == read_parameters(slow)["WPNAV_ACCEL"]


@pytest.mark.usefixtures("unpainted")
def test_what_cannot_be_flown_is_information_where_nobody_flies_it(
    plan: Path, out: Path, tmp_path: Path
) -> None:
    save, page, figure = (tmp_path / name for name in ("r.npz", "r.html", "r.png"))
    paper = tmp_path / "paper.yaml"  # 100 m/s
    brief = {"flight.duration": 20, "flight.time_step": 1}
    paper.write_text(edited((MISSIONS / "paper_fig3.yaml").read_text(), brief))
    told = run(paper, "--save", save, "--report", page)
    assert (told.exit_code, told.stderr) == (0, "")
    assert re.search(r"^checks       \d+ warnings, ", told.stdout, re.M)
    refused = run(paper, "--out", out, "--save", save)
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert not out.exists()
    assert run(paper, "--out", out, "--force").exit_code == 0

    plan.write_text(edited(GENTLE, {"mission.max_items": 4}))
    told = run(plan, "--save", save, "--report", page, "--figure", figure)
    assert (told.exit_code, told.stderr) == (0, "")
    assert re.search(r"^mission      none: .*mission\.max_items", told.stdout, re.M)
    assert "mission.max_items" in page.read_text()
    assert save.exists()
    assert figure.exists()
    data = json.loads(run(plan, "--json").stdout)
    assert data["mission"] is data["predicted"] is None
    asked = run(plan, "--upload", "udpout:127.0.0.1:14550")
    assert (asked.exit_code, asked.stdout) == (1, "")
    assert "mission.max_items" in data["no_mission"]
    assert "mission.max_items" in asked.stderr


def test_a_plane_that_flies_at_no_such_speed_is_planned_but_gets_no_mission(
    plan: Path, out: Path
) -> None:
    text = (MISSIONS / "plane_relay.yaml").read_text()
    changes = {"vehicle.max_speed": 60, "radio.fading": "none", "flight.duration": 60}
    plan.write_text(edited(text, changes))
    refused = run(plan, "--out", out)
    assert refused.exit_code == 2
    assert "vehicle.max_speed: 60 m/s; the plane flies" in refused.stderr
    told = run(plan)
    assert told.exit_code == 0
    assert "mission      none: " in told.stdout
    assert "vehicle.max_speed: 60 m/s; the plane flies" in told.stdout
    plan.write_text(edited(text, {"vehicle.parameters": {"AIRSPEED_MIN": -1}}))
    assert run(plan).exit_code == 2  # a value of no use is not information
