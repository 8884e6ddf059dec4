"""Whatever link or vehicle do: an upload is verified and right, or told as failed, and ends."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from exchanges import EXCHANGES, ITEMS, at_desk, exchanges, played
from hypothesis import given, settings
from hypothesis import strategies as st
from simulate import Station, simulate
from stations import (
    FENCE,
    FOREIGN,
    HOME,
    KINDS,
    RALLY,
    VEHICLE,
    Desk,
    a_mission,
    mock_of,
    peer_of,
    places,
    rows_for,
    upload_to,
    vehicle_of,
)

from faao_mav.sim import COUNT, MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Channel, Faults
from faao_mav.sim.storage import StoredLists
from faao_mav.wire import messages
from faao_mav.wire.jobs import explain, upload_parts
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import Envelope, WireItem
from faao_mav.wire.protocol import GROUND_STATION, MavResult, MissionType
from faao_mav.wire.transfer import TENTATIVE, Peer, read_list, send_list
from faao_mav.wire.wire_items import wire_items

MISSION, FENCES = MissionType.MISSION, MissionType.FENCE
BOTH = pytest.mark.parametrize("kind", KINDS)
REQUEST, MISSION_ACK, COUNT_ID, REQUEST_INT, ITEM_INT = 40, 47, 44, 51, 73

shares = st.floats(0, 0.4)
bad_links = st.builds(
    Faults,
    loss=shares,
    duplication=shares,
    corruption=st.floats(0, 0.1),
    reordering=shares,
    delay=st.floats(0, 2),
    latency=st.floats(0, 0.3),
    outages=st.lists(
        st.tuples(st.floats(0, 20), st.floats(0, 3)).map(lambda t: (t[0], t[0] + t[1])), max_size=2
    ).map(tuple),
    seed=st.integers(0, 2**32),
)


def vehicle_holds(mock: MockAutopilot, rows: Sequence[WireItem]) -> bool:
    """Tell whether the mission of the vehicle is `rows`, by its own storage."""
    return places(mock.lists.items(MISSION)) == places(rows)


@settings(max_examples=60)
@given(st.sampled_from(KINDS), st.integers(1, 8), bad_links, st.booleans())
def test_no_wrong_mission_is_ever_called_verified(
    kind: MockKind, count: int, faults: Faults, occupied: bool
) -> None:
    """Nor one that was to be cleared and is still there."""
    mock, rows = mock_of(kind), rows_for(kind, count) if count > 1 else ()
    if occupied:
        mock.lists.replace(MISSION, rows_for(kind, 7, shift=0.1))
    report, took = upload_to(mock, rows, faults, until=1000.0)
    assert report is not None, "it does not end"
    assert took < 600
    if report.verified:
        assert vehicle_holds(mock, rows)
    assert not [d for d in report.differences if d.kind == "wrong"]


@BOTH
def test_what_a_link_does_is_overcome(kind: MockKind) -> None:
    """Loss; late packets and copies of them; and being dead for 3 s, but not for a minute."""
    late = Faults(duplication=0.05, reordering=0.1, delay=0.3)
    lossy = (Faults(loss=x, latency=0.03, seed=n) for x in (0.05, 0.3, 0.4) for n in range(3))
    for faults in (*lossy, *(replace(late, seed=seed) for seed in range(3))):
        mock = mock_of(kind)
        rows = rows_for(kind, 12 if faults.loss else 30)
        for sent in (rows, ()):
            report, took = upload_to(mock, sent, faults)
            assert report.verified, faults
            assert vehicle_holds(mock, sent)
            assert took < 60 or faults.loss
    for begin, seconds, course in (
        *((begin, 3.0, ("verified", 1)) for begin in (0.0, 0.05, 0.2, 0.5)),
        (0.2, 90.0, ("silent", 3)),
    ):
        faults = Faults(latency=0.01, outages=((begin, begin + seconds),))
        report, _ = upload_to(mock_of(kind), rows_for(kind, 30), faults)
        assert (report.verdict, report.attempts) == course
    # Any one packet, the last acknowledgement too, which PX4 repeats and ArduPilot does not.
    asks = [(ask, number) for ask in (REQUEST, REQUEST_INT) for number in range(1, 5)]
    for lost in (*asks, (ITEM_INT, 4), (COUNT_ID, 1), (MISSION_ACK, 1)):
        report, took = upload_to(mock_of(kind), rows_for(kind, 4), lost=lost)
        assert (report.verified, report.attempts, report.result or 0) == (True, 1, 0), lost
        assert took < 2


@BOTH
@pytest.mark.parametrize(
    ("faults", "telemetry", "seconds", "up", "back"),
    [
        (Faults(loss=0.05), 0.0, 3.0, 1.3, 1.3),
        (Faults(loss=0.2), 0.0, 8.0, 2.0, 2.0),
        # 20 reports a second take two thirds of what this line can carry.
        (Faults(latency=0.03, rate=2500.0), 20.0, 25.0, 1.3, 1.3),
        (Faults(latency=0.15, reordering=1.0, delay=0.1, seed=1), 0.0, 90.0, 1.2, 1.7),
        # PX4 asks again after 0.25 s, ArduPilot after 1 s, and is answered each time.
        (Faults(latency=0.5), 0.0, 220.0, 2.1, 1.2),
        (Faults(latency=0.1, rate=960.0, loss=0.1, seed=1), 0.0, 80.0, 1.7, 1.4),  # 9600 baud
    ],
    ids=["5 % lost", "20 % lost", "reports", "disorder", "slow", "narrow"],
)
def test_a_quick_link_is_quick_and_a_slow_one_is_not_flooded(
    kind: MockKind, faults: Faults, telemetry: float, seconds: float, up: float, back: float
) -> None:
    """`up` and `back`: messages of this end to upload and to read, by what there is to say."""
    mock, peer = MockAutopilot(behaviour_of(kind), home=HOME, rate=telemetry), peer_of(kind)
    mock.tick(0.0)
    for talk, most in ((send_list(rows_for(kind, 100)[:100], peer), up), (read_list(peer), back)):
        client, passed = Script(talk), Counter[tuple[int, int, int]]()
        stations = Station(client, GROUND_STATION), Station(mock, VEHICLE)
        seconds -= simulate(*stations, faults, until=2000.0, passed=passed)
        assert client.outcome is not None
        assert client.outcome.verdict in ("accepted", "unknown")
        asked = passed[1, 0, REQUEST] + passed[1, 0, REQUEST_INT]
        assert passed[0, 1, ITEM_INT] + passed[0, 1, REQUEST_INT] <= most * max(asked, 100)
    assert seconds > 0


@BOTH
def test_refusals_of_every_kind_are_reported(kind: MockKind) -> None:
    cancelled = MavResult.OPERATION_CANCELLED
    for result in sorted(set(MavResult) - {MavResult.ACCEPTED, MavResult.INVALID_SEQUENCE}):
        for seq in (COUNT, 3, 5):
            mock = mock_of(behaviour_of(kind, refusals={(MISSION, seq): result}))
            report, took = upload_to(mock, rows_for(kind, 6)[:6])
            verdict = "cancelled" if result == cancelled else "refused"
            assert (report.verdict, report.result) == (verdict, result)
            if result not in (*TENTATIVE, cancelled):
                assert report.attempts == 1
                assert report.item == (None if seq == COUNT else seq)
            elif (result, seq) == (MavResult.DENIED, COUNT):
                assert took < 10
                told = explain(report, peer_of("ardupilot"))
                assert told == "mission: refused: DENIED (another ground station is uploading)"
    for seed in range(5):  # the item is named whatever is lost
        mock = mock_of(behaviour_of(kind, refusals={(MISSION, 6): MavResult.INVALID_PARAM2}))
        report, _ = upload_to(mock, rows_for(kind, 12)[:12], Faults(loss=0.3, seed=seed))
        assert not report.verified
        assert report.item == 6 or report.result != MavResult.INVALID_PARAM2


@BOTH
def test_another_ground_station_uploads_something_else_at_the_same_time(kind: MockKind) -> None:
    """One of the two is refused, or both come in turn: nobody is told a wrong thing."""
    for head_start in range(2):
        mock = mock_of(kind)
        ours, theirs = rows_for(kind, 8), rows_for(kind, 9, shift=0.1)
        rival = Script(send_list(theirs, Peer(FOREIGN, VEHICLE, vehicle_of(kind))))
        faults = Faults(latency=0.004 * (1 + head_start), reordering=0.5, delay=0.05)
        report, _ = upload_to(mock, ours, faults, others=[Station(rival, FOREIGN)])
        if report.verified:
            assert vehicle_holds(mock, ours)
        else:
            assert report.verdict in ("refused", "different", "unread")


def test_a_late_copy_of_an_announcement_ends_no_download() -> None:
    """ArduPilot waits 8 s for items then, refuses downloads meanwhile, and says it has given up."""
    rows = wire_items(a_mission(6, fence=FENCE), FENCES, vehicle_of("ardupilot"))
    copy = Envelope(GROUND_STATION, messages.MissionCount(VEHICLE, FENCES, len(rows)))
    mock = mock_of("ardupilot")
    mock.lists.replace(FENCES, rows)
    script: Any = Script(read_list(peer_of("ardupilot"), FENCES))
    stations = Station(script, GROUND_STATION), Station(mock, VEHICLE)
    events = [(0.15, lambda now: mock.on(copy, now))]
    took = simulate(*stations, Faults(latency=0.05), events=events)
    assert (script.outcome.verdict, script.outcome.found) == ("accepted", rows)
    assert took < 20


def test_what_a_vehicle_stores_otherwise_is_found_out_and_sent_again() -> None:
    """A real ArduPilot reads back an empty fence after about one of twelve uploads."""

    class Loses(StoredLists):
        times = 2

        def replace(self, part: MissionType, items: Iterable[WireItem]) -> None:
            self.times -= 1
            super().replace(part, items if self.times < 0 else ())

    class Forgetful(StoredLists):
        def kept(self, part: MissionType, seq: int, row: WireItem) -> WireItem:
            kept = super().kept(part, seq, row)
            return super().kept(part, seq, rows_for("px4", 8)[3]) if seq == 5 else kept

    mock, mission = mock_of("ardupilot"), a_mission(6, fence=FENCE)
    mock.lists.__class__ = Loses
    report, _ = upload_to(mock, wire_items(mission, FENCES, vehicle_of("ardupilot")), part=FENCES)
    assert (report.verified, report.attempts) == (True, 3)
    mock = mock_of("px4")
    mock.lists.__class__ = Forgetful
    report, _ = upload_to(mock, rows_for("px4", 8))
    assert report.verdict == "different"
    assert {d.item for d in report.differences} == {6}


def test_an_armed_vehicle_gets_no_fence_after_its_mission_and_that_ends_the_upload() -> None:
    mock, mission = mock_of("px4", beat=0.01), a_mission(6, fence=FENCE, rally=RALLY)
    parts = [(part, wire_items(mission, part, vehicle_of("px4"))) for part in MissionType]
    script: Any = Script(upload_parts(parts, peer_of("px4")))

    def arm(envelope: Envelope, _: float) -> None:
        if isinstance(envelope.message, messages.MissionCount):  # while it is read back
            mock.flight.arm(0.0)

    faults = Faults(latency=0.02)
    simulate(Station(script, GROUND_STATION), Station(mock, VEHICLE), faults, heard=arm)
    assert [report.verdict for report in script.outcome] == ["verified", "armed"]
    assert mock.lists.items(FENCES) == ()


def test_what_a_channel_does() -> None:
    assert Channel(Faults(latency=0.5), "x").carry(b"abc", 1.0) == [(1.5, b"abc")]
    assert Channel(Faults(loss=1.0), "x").carry(b"abc", 1.0) == []
    assert Channel(Faults(outages=((0.5, 1.5),)), "x").carry(b"abc", 1.0) == []
    assert len(Channel(Faults(duplication=1.0), "x").carry(b"abc", 1.0)) == 2
    ((_, damaged),) = Channel(Faults(corruption=1.0), "x").carry(b"abc", 1.0)
    assert sum((a ^ b).bit_count() for a, b in zip(damaged, b"abc", strict=True)) == 1
    ((late, _),) = Channel(Faults(reordering=1.0, delay=2.0), "x").carry(b"abc", 1.0)
    assert 1.0 < late <= 3.1
    channel = Channel(Faults(rate=10.0, latency=0.5), "x")
    assert [channel.carry(b"abc", now)[0][0] for now in (1.0, 1.1, 9.0)] == [1.8, 2.1, 9.8]


# ---- what it says by hand

BY_HAND = exchanges((EXCHANGES / "client.txt").read_text())
SENT = [ITEMS[name] for name in ("way", "other", *["way"] * 7)]


def client(job: str, firmware: str, count: str = "0") -> Desk:
    """Return a desk with the client, which is to read a list or to upload so many items."""
    peer = peer_of(firmware)
    return Desk(Script(read_list(peer) if job == "read" else send_list(SENT[: int(count)], peer)))


@pytest.mark.parametrize("name", BY_HAND)
def test_what_the_client_answers(name: str) -> None:
    tell = at_desk(client(*name.partition(":")[0].split()), GROUND_STATION)
    assert played(BY_HAND[name], tell, ">") == BY_HAND[name]


@BOTH
def test_a_vehicle_that_asks_for_one_item_for_ever_is_given_up(kind: str) -> None:
    desk = client("upload", kind, "3")
    tell = at_desk(desk, GROUND_STATION)
    tell("begin", 1)
    for wait in (*["~ 0"] * 200, *["~ 0.25"] * 800):
        tell("< request mission 0", 1)
        if desk.machine.outcome is None:
            tell(wait, 0)
    assert desk.sent[-1] == messages.MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED)
    tell("= silent at 0, no result", 0)


def test_a_download_that_is_always_ended_is_begun_anew_a_few_times() -> None:
    """As when a late request has ended it: PX4 says ERROR, and nothing more."""
    desk = client("read", "px4")
    tell = at_desk(desk, GROUND_STATION)
    for line in ("begin", "< count mission 3", "< item mission 0 way", "< ack mission ERROR"):
        tell(line, 1)
    assert messages.MissionRequestList(VEHICLE, 0) in tell("~ 2.5", 1)
    assert tell("< item mission 1 way", 0) == []  # late: of the transfer before
    for line in ("~ 1", "< ack mission ERROR") * 100:
        tell(line, 0)
    tell("= refused at None, ERROR", 0)
