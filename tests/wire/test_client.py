"""Our client against our mock autopilot, over real sockets of the loopback interface."""

import os
import pty
import select
import socket
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from conftest import free_port
from served import running, vehicle
from stations import FENCE, HOME, RALLY, a_mission, mock_of, places, vehicle_of

from faao_mav.errors import InputError, LinkError
from faao_mav.mission import Mission
from faao_mav.sim import MockKind
from faao_mav.sim.faults import Faults
from faao_mav.wire import download, upload
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.transport import open_transport
from faao_mav.wire.wire_items import wire_items

MISSION = MissionType.MISSION


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_mission_there_and_back(kind: MockKind) -> None:
    mission = a_mission(8, fence=FENCE, rally=RALLY)
    rows = places(wire_items(mission, MISSION, vehicle_of(kind)))
    faults = Faults(loss=0.2, latency=0.0, seed=3)
    with vehicle(kind, faults=faults, boot=1.5) as (connection, mock):
        report = upload(mission, connection, system=1)
        assert report.verified, report.problems
        assert [part.part for part in report.parts] == list(MissionType)
        assert places(mock.lists.items(MISSION)) == rows
        found = download(connection, system=1)
        assert places(wire_items(found, MISSION, vehicle_of(kind))) == rows
        assert (found.fence, found.rally) == (FENCE, RALLY)
        assert found.home in (HOME, None)  # asked for a few times only
        kept = upload(a_mission(4), connection, system=1)
        assert [part.part for part in kept.parts] == [MISSION]
        assert mock.mission().rally == RALLY
        rest = upload(a_mission(5, fence=FENCE), connection, system=1, clear_rest=True)
        assert [part.part for part in rest.parts] == list(MissionType)
        assert (mock.mission().rally, mock.mission().fence) == ((), FENCE)


def test_other_ways_to_connect() -> None:
    for listen, to in (("tcpin", "tcp"), ("udpout", "udpin")):
        port = free_port(socket.SOCK_STREAM)
        with running(mock_of("px4", beat=0.1), f"{listen}:127.0.0.1:{port}"):
            assert upload(a_mission(5), f"{to}:127.0.0.1:{port}", system=1).verified


def test_the_mission_of_an_armed_vehicle_is_left_alone() -> None:
    with vehicle("px4") as (connection, mock):
        mock.flight.arm(0.0)
        with pytest.raises(LinkError, match="armed vehicle is not replaced; disarm it"):
            upload(a_mission(5), connection, system=1)
        assert mock.mission().items == ()
        assert upload(a_mission(5), connection, system=1, allow_armed=True).verified


def test_what_cannot_be_sent_or_logged_is_an_error_before_anything_is_sent(tmp_path: Path) -> None:
    path = tmp_path / "m.waypoints"
    path.write_text("QGC WPL 110\n")
    for mission, log, told in (
        (a_mission(5), tmp_path / "no" / "x.tlog", "is no directory"),
        (a_mission(5), path, "ends in .tlog"),
        (Mission(()), None, "the mission has no items"),
    ):
        with pytest.raises(InputError, match=told):
            upload(mission, "udpout:127.0.0.1:9", log=log)
    assert path.read_text() == "QGC WPL 110\n"


def test_connections_that_are_none_or_cannot_be_opened() -> None:
    for text, told in (
        ("nonsense", "expected udpin:HOST:PORT"),
        ("udpin:14550", "expected udpin:HOST:PORT"),
        ("udpout::14550", "expected udpout:HOST:PORT"),
        ("tcp:localhost:http", "expected tcp:HOST:PORT"),
        ("udpin:127.0.0.1:0", "port 0; expected 1 to 65535"),
        ("udpin:127.0.0.1:65536", "port 65536"),
        ("http://127.0.0.1:80", "expected udpin:HOST:PORT"),
        ("/dev/ttyACM0,fast", "baud rate 'fast'"),
        ("/dev/ttyNONE,57600", "there is no such device"),
    ):
        with pytest.raises(InputError, match=told):
            open_transport(text)
    for host in ("no-such-host.invalid", "127.0.0..1", "x" * 64 + ".org"):
        with pytest.raises(LinkError, match="there is no host"):
            open_transport(f"udpout:{host}:14550")
    port = free_port(socket.SOCK_STREAM)
    with pytest.raises(LinkError, match="nothing listens there"):
        open_transport(f"tcp:127.0.0.1:{port}")
    for kind in ("udpin", "tcpin"):
        first = open_transport(f"{kind}:127.0.0.1:{port}")
        try:
            with pytest.raises(InputError, match="the port is in use"):
                open_transport(f"{kind}:127.0.0.1:{port}")
        finally:
            first.close()


def test_a_tcp_link_that_is_closed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        connection = f"tcp:127.0.0.1:{server.getsockname()[1]}"
        thread = threading.Thread(target=lambda: server.accept()[0].close())
        thread.start()
        with pytest.raises(LinkError, match="the other side closed the connection"):
            download(connection, wait=3.0)
        thread.join()


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """A pseudo terminal: the same bytes as over a radio; what is beyond it, and its name."""
    ours, theirs = pty.openpty()
    for each in (ours, theirs):
        tty.setraw(each)
    yield ours, os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def test_a_serial_line(line: tuple[int, str]) -> None:
    ours, name = line

    class Radio:
        listens = False

        def read(self, timeout: float) -> list[tuple[bytes, str]]:
            ready = select.select([ours], [], [], max(timeout, 0))[0]
            return [(os.read(ours, 4096), "")] if ready else []

        def write(self, data: bytes, _: str | None = None) -> None:
            os.write(ours, data)

        def close(self) -> None:
            pass

    with running(mock_of("ardupilot", beat=0.1), Radio()) as mock:
        assert upload(a_mission(5), f"{name},57600", system=1).verified
    assert len(mock.mission().items) == 5


def test_a_serial_device_that_takes_no_bytes_is_told(
    line: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pseudo terminal that nobody reads, and that is full."""
    monkeypatch.setattr("faao_mav.wire.transport._WRITE_TIMEOUT", 0.2)
    full = os.open(line[1], os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    for _ in range(10):  # what is under way makes room once more
        with suppress(BlockingIOError):
            while True:
                os.write(full, bytes(64))
        time.sleep(0.02)
    with pytest.raises(LinkError, match=r"it has taken no bytes for 0\.2 s; is the vehicle"):
        upload(a_mission(5), line[1], system=1, wait=60.0)
    os.close(full)
