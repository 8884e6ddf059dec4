"""A signed session with a real ArduCopter, and what it is told as with another key or none.

PX4 1.16 does not sign after SETUP_SIGNING; it is what a vehicle without signatures is.
"""

import time
from pathlib import Path

import pytest
from pymavlink import mavutil
from simulators import HOME, simulated

from faao_mav.errors import LinkError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.wire import download, upload

KEY = bytes(range(1, 33))
OTHER = bytes(32)

_LATITUDE, _LONGITUDE, _ALTITUDE = map(float, HOME.split(","))
MISSION = Mission(
    (
        MissionItem(22, 3, x=_LATITUDE, y=_LONGITUDE, z=20.0),
        MissionItem(16, 3, x=_LATITUDE + 1e-3, y=_LONGITUDE, z=30.0),
        MissionItem(20, 2),
    ),
    Home(_LATITUDE, _LONGITUDE, _ALTITUDE),
)


def give_key(connection: str) -> None:
    """Set the vehicle up to sign, as a ground station does over a cable."""
    station = mavutil.mavlink_connection(connection, source_system=255, source_component=190)
    assert station.wait_heartbeat(timeout=30) is not None
    for _ in range(3):
        station.mav.setup_signing_send(1, 1, list(KEY), int((time.time() - 1_420_070_400) * 1e5))
        time.sleep(0.2)
    station.close()


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    return path


def test_a_signed_session_with_arducopter(autopilots: Path, tmp_path: Path, key_file: Path) -> None:
    with simulated(autopilots, "arducopter", tmp_path) as connection:
        give_key(connection)
        for _ in range(2):  # the second is younger than what is remembered of the first
            assert upload(MISSION, connection, signing_key=key_file, system=1, wait=30.0).verified
        assert len(download(connection, system=1, signing_key=key_file).items) == len(MISSION.items)
        key_file.write_bytes(OTHER)
        with pytest.raises(LinkError, match="signed with another key than the one in"):
            download(connection, signing_key=key_file, wait=3.0)


def test_px4_does_not_sign(autopilots: Path, tmp_path: Path, key_file: Path) -> None:
    with (
        simulated(autopilots, "px4", tmp_path) as connection,
        pytest.raises(LinkError, match="packets come that are not signed"),
    ):
        download(connection, signing_key=key_file, wait=5.0)
