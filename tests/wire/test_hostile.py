"""Peers that store, send or say what no vehicle should: nothing falls over, nothing is believed."""

import math
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import PATIENCE
from served import vehicle
from stations import FENCE, VEHICLE, Air, a_mission, mock_of, vehicle_of
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.errors import InputError, LinkError
from faao_mav.mission.formats.wpl import write_wpl
from faao_mav.sim import MockAutopilot, MockKind
from faao_mav.wire import messages, upload
from faao_mav.wire.codec import Codec
from faao_mav.wire.protocol import GROUND_STATION, MavCommand, MavResult, MissionType
from faao_mav.wire.wire_items import mission_of

NAN, INF = math.nan, math.inf


def row(
    command: int, z: float = 30.0, x: int = -353_600_000, y: int = 1_491_600_000, p: float = 0.0
) -> messages.WireItem:
    return messages.WireItem(command, 3, (p, 0.0, 0.0, 0.0), x, y, z)


def test_what_a_vehicle_holds_that_is_no_mission_is_not_downloaded() -> None:
    for part, rows, told in (
        (MissionType.FENCE, [row(5001, p=NAN)] * 3, "fence: a polygon stops after 3"),
        (MissionType.FENCE, [row(5003, p=NAN)], "fence circle: radius nan"),
        (MissionType.FENCE, [row(5003, p=INF)], "fence item 0: params .inf.*finite numbers"),
        (MissionType.RALLY, [row(5100, y=-(2**31))], r"rally points item 0: .* -214\.7483648"),
        (MissionType.MISSION, [row(16), row(16, x=2 * 10**9)], r"mission item 2: 200\.0, 149\.16"),
        (MissionType.MISSION, [row(16, INF)], "mission item 1: .* z inf; expected finite"),
    ):
        with pytest.raises(InputError, match=told):
            mission_of({part: rows}, vehicle_of("px4"))


class _Liar(MockAutopilot):
    """It refuses an item, with reasons of its own."""

    def _receive(self, envelope: messages.Envelope, now: float) -> Any:
        answers = super()._receive(envelope, now)
        if isinstance(envelope.message, messages.MissionItemInt):
            text = "no\x1b[2J\r\nverified     read back and compared, 1.3 s\n\x07"
            refusal = messages.MissionAck(GROUND_STATION, MissionType.MISSION, MavResult.INVALID)
            return [messages.Statustext(2, text), refusal]
        return answers


def test_a_status_text_stays_on_its_line(tmp_path: Path) -> None:
    path = tmp_path / "m.waypoints"
    path.write_text(write_wpl(a_mission(5)))
    with vehicle("px4", _Liar) as (to, _):
        result = CliRunner().invoke(app, ["upload", str(path), "--to", to, "--system", "1"])
    assert result.exit_code == 1
    assert not re.search("^verified", result.stdout, re.MULTILINE)
    assert "The vehicle says: no [2J  verified" in result.stdout
    assert result.stdout.replace("\n", "").isprintable()


def command(number: signal.Signals, arguments: list[str], **pipes: int) -> "subprocess.Popen[str]":
    """Run the program as a process that hears a signal, which `nohup` has it ignore."""
    heard = f"import signal; signal.signal({int(number)}, signal.SIG_DFL); "
    code = heard + "from faao_mav.cli.main import run; run()"
    nowhere = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-c", code, *arguments], text=True, **nowhere | pipes)  # type: ignore[call-overload,no-any-return]


def test_an_upload_that_is_ended_from_outside_is_cancelled(tmp_path: Path) -> None:
    path, cancelled = tmp_path / "m.waypoints", list[messages.MissionAck]()
    path.write_text(write_wpl(a_mission(9, fence=FENCE)))

    class Ended(MockAutopilot):
        def _receive(self, envelope: messages.Envelope, now: float) -> Any:
            message = envelope.message
            if isinstance(message, messages.MissionAck):
                cancelled.append(message)
            if isinstance(message, messages.MissionItemInt) and message.seq >= 2:
                client.send_signal(signal.SIGTERM)
                return ()
            return super()._receive(envelope, now)

    with vehicle("ardupilot", Ended) as (to, _):
        arguments = ["upload", str(path), "--to", to, "--system", "1"]
        client = command(signal.SIGTERM, arguments, stderr=subprocess.PIPE)
        _, errors = client.communicate(timeout=PATIENCE)
        for _ in range(100):  # the mock hears of it a moment later
            if not cancelled:
                time.sleep(0.02)
    assert client.returncode == 1
    assert "interrupted while uploading mission at item 3 of" in errors
    assert "cancelled. ArduPilot may now hold old and new items mixed" in errors
    assert [ack.type for ack in cancelled] == [MavResult.OPERATION_CANCELLED]


class _Told(MockAutopilot):
    """It notes the orders that it is given."""

    def _receive(self, envelope: messages.Envelope, now: float) -> Any:
        told = envelope.message
        if isinstance(told, messages.CommandLong) and told.command < MavCommand.SET_INTERVAL:
            self.orders = [*getattr(self, "orders", []), told.command]
        return super()._receive(envelope, now)


@pytest.mark.parametrize("hung_up", [True, False])
def test_a_mission_goes_on_when_nobody_can_be_told_any_more(tmp_path: Path, hung_up: bool) -> None:
    """A lost SSH session: a hang-up, or output that nobody reads."""
    path = tmp_path / "m.waypoints"
    path.write_text(write_wpl(a_mission(9)))
    with vehicle("ardupilot", _Told) as (to, mock):
        assert upload(a_mission(9), to, system=1).verified
        arguments = ["fly", str(path), "--to", to, "--system", "1", "--arm"]
        client = command(signal.SIGHUP, arguments, stdout=subprocess.PIPE)
        assert client.stdout is not None
        assert any("the mission is under way" in line for line in client.stdout)
        if hung_up:
            client.send_signal(signal.SIGHUP)
            assert "the terminal has gone" in client.stdout.read()
        client.stdout.close()
        assert client.wait(timeout=PATIENCE) != 0
        assert (mock.armed, mock.mode) == (True, 3)
        assert mock.orders == [MavCommand.ARM, MavCommand.START]


LEFT: dict[MockKind, str] = {
    "ardupilot": r"1 of 6\. ArduPilot may now hold old and new items mixed",
    "px4": r"1 of 5\. PX4 holds the old list or the new one, whole",
}


@pytest.mark.parametrize("kind", LEFT)
def test_a_link_that_breaks_in_an_upload_says_what_is_left(
    kind: MockKind, monkeypatch: pytest.MonkeyPatch
) -> None:
    mock = mock_of(kind)
    theirs = Codec(VEHICLE)
    waiting = [(theirs.pack(message), "") for message in mock.start(0.0)]

    def says(data: bytes | None) -> list[tuple[bytes, str]]:
        answers = list[messages.Message]()
        for packet in theirs.parse(data or b""):
            assert packet.envelope is not None
            if isinstance(packet.envelope.message, messages.MissionItemInt):
                raise LinkError("/dev/ttyACM0: the device is gone")
            answers += mock.on(packet.envelope, 1.0)
        return [(theirs.pack(answer), "") for answer in answers]

    air = Air(says, listens=False, waiting=waiting)
    monkeypatch.setattr("faao_mav.wire.link.open_transport", lambda _: air)
    with pytest.raises(LinkError, match=f"is gone, while uploading mission at item {LEFT[kind]}"):
        upload(a_mission(5), "/dev/ttyACM0", system=1)


def test_a_hang_up_is_ignored_where_it_was() -> None:
    """Under `nohup` a session outlives its terminal."""
    code = (
        "import signal, faao_mav.cli.main as main; signal.signal(signal.SIGHUP, signal.SIG_IGN);"
        "main.app = lambda: print(signal.getsignal(signal.SIGHUP).name); main.run()"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout == "SIG_IGN\n"
