"""Our client against our mock autopilot, over real sockets and lines; and the log of it."""

import os
import pty
import select
import socket
import stat
import threading
import time
import tty
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
from conftest import free_port
from full_disk import files_of_at_most
from pymavlink import mavutil
from pymavlink.dialects.v20 import common
from served import running, vehicle
from stations import FENCE, HOME, RALLY, a_mission, mock_of, places, vehicle_of

from faao_mav.errors import InputError, LinkError
from faao_mav.mission import Mission
from faao_mav.sim.faults import Faults
from faao_mav.wire import download, upload
from faao_mav.wire.codec import Codec
from faao_mav.wire.link import Tlog
from faao_mav.wire.messages import Heartbeat
from faao_mav.wire.protocol import GROUND_STATION, MissionType
from faao_mav.wire.transport import open_transport
from faao_mav.wire.wire_items import wire_items

MISSION = MissionType.MISSION


def test_a_mission_there_and_back() -> None:
    mission = a_mission(8, fence=FENCE, rally=RALLY)
    rows = places(wire_items(mission, MISSION, vehicle_of("px4")))
    faults = Faults(loss=0.2, latency=0.0, seed=3)
    with vehicle("px4", faults=faults, boot=1.5) as (connection, mock):
        report = upload(mission, connection, system=1)
        assert report.verified, report.problems
        assert [part.part for part in report.parts] == list(MissionType)
        assert places(mock.lists.items(MISSION)) == rows
        found = download(connection, system=1)
        assert places(wire_items(found, MISSION, vehicle_of("px4"))) == rows
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
        ("udpin:14550", "expected udpin:HOST:PORT"),
        ("udpout::14550", "expected udpout:HOST:PORT"),
        ("tcp:localhost:http", "expected tcp:HOST:PORT"),
        ("udpin:127.0.0.1:0", "port 0; expected 1 to 65535"),
        ("udpin:127.0.0.1:65536", "port 65536"),
        ("http://127.0.0.1:80", "expected udpin:HOST:PORT"),
        ("/dev/ttyACM0,fast", "baud rate 'fast'"),
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
        with (
            closing(open_transport(f"{kind}:127.0.0.1:{port}")),
            pytest.raises(InputError, match="the port is in use"),
        ):
            open_transport(f"{kind}:127.0.0.1:{port}")


def test_a_tcp_link_that_is_closed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        connection = f"tcp:127.0.0.1:{server.getsockname()[1]}"
        thread = threading.Thread(target=lambda: server.accept()[0].close())
        thread.start()
        with pytest.raises(LinkError, match="the other side closed the connection"):
            download(connection, wait=3.0)
        thread.join()


class Radio:
    """The far end of a pseudo terminal, `name`: the same bytes as over a radio."""

    listens = False

    def __init__(self) -> None:
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._ours)
        tty.setraw(self._theirs)
        self.name = os.ttyname(self._theirs)

    def read(self, timeout: float) -> list[tuple[bytes, str]]:
        ready = select.select([self._ours], [], [], max(timeout, 0))[0]
        return [(os.read(self._ours, 4096), "")] if ready else []

    def write(self, data: bytes, _: str | None = None) -> None:
        os.write(self._ours, data)

    def close(self) -> None:
        os.close(self._ours)
        os.close(self._theirs)


def test_a_serial_line() -> None:
    radio = Radio()
    with running(mock_of("ardupilot", beat=0.1), radio) as mock:
        assert upload(a_mission(5), f"{radio.name},57600", system=1).verified
    assert len(mock.mission().items) == 5


def test_a_serial_device_that_takes_no_bytes_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pseudo terminal that nobody reads, and that is full."""
    monkeypatch.setattr("faao_mav.wire.transport._WRITE_TIMEOUT", 0.2)
    radio = Radio()
    full = os.open(radio.name, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    for _ in range(10):  # what is under way makes room once more
        with suppress(BlockingIOError):
            while True:
                os.write(full, bytes(64))
        time.sleep(0.02)
    with pytest.raises(LinkError, match=r"it has taken no bytes for 0\.2 s; is the vehicle"):
        upload(a_mission(5), radio.name, system=1, wait=60.0)
    os.close(full)
    radio.close()


# ---- the log of an exchange


def logged(path: Path) -> list[Any]:
    """Return the messages in a log, as pymavlink reads them."""
    log, found = mavutil.mavlink_connection(str(path)), []
    while (message := log.recv_match()) is not None:
        found.append(message)
    log.close()
    return found


def test_only_its_owner_reads_a_log_which_keeps_no_key(tmp_path: Path) -> None:
    path, key = tmp_path / "exchange.tlog", bytes(range(32))
    setup = common.MAVLink_setup_signing_message(1, 1, list(key), 0)
    beat = Codec(GROUND_STATION).pack(Heartbeat(6, 8, 0, 0, 4))
    path.write_bytes(b"old")
    path.chmod(0o644)
    log = Tlog(path)
    for packet in (beat, bytes(setup.pack(common.MAVLink(None, 255, 190))), beat):
        log.write(packet, received=True)
    log.close()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert key[1:20] not in path.read_bytes()
    assert [each.get_type() for each in logged(path)] == ["HEARTBEAT"] * 2


def test_a_log_begins_with_what_is_received_and_ends_where_the_disk_is_full(tmp_path: Path) -> None:
    """The session goes on; an old log stays until something is received."""
    path, told = tmp_path / "exchange.tlog", list[str]()
    path.write_bytes(b"of an important flight")
    with pytest.raises(LinkError, match="no heartbeat"):
        download(f"udpout:127.0.0.1:{free_port()}", log=path, wait=0.2)
    assert path.read_bytes() == b"of an important flight"
    with vehicle("px4", rate=0.0) as (connection, _):
        with files_of_at_most(500):
            report = upload(a_mission(8), connection, system=1, log=path, note=told.append)
        assert report.verified
        assert told == [f"{path}: cannot be written: File too large; the log ends early"]
        assert path.stat().st_size == 500
        with files_of_at_most(100), pytest.warns(UserWarning, match="the log ends early"):
            download(connection, system=1, log=path)
    assert {each.get_type() for each in logged(path)[:1]} <= {"TIMESYNC", "HEARTBEAT"}
