"""Uploading, downloading and clearing, told what a vehicle or a link may do to them."""

from typing import Any

import pytest
from stations import FOREIGN, VEHICLE, Desk, peer_of, rows_for

from faao_mav.wire.machine import Script
from faao_mav.wire.messages import (
    Heartbeat,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    Statustext,
)
from faao_mav.wire.protocol import GROUND_STATION, Address, MavResult, MissionType
from faao_mav.wire.transfer import read_list, send_list

ME = GROUND_STATION
ROWS = rows_for("px4", 9)
CANCEL = MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED)
ARMED = Heartbeat(2, 3, 128, 0, 4)


def request(seq: int, *, target: Address = ME, part: int = 0) -> Any:
    return MissionRequestInt(target, part, seq)


def ack(result: MavResult, *, target: Address = ME, part: int = 0) -> MissionAck:
    return MissionAck(target, part, result)


def item(seq: int, *, target: Address = ME, part: int = 0) -> MissionItemInt:
    return MissionItemInt(target, part, seq, ROWS[seq])


def uploading(firmware: str, count: int = 3, asked: int = 0) -> Desk:
    """Return a desk at which `asked` of `count` items have been asked for."""
    desk = Desk(Script(send_list(ROWS[:count], peer_of(firmware), MissionType.MISSION)))
    desk.start()
    for seq in range(asked):
        desk.tell(request(seq))
    return desk


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_a_vehicle_that_gets_no_further_is_given_up_and_told(firmware: str) -> None:
    """One that stops asking, and one that asks for the same item for ever."""
    for asks in (0.25, 100.0):
        desk = uploading(firmware, asked=1)
        assert [desk.tell(request(0)) for _ in range(200)] == [desk.sent[-1:]] * 200
        while not desk.machine.outcome:
            desk.wait(asks)
            desk.tell(request(0))
            assert desk.now < 200
        assert desk.sent[-1] == CANCEL
        assert (desk.machine.outcome.verdict, desk.machine.outcome.item) == ("silent", 0)


def test_the_last_words_of_a_vehicle_are_told_and_an_unknown_one_is_sent_nothing_unasked() -> None:
    desk = uploading("generic", 9)
    for seq in range(3):
        desk.tell(request(seq))
        assert desk.wait(8.0) == []
    for k in range(7):
        desk.tell(Statustext(4, f"no {k}"))
    desk.tell(ack(MavResult.INVALID))
    desk.wait(2.0)
    assert desk.machine.outcome.said == ("no 2", "no 3", "no 4", "no 5", "no 6")


def test_nothing_more_is_written_once_the_vehicle_is_armed() -> None:
    for requests in (0, 2):
        desk = uploading("px4", asked=requests)
        assert desk.tell(Heartbeat(18, 8, 128, 0, 4), Address(1, 191)) == []  # a companion's flag
        assert desk.tell(ARMED) == [CANCEL]
        assert desk.machine.outcome.verdict == "armed"
        assert desk.tell(request(requests)) == []
        assert desk.wait(60) == []


def test_what_is_said_to_others_or_about_other_lists_is_ignored() -> None:
    """And an acceptance before the last item was asked for, and what was not asked for now."""
    for message, sender in (
        (request(0), FOREIGN),
        (request(0), Address(1, 2)),
        (request(0, target=FOREIGN), VEHICLE),
        (request(0, part=1), VEHICLE),
        (ack(MavResult.INVALID), FOREIGN),
        (ack(MavResult.INVALID, target=FOREIGN), VEHICLE),
        (ack(MavResult.INVALID, part=2), VEHICLE),
        (ack(MavResult.ACCEPTED), VEHICLE),
        (MissionCount(ME, 0, 3), VEHICLE),
        (ARMED, Address(2, 1)),
    ):
        desk = uploading("px4")
        assert desk.tell(message, sender) == []
        desk.wait(0.1)
        assert not desk.machine.outcome
        assert desk.tell(request(0)) != []
    desk = Desk(Script(read_list(peer_of("generic"))))
    desk.start()
    for message in (MissionCount(FOREIGN, 0, 7), MissionCount(ME, 1, 7), item(0)):
        assert desk.tell(message) == []
    assert desk.tell(MissionCount(ME, 0, 7), FOREIGN) == []
    desk.tell(MissionCount(ME, 0, 3))
    for message in (item(0, target=FOREIGN), item(0, part=1), item(2), MissionCount(ME, 0, 3)):
        assert desk.tell(message) == []
    assert desk.tell(item(0)) == [MissionRequestInt(VEHICLE, 0, 1)]
    assert desk.tell(item(0)) == []


def test_either_end_may_give_up() -> None:
    for items in (ROWS, ()):
        for talk in (send_list(items, peer_of("px4")), read_list(peer_of("px4"))):
            desk = Desk(Script(talk))
            desk.start()
            assert desk.machine.cancel(desk.now) == [CANCEL]
            assert desk.machine.cancel(desk.now) == []
    desk = uploading("ardupilot", asked=1)
    desk.tell(ack(MavResult.OPERATION_CANCELLED))
    assert desk.machine.outcome.verdict == "cancelled"


def test_a_download_that_is_always_ended_is_begun_anew_a_few_times() -> None:
    """As when a late request has ended it: PX4 says ERROR, and nothing more."""
    desk = Desk(Script(read_list(peer_of("px4"))))
    assert desk.start() == [MissionRequestList(VEHICLE, 0)]
    for message in (MissionCount(ME, 0, 3), item(0), ack(MavResult.ERROR)):
        desk.tell(message)
    assert MissionRequestList(VEHICLE, 0) in desk.wait(2.5)
    assert desk.tell(item(1)) == []  # late: of the transfer before
    for _ in range(100):
        desk.wait(1.0)
        desk.tell(ack(MavResult.ERROR))
    outcome = desk.machine.outcome
    assert (outcome.verdict, outcome.result) == ("refused", MavResult.ERROR)
