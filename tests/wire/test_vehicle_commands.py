"""The commands that talk to vehicles."""

import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
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


def test_what_is_not_kept_is_told_once_for_each_field(tmp_path: Path) -> None:
    path, out = tmp_path / "m.waypoints", tmp_path / "back.plan"
    items = tuple(
        MissionItem(16, 3, (2.5, 0.0, 0.0, float("nan")), -35.36 + k * 1e-4, 149.16, 20.0)
        for k in range(4)
    )
    path.write_text(write_wpl(Mission(items, HOME)))
    with vehicle() as (to, _):
        sent = ("upload", path, "--to", to, "--system", 1)
        result, data = run(*sent), run(*sent, "--json").stdout
        held = run("download", "--from", to, "--out", out, "--system", 1).stdout
    assert "mission      4 items, 0 fence areas, 0 rally points" in held
    lost = "mission item 1: param1 2.5 is kept as 2.0 (and so in 3 more items)"
    assert f"\nnot kept     {lost}\nverified     read back and compared; " in result.stdout
    assert (result.stderr, data.count("\n")) == ("", 1)
    (mission,) = json.loads(data)["lists"]
    assert (mission["list"], mission["items"], mission["verdict"]) == ("mission", 4, "verified")
    lost_field = {"item": 1, "field": "param1", "sent": 2.5, "found": 2.0, "kind": "dropped"}
    assert lost_field in mission["differences"]
    assert json.loads(out.read_text())["mission"]["firmwareType"] == 3  # MAV_AUTOPILOT of ArduPilot
    for kept, item in zip(read_mission(out).items, items, strict=True):
        assert (kept.x, kept.y, kept.z) == pytest.approx((item.x, item.y, item.z))


def test_a_refused_upload_is_status_1(tmp_path: Path) -> None:
    path = tmp_path / "m.waypoints"
    path.write_text(write_wpl(a_mission(6)))
    with vehicle(refusals={(0, 3): MavResult.INVALID_PARAM7}) as (to, _):
        result = run("upload", path, "--to", to, "--system", 1)
        (problem,) = put(a_mission(700), to, system=1).problems
    assert result.exit_code == 1
    assert "failed       mission: refused: INVALID_PARAM7" in result.stdout
    assert "at item 3 (command 16). ArduPilot may now hold old and new items mixed" in result.stdout
    assert "not verified; do not fly it" in result.stderr
    assert "verified     " not in result.stdout
    assert "NO_SPACE: 701 rows with home, and a vehicle like this holds about 650" in problem
    assert "The vehicle says: Only 655 items are supported" in problem


def test_the_mock_autopilot_as_a_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its diary tells what it was given; it ends by the keyboard."""
    ended, port, serve = threading.Event(), free_port(), faults.serve

    def until_ended(mock: MockAutopilot, transport: Transport, **options: Any) -> None:
        serve(mock, transport, **options, stop=ended.is_set)
        raise KeyboardInterrupt

    monkeypatch.setattr(faults, "serve", until_ended)
    options = ("--listen", f"udpin:127.0.0.1:{port}", "--kind", "px4", "--drop", 0.05)
    with ThreadPoolExecutor() as pool:
        running = pool.submit(run, "autopilot", *options)
        try:
            time.sleep(0.3)
            assert put(a_mission(6, fence=FENCE), f"udpout:127.0.0.1:{port}", system=1).verified
        finally:
            ended.set()
    result = running.result()
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0] == f"px4, system 1, at udpin:127.0.0.1:{port}; Ctrl-C ends"
    assert lines[1:] == ["mission: 6 rows", "fence: 4 rows", "ended"]


class Reticent(MockAutopilot):
    """It says nothing about what it holds of some `parts`."""

    parts: tuple[MissionType, ...] = (MissionType.FENCE,)

    def _receive(self, envelope: Envelope, now: float) -> Any:
        message = envelope.message
        asked = isinstance(message, MissionRequestList) and message.mission_type in self.parts
        return () if asked else super()._receive(envelope, now)


def test_what_can_be_read_is_written_and_what_cannot_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python gets no part for the whole; without a mission nothing is written."""
    hurry(monkeypatch)
    held = a_mission(5, fence=FENCE, rally=RALLY)
    plan, text = tmp_path / "m.plan", tmp_path / "m.waypoints"
    with vehicle("px4", Reticent) as (source, mock):
        for each in MissionType:
            mock.lists.replace(each, wire_items(held, each, vehicle_of("px4")))
        asked = ("download", "--from", source, "--system", 1, "--out")
        results = [run(*asked, out) for out in (plan, text)]
        with pytest.raises(LinkError, match="fence: not read"):
            get(source, system=1)
        mock.parts = (MissionType.MISSION,)
        nothing = run(*asked, tmp_path / "none.plan")
    for out, result in zip((plan, text), results, strict=True):
        assert result.exit_code == 1
        assert "fence not read" in result.stdout
        assert f"written      {out}" in result.stdout
        assert "fence: not read: the vehicle stopped answering" in result.stderr
        assert f"{out}: without the fence that the vehicle may hold" in result.stderr
        found = read_mission_file(out).mission
        assert (len(found.items), found.fence) == (5, Fence())
    assert "QGroundControl clears it there" not in result.stderr  # a text file has no such part
    read = read_mission_file(plan)
    assert read.mission.rally == RALLY
    untold = "m.plan: without the fence that the vehicle may hold: not read from it"
    assert [told.endswith(untold) for told in read.warnings] == [True]
    assert nothing.exit_code == 1
    assert "mission: not read: the vehicle stopped answering" in nothing.stderr
    assert not (tmp_path / "none.plan").exists()
