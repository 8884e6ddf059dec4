"""The commands that talk to vehicles."""

import json
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import free_port
from served import vehicle
from stations import FENCE, HOME, RALLY, a_mission, hurry, vehicle_of
from typer.testing import CliRunner, Result

from faao_mav.cli.main import app
from faao_mav.errors import LinkError
from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.fence import Fence
from faao_mav.mission.formats import read_mission, read_mission_file, write_wpl
from faao_mav.sim import MockAutopilot, faults
from faao_mav.wire import download as get
from faao_mav.wire import upload as put
from faao_mav.wire.messages import Envelope, MissionRequestList
from faao_mav.wire.protocol import MavResult, MissionType
from faao_mav.wire.transport import Transport
from faao_mav.wire.wire_items import wire_items


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture
def mission_file(tmp_path: Path) -> Path:
    path = tmp_path / "m.waypoints"
    path.write_text(write_wpl(a_mission(6)))
    return path


def test_upload_and_download(tmp_path: Path) -> None:
    """What ArduPilot does not keep is told once for each field."""
    path, out = tmp_path / "m.waypoints", tmp_path / "back.plan"
    items = tuple(
        MissionItem(16, 3, (2.5, 0.0, 0.0, float("nan")), -35.36 + k * 1e-4, 149.16, 20.0)
        for k in range(4)
    )
    path.write_text(write_wpl(Mission(items, HOME)))
    with vehicle() as (to, _):
        result = run("upload", path, "--to", to, "--system", 1)
        assert (result.exit_code, result.stderr) == (0, ""), result.output
        *told, kept, verified = result.stdout.splitlines()
        assert told == [
            "vehicle      ArduPilot copter (system 1, component 1, disarmed)",
            "stands       0 m from the mission's home, 0 m higher",
            "mission      4 items stored",
        ]
        lost = "mission item 0: param1 2.5 is kept as 2.0 (and so in 3 more items)"
        assert kept == f"not kept     {lost}"
        assert verified.startswith("verified     read back and compared; the upload took ")
        result = run("download", "--from", to, "--out", out, "--system", 1)
        assert result.exit_code == 0, result.output
    assert "mission      4 items, 0 fence areas, 0 rally points" in result.stdout
    found = read_mission(out)
    assert found.home == HOME
    assert json.loads(out.read_text())["mission"]["firmwareType"] == 3  # MAV_AUTOPILOT of ArduPilot
    for kept_item, item in zip(found.items, items, strict=True):
        assert (kept_item.x, kept_item.y, kept_item.z) == pytest.approx((item.x, item.y, item.z))


def test_json_is_one_object(mission_file: Path) -> None:
    with vehicle("px4") as (to, _):
        result = run("upload", mission_file, "--to", to, "--json", "--system", 1)
    assert (result.exit_code, result.stdout.count("\n")) == (0, 1)
    data = json.loads(result.stdout)
    assert (data["verified"], data["vehicle"]["autopilot"], data["problems"]) == (True, "px4", [])
    (mission,) = data["lists"]
    assert (mission["list"], mission["items"], mission["verdict"]) == ("mission", 6, "verified")
    assert mission["opaque_id"] > 0
    item = MissionItem(16, 3, (2.5, 0.0, 0.0, float("nan")), -35.36, 149.16, 20.0)
    mission_file.write_text(write_wpl(Mission((item,), HOME)))
    with vehicle() as (to, _):
        result = run("upload", mission_file, "--to", to, "--json", "--system", 1)
    lost = {"item": 0, "field": "param1", "sent": 2.5, "found": 2.0, "kind": "dropped"}
    assert json.loads(result.stdout)["lists"][0]["differences"] == [lost]


def test_a_refused_upload_is_status_1(mission_file: Path) -> None:
    with vehicle(refusals={(0, 3): MavResult.INVALID_PARAM7}) as (to, _):
        result = run("upload", mission_file, "--to", to, "--system", 1)
    assert result.exit_code == 1
    assert "failed       mission: refused: INVALID_PARAM7" in result.stdout
    assert "at item 2 (command 16). ArduPilot may now hold old and new items mixed" in result.stdout
    assert "not verified; do not fly it" in result.stderr
    assert "verified     " not in result.stdout


def test_the_mock_autopilot_as_a_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its diary tells what it was given; it ends by the keyboard."""
    ended, port, serve = threading.Event(), free_port(), faults.serve

    def until_ended(mock: MockAutopilot, transport: Transport, **options: Any) -> None:
        serve(mock, transport, **options, stop=ended.is_set)
        raise KeyboardInterrupt

    monkeypatch.setattr(faults, "serve", until_ended)
    results = []

    def serve_it() -> None:
        results.append(
            run("autopilot", "--listen", f"udpin:127.0.0.1:{port}", "--kind", "px4", "--drop", 0.05)
        )

    thread = threading.Thread(target=serve_it)
    thread.start()
    try:
        time.sleep(0.3)
        assert put(a_mission(6, fence=FENCE), f"udpout:127.0.0.1:{port}", system=1).verified
    finally:
        ended.set()
        thread.join()
    (result,) = results
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0] == f"px4, system 1, at udpin:127.0.0.1:{port}; Ctrl-C ends"
    assert lines[1:] == ["mission: 6 rows", "fence: 4 rows", "ended"]


class Reticent(MockAutopilot):
    """It says nothing about what it holds beside its mission, or `part` of it."""

    parts: tuple[MissionType, ...] = (MissionType.FENCE, MissionType.RALLY)

    def _receive(self, envelope: Envelope, now: float) -> Any:
        message = envelope.message
        asked = isinstance(message, MissionRequestList) and message.mission_type in self.parts
        return () if asked else super()._receive(envelope, now)


@pytest.mark.parametrize("part", [MissionType.FENCE, MissionType.RALLY])
def test_what_can_be_read_is_written_and_what_cannot_is_told(
    part: MissionType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hurry(monkeypatch)
    held = a_mission(5, fence=FENCE, rally=RALLY)
    outs = tmp_path / "m.plan", tmp_path / "m.waypoints"
    with vehicle("px4", Reticent) as (source, mock):
        mock.parts = (part,)
        for each in MissionType:
            mock.lists.replace(each, wire_items(held, each, vehicle_of("px4")))
        results = [run("download", "--from", source, "--system", 1, "--out", out) for out in outs]
    for out, result in zip(outs, results, strict=True):
        assert result.exit_code == 1
        assert f"{part.title} not read" in result.stdout
        assert f"written      {out}" in result.stdout
        assert f"{part.title}: not read: the vehicle stopped answering" in result.stderr
        assert f"{out}: without the {part.title} that the vehicle may hold" in result.stderr
        found = read_mission_file(out).mission
        assert len(found.items) == 5
        assert found.fence == (Fence() if part is MissionType.FENCE else FENCE)
    assert "QGroundControl clears it there" not in result.stderr  # a text file has no such part
    plan = read_mission_file(outs[0])
    assert plan.mission.rally == (() if part is MissionType.RALLY else RALLY)
    untold = f"m.plan: without the {part.title} that the vehicle may hold: not read from it"
    assert [told.endswith(untold) for told in plan.warnings] == [True]


def test_a_download_without_a_mission_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hurry(monkeypatch)
    out = tmp_path / "m.plan"
    with vehicle("px4", Reticent) as (to, mock):
        with pytest.raises(LinkError, match="fence: not read"):  # Python gets no part for the whole
            get(to, system=1)
        mock.parts = (MissionType.MISSION,)
        result = run("download", "--from", to, "--system", 1, "--out", out)
        nobody = run("download", "--from", to, "--system", 9, "--out", out, "--timeout", 0.3)
    assert (result.exit_code, nobody.exit_code) == (1, 1)
    assert "mission: not read: the vehicle stopped answering" in result.stderr
    assert "no heartbeat of the autopilot of system 9 within 0.3 s" in nobody.stderr
    assert not out.exists()
