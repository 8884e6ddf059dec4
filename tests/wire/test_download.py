"""The downloading and the clearing client."""

from typing import Any

import pytest
from stations import FOREIGN, VEHICLE, Desk, peer_of, rows_for

from faao_mav.wire.messages import (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
)
from faao_mav.wire.protocol import GROUND_STATION, Address, MavResult, MissionType
from faao_mav.wire.transfer.download import Download
from faao_mav.wire.transfer.exchange import Clear
from faao_mav.wire.transfer.pace import Pace, Timeouts

ME = GROUND_STATION
ROWS = rows_for("px4", 3)
MANY = rows_for("ardupilot", 12)[:12]


def desk_for(firmware: str = "generic", **timeouts: Any) -> Desk:
    desk = Desk(Download(peer_of(firmware), timeouts=Timeouts(**timeouts)))
    desk.start()
    return desk


def item(seq: int, *, target: Address = ME, mission_type: int = 0) -> MissionItemInt:
    return MissionItemInt(target, mission_type, seq, ROWS[seq])


def wants(seq: int, *, legacy: bool = False) -> MissionRequestInt:
    return MissionRequestInt(VEHICLE, 0, seq, legacy)


def test_a_whole_download() -> None:
    desk = desk_for()
    assert desk.sent == [MissionRequestList(VEHICLE, 0)]
    assert desk.tell(MissionCount(ME, 0, 3, 99)) == [wants(0)]
    assert desk.tell(item(0)) == [wants(1)]
    assert desk.tell(item(1)) == [wants(2)]
    assert desk.tell(item(2)) == [MissionAck(VEHICLE, 0, MavResult.ACCEPTED)]
    assert desk.machine.outcome.items == ROWS
    assert desk.machine.outcome.opaque_id == 99


def test_an_empty_list_is_acknowledged_too() -> None:
    desk = desk_for()
    assert desk.tell(MissionCount(ME, 0, 0)) == [MissionAck(VEHICLE, 0, MavResult.ACCEPTED)]
    assert (desk.machine.outcome.status, desk.machine.outcome.items) == ("accepted", ())


def test_px4_is_told_of_the_end_twice() -> None:
    desk = desk_for("px4")
    assert desk.tell(MissionCount(ME, 0, 0)) == [MissionAck(VEHICLE, 0, MavResult.ACCEPTED)] * 2


def test_the_list_is_asked_for_again_and_given_up() -> None:
    desk = desk_for()
    assert desk.wait(3.1) == [MissionRequestList(VEHICLE, 0)] * 2
    desk.wait(120)
    attempts = Timeouts().attempts
    assert desk.sent.count(MissionRequestList(VEHICLE, 0)) == 6 * attempts
    assert desk.machine.outcome.status == "silent"


def test_on_a_quick_link_the_list_is_asked_for_again_soon() -> None:
    """A pace that an upload has measured: the first repetitions need not wait for the guide's."""
    before = Pace(Timeouts())
    before.answer(before.ask(0.0), 0.01)
    desk = Desk(Download(peer_of("px4"), before=before))
    desk.start()
    assert desk.wait(0.39) == []
    assert desk.wait(0.9) == [MissionRequestList(VEHICLE, 0)] * 3
    assert desk.wait(1.4) == []
    assert desk.wait(60.0)[0] == MissionRequestList(VEHICLE, 0)


@pytest.mark.parametrize("seq", [0, 1])
def test_an_item_is_asked_for_again(seq: int) -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 3))
    for before in range(seq):
        desk.wait(0.1)
        desk.tell(item(before))
    desk.wait(0.2)
    assert set(desk.wait(0.4)) == {wants(seq)}
    assert desk.tell(item(seq)) == [wants(seq + 1)]


def test_questions_come_less_often_the_longer_none_is_answered() -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 3))
    assert len(desk.wait(0.26)) == 1
    assert len(desk.wait(0.5)) == 1
    assert len(desk.wait(6.0)) == 4


def test_a_slow_link_is_not_flooded_once_it_is_known() -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 3))
    desk.wait(0.24)
    desk.tell(item(0))
    assert desk.wait(0.4) == []


def test_duplicates_and_items_ahead_are_ignored() -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 3))
    desk.tell(item(0))
    assert desk.tell(item(0)) == []
    assert desk.tell(item(2)) == []
    assert desk.tell(MissionCount(ME, 0, 3)) == []
    desk.tell(item(1))
    desk.tell(item(2))
    assert desk.machine.outcome.items == ROWS


def test_what_is_for_others_is_ignored() -> None:
    desk = desk_for()
    assert desk.tell(MissionCount(FOREIGN, 0, 7)) == []
    assert desk.tell(MissionCount(ME, 1, 7)) == []
    assert desk.tell(MissionCount(ME, 0, 7), FOREIGN) == []
    desk.tell(MissionCount(ME, 0, 3))
    assert desk.tell(item(0, target=FOREIGN)) == []
    assert desk.tell(item(0, mission_type=1)) == []
    assert desk.tell(item(0)) == [wants(1)]


def test_a_list_that_changes_meanwhile_is_read_anew() -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 2))
    desk.tell(item(0))
    assert desk.tell(MissionCount(ME, 0, 3)) == [MissionRequestList(VEHICLE, 0)]
    desk.tell(MissionCount(ME, 0, 3))
    for seq in range(3):
        desk.tell(item(seq))
    assert desk.machine.outcome.items == ROWS


def wide_desk() -> Desk:
    """Return a desk at which ArduPilot has given row 0, and has been asked for five more."""
    desk = desk_for("ardupilot")
    assert desk.tell(MissionCount(ME, 0, 12)) == [wants(0)]
    desk.wait(0.1)
    assert desk.tell(row(0)) == [wants(seq) for seq in (1, 2, 3, 4, 5)]
    return desk


def row(seq: int) -> MissionItemInt:
    return MissionItemInt(ME, 0, seq, MANY[seq])


def test_ardupilot_is_asked_for_five_rows_at_once() -> None:
    desk = wide_desk()
    for seq in range(1, 7):
        assert desk.tell(row(seq)) == [wants(seq + 5)]
    for seq in range(7, 11):
        assert desk.tell(row(seq)) == []
    assert desk.tell(row(11)) == [MissionAck(VEHICLE, 0, MavResult.ACCEPTED)]
    assert desk.machine.outcome.items == MANY


def test_px4_is_asked_for_one_row_after_the_other() -> None:
    desk = desk_for("px4")
    desk.tell(MissionCount(ME, 0, 3))
    for seq in range(2):
        desk.wait(0.1)
        assert desk.tell(item(seq)) == [wants(seq + 1)]


def test_a_row_is_asked_for_again_when_a_later_one_has_come() -> None:
    desk = wide_desk()
    assert desk.tell(row(3)) == [wants(1), wants(2), wants(6)]
    # Answers to requests that were made before those say nothing more.
    assert desk.tell(row(4)) == [wants(7)]
    for seq in (2, 1, 5, 6, 7, 8, 9, 10, 11):
        desk.tell(row(seq))
    assert desk.machine.outcome.items == MANY


def test_it_is_not_on_a_link_that_changes_the_order() -> None:
    desk = wide_desk()
    assert desk.tell(row(3)) == [wants(1), wants(2), wants(6)]
    desk.tell(row(1))
    desk.tell(row(2))
    desk.tell(row(1))  # twice: the first was on its way
    assert desk.tell(row(6)) == [wants(9)]


def test_what_is_due_of_five_is_asked_for_again_and_less_often() -> None:
    desk = wide_desk()
    five = [wants(seq) for seq in (1, 2, 3, 4, 5)]
    assert desk.wait(0.29) == []
    assert desk.wait(0.02) == five
    assert desk.wait(0.3) == five
    assert desk.wait(0.59) == []
    assert desk.wait(0.02) == five


def test_a_link_that_is_not_known_is_asked_for_one_row() -> None:
    desk = desk_for("ardupilot")
    desk.tell(MissionCount(ME, 0, 12))
    desk.wait(0.3)  # asked for again: the answer measures nothing
    assert desk.tell(row(0)) == [wants(1)]
    desk.wait(0.1)
    assert len(desk.tell(row(1))) == 5


def test_one_refusal_of_five_requests_is_one() -> None:
    desk = wide_desk()
    for _ in range(5):
        assert desk.tell(MissionAck(ME, 0, MavResult.INVALID)) == []
    assert desk.wait(0.5) == [MissionRequestList(VEHICLE, 0)]


def test_unsupported_changes_to_the_old_request() -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 3))
    assert desk.tell(MissionAck(ME, 0, MavResult.UNSUPPORTED)) == [wants(0, legacy=True)]
    assert desk.tell(item(0)) == [wants(1, legacy=True)]


@pytest.mark.parametrize("result", [MavResult.INVALID, MavResult.UNSUPPORTED])
def test_a_refusal_that_is_repeated_is_final(result: MavResult) -> None:
    desk = desk_for()
    for _ in range(Timeouts().attempts):
        assert not desk.machine.outcome
        desk.tell(MissionAck(ME, 0, result))
        desk.wait(0.5)
    assert (desk.machine.outcome.status, desk.machine.outcome.result) == ("refused", result)


@pytest.mark.parametrize("result", [MavResult.DENIED, MavResult.ERROR])
def test_what_may_be_about_a_late_packet_is_final_when_nothing_else_is_said(
    result: MavResult,
) -> None:
    desk = desk_for()
    for _ in range(Timeouts().attempts * (Timeouts().retries + 1)):
        assert not desk.machine.outcome
        desk.tell(MissionAck(ME, 0, result))
        desk.wait(Timeouts().response)
    assert (desk.machine.outcome.status, desk.machine.outcome.result) == ("refused", result)


@pytest.mark.parametrize("result", [MavResult.DENIED, MavResult.ERROR])
def test_an_answer_to_a_late_packet_of_an_upload_ends_nothing(result: MavResult) -> None:
    desk = desk_for()
    desk.tell(MissionAck(ME, 0, result))
    assert desk.tell(MissionCount(ME, 0, 3)) == [wants(0)]
    for seq in range(3):
        assert desk.tell(MissionAck(ME, 0, result)) == []
        desk.tell(item(seq))
    assert desk.machine.outcome.status == "accepted"


def test_after_an_abort_it_waits_for_what_is_late_and_then_asks_less_often() -> None:
    desk = desk_for("px4")
    for _ in range(2):
        assert desk.tell(MissionCount(ME, 0, 3)) == [wants(0)]
        desk.tell(item(0))
        desk.tell(MissionAck(ME, 0, MavResult.ERROR))
        sent = desk.wait(1.0)  # in vain: it has forgotten the transfer
        assert sent == [wants(1), wants(1), MissionRequestList(VEHICLE, 0)]
        assert desk.tell(item(1)) == []  # late: of the transfer before
    desk.tell(MissionCount(ME, 0, 3))
    assert desk.wait(0.39) == []
    assert desk.wait(0.02) == [wants(0)]
    assert desk.tell(item(0)) == []  # one of the two may still come
    assert desk.tell(item(0)) == [wants(1)]  # both have come
    assert desk.tell(item(1)) == [wants(2)]


def test_a_vehicle_that_falls_silent_is_asked_from_the_beginning() -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 3))
    desk.tell(item(0))
    assert MissionRequestList(VEHICLE, 0) in desk.wait(11)


def test_who_gives_up_tells_the_vehicle() -> None:
    desk = desk_for()
    desk.tell(MissionCount(ME, 0, 3))
    assert desk.machine.cancel(desk.now) == [MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED)]
    assert desk.machine.outcome.status == "cancelled"


def clearing(part: MissionType = MissionType.FENCE) -> Desk:
    desk = Desk(Clear(peer_of("ardupilot"), part))
    desk.start()
    return desk


def test_clearing() -> None:
    desk = clearing()
    assert desk.sent == [MissionClearAll(VEHICLE, 1)]
    desk.tell(MissionAck(ME, 0, MavResult.ACCEPTED))
    assert not desk.machine.outcome
    desk.tell(MissionAck(ME, 1, MavResult.ACCEPTED))
    assert desk.machine.outcome.status == "accepted"


def test_clearing_is_repeated_then_given_up() -> None:
    desk = clearing()
    desk.wait(60)
    assert desk.sent == [MissionClearAll(VEHICLE, 1)] * 6
    assert desk.machine.outcome.status == "silent"


def test_clearing_may_be_refused() -> None:
    desk = clearing()
    desk.tell(MissionAck(ME, 1, MavResult.DENIED))
    assert desk.machine.outcome.status == "refused"
    desk = clearing()
    desk.tell(MissionAck(ME, 1, MavResult.ERROR))
    assert not desk.machine.outcome
    desk.wait(1.6)
    desk.tell(MissionAck(ME, 1, MavResult.ERROR))
    assert desk.machine.outcome.status == "refused"
