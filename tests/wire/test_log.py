"""The log of an exchange: whose it is, what it leaves out, and a disk that is full."""

import stat
from pathlib import Path

import pytest
from conftest import free_port
from full_disk import files_of_at_most
from pymavlink import mavutil
from pymavlink.dialects.v20 import common
from served import vehicle
from stations import a_mission

from faao_mav.errors import LinkError
from faao_mav.wire import download, upload
from faao_mav.wire.codec import Codec
from faao_mav.wire.link import Tlog
from faao_mav.wire.messages import Heartbeat
from faao_mav.wire.protocol import GROUND_STATION

KEY = bytes(range(32))
BEAT = Codec(GROUND_STATION).pack(Heartbeat(6, 8, 0, 0, 4))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "exchange.tlog"


def names(path: Path) -> list[str]:
    """Return the messages in a log, as pymavlink reads them."""
    log, found = mavutil.mavlink_connection(str(path)), []
    while (message := log.recv_match()) is not None:
        found.append(message.get_type())
    log.close()
    return found


def test_only_its_owner_reads_a_log_which_keeps_no_key(path: Path) -> None:
    setup = common.MAVLink_setup_signing_message(1, 1, list(KEY), 0)
    path.write_bytes(b"old")
    path.chmod(0o644)
    log = Tlog(path)
    for packet in (BEAT, bytes(setup.pack(common.MAVLink(None, 255, 190))), BEAT):
        log.write(packet, received=True)
    log.close()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert KEY[1:20] not in path.read_bytes()
    assert names(path) == ["HEARTBEAT"] * 2


def test_an_old_log_stays_until_something_is_received(path: Path) -> None:
    path.write_bytes(b"of an important flight")
    with pytest.raises(LinkError, match="no heartbeat"):
        download(f"udpout:127.0.0.1:{free_port()}", log=path, wait=0.2)
    assert path.read_bytes() == b"of an important flight"


def test_a_full_disk_ends_the_log_and_not_the_session(path: Path) -> None:
    told: list[str] = []
    with vehicle("px4", rate=0.0) as (connection, _):
        with files_of_at_most(500):
            report = upload(a_mission(8), connection, system=1, log=path, note=told.append)
        assert report.verified
        assert told == [f"{path}: cannot be written: File too large; the log ends early"]
        assert path.stat().st_size == 500
        with files_of_at_most(100), pytest.warns(UserWarning, match="the log ends early"):
            download(connection, system=1, log=path)
    assert {"TIMESYNC", "HEARTBEAT"} >= set(names(path)[:1])
