"""Real autopilots answer as recorded; uploads to them are verified over links of every kind."""

import dataclasses
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from exchanges import recorded, renewed
from pymavlink import mavutil
from simulators import KINDS, rebootable, simulated
from stations import FENCE, RALLY, a_mission, signing_key

from faao_mav.errors import LinkError
from faao_mav.mission import MissionItem
from faao_mav.sim.faults import Faults, FaultyTransport
from faao_mav.wire import download, link, upload
from faao_mav.wire.transport import open_transport

MISSION = a_mission(6, fence=FENCE, rally=RALLY)

PATIENCE = 40.0
"""Seconds to wait for a heartbeat: PX4's simulator stands still now and then on a busy machine."""

SIGNING_EPOCH = 1_420_070_400
"""Seconds from 1970 to the start of 2015, where the clock of signatures starts."""


@pytest.mark.parametrize("kind", KINDS)
def test_the_real_one_answers_as_the_mocks_are_held_to(
    kind: str, autopilots: Path, tmp_path: Path
) -> None:
    for attempt in range(3):  # one that is starved of the processor repeats itself at other times
        (where := tmp_path / str(attempt)).mkdir()
        found = renewed(kind, autopilots, where)
        if found == recorded(kind).rstrip():
            break
    assert found == recorded(kind).rstrip()


@pytest.fixture(scope="module", params=KINDS)
def vehicle(
    request: pytest.FixtureRequest, autopilots: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[str]:
    """Where each of the autopilots is heard."""
    where = tmp_path_factory.mktemp(request.param)
    with simulated(autopilots, request.param, where) as connection:
        yield connection


FAULTS = Faults(
    duplication=0.05, reordering=0.1, delay=0.3, latency=0.0, outages=((2.0, 3.5),), seed=1
)
"""A link about as bad as `sessions.py` draws, but for loss: an outage in the middle too."""


@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_everything_is_stored_read_back_and_cleared(
    vehicle: str, loss: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    faults = dataclasses.replace(FAULTS, loss=loss)
    monkeypatch.setattr(
        link, "open_transport", lambda text: FaultyTransport(open_transport(text), faults)
    )
    report = upload(MISSION, vehicle, wait=PATIENCE)
    assert report.problems == ()
    assert [part.verdict for part in report.parts] == ["verified"] * 3
    found = download(vehicle, wait=PATIENCE)
    assert (found.fence, found.rally) == (MISSION.fence, MISSION.rally)
    assert [places(item) for item in found.items] == [places(item) for item in MISSION.items]
    bare = a_mission(3)
    assert upload(bare, vehicle, wait=PATIENCE, clear_rest=True).problems == ()
    found = download(vehicle, wait=PATIENCE)
    assert (found.fence, found.rally) == (bare.fence, bare.rally)


@pytest.mark.parametrize("kind", KINDS)
def test_signed(kind: str, autopilots: Path, tmp_path: Path) -> None:
    """PX4 1.16 does not sign after SETUP_SIGNING; it is what a vehicle without signatures is."""
    key, right, wrong = signing_key("valley"), tmp_path / "right.key", tmp_path / "wrong.key"
    for file, content in ((right, key), (wrong, signing_key("hill"))):
        file.write_bytes(content)
        file.chmod(0o600)
    ticks = int((time.time() - SIGNING_EPOCH) * 1e5)
    with simulated(autopilots, kind, tmp_path) as connection:
        if kind == "px4":
            with pytest.raises(LinkError, match="packets come that are not signed"):
                download(connection, signing_key=right, wait=5.0)
            return
        setup = mavutil.mavlink_connection(connection, source_system=255, source_component=190)
        setup.wait_heartbeat(timeout=PATIENCE)
        for _ in range(3):  # there is no answer to it
            setup.mav.setup_signing_send(1, 1, list(key), ticks)
        setup.recv_match(type="HEARTBEAT", blocking=True, timeout=PATIENCE)
        setup.close()
        for _ in range(2):  # the second is younger than what is remembered of the first
            assert upload(MISSION, connection, wait=PATIENCE, signing_key=right).problems == ()
        with pytest.raises(LinkError, match="signed with another key than the one in"):
            download(connection, wait=3, signing_key=wrong)


@pytest.mark.parametrize(
    ("kind", "moment"),
    [("arducopter", "reading"), ("arduplane", "uploading"), ("px4", "uploading")],
)
def test_a_reboot_in_the_middle(kind: str, moment: str, autopilots: Path, tmp_path: Path) -> None:
    """The power goes while a mission replaces another: what is said of it afterwards is true.

    ArduPilot's simulator comes back at another port, which is noted and not followed.
    """
    old, new, notes = a_mission(60, shift=0.01), a_mission(80), list[str]()
    with rebootable(autopilots, kind, tmp_path) as (connection, reboot):
        assert upload(old, connection, wait=PATIENCE).problems == ()
        rebooted = threading.Thread(target=reboot)

        def observe(what: str, done: int, total: int) -> None:
            if what.startswith(moment) and done >= 20 and rebooted.ident is None:
                rebooted.start()

        report = upload(new, connection, wait=PATIENCE, observe=observe, note=notes.append)
        rebooted.join()
        found = download(connection, wait=PATIENCE)
        held = [places(item) for item in found.items]
        wanted = [places(item) for item in new.items]
        assert (held == wanted) if report.verified else report.problems
        assert all("begin again" in note for note in notes)
        assert upload(new, connection, wait=PATIENCE).problems == ()


def places(item: MissionItem) -> tuple[int, float, float, float]:
    """Return what no autopilot changes, degrees to what the wire carries."""
    return item.command, round(item.x, 7), round(item.y, 7), round(item.z, 2)
