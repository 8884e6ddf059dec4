"""The uploading client, told everything that a vehicle or a link may do to it."""

from collections.abc import Sequence
from typing import Any

import pytest
from stations import FOREIGN, VEHICLE, Desk, peer_of, rows_for

from faao_mav.errors import InputError
from faao_mav.wire.messages import (
    Heartbeat,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    Statustext,
    WireItem,
)
from faao_mav.wire.protocol import (
    GROUND_STATION,
    Address,
    MavResult,
    MissionType,
)
from faao_mav.wire.transfer.exchange import TENTATIVE
from faao_mav.wire.transfer.upload import Upload

ME = GROUND_STATION
ROWS = rows_for("px4", 3)
BOTH = pytest.mark.parametrize("firmware", ["ardupilot", "px4"])


def request(
    seq: int, *, legacy: bool = False, target: Address = ME, mission_type: int = 0
) -> MissionRequestInt:
    return MissionRequestInt(target, mission_type, seq, legacy)


def ack(
    result: MavResult, *, target: Address = ME, mission_type: int = 0, opaque_id: int = 0
) -> MissionAck:
    return MissionAck(target, mission_type, result, opaque_id)


def desk_for(
    firmware: str, rows: Sequence[WireItem] = ROWS, part: MissionType = MissionType.MISSION
) -> Desk:
    desk = Desk(Upload(rows, peer_of(firmware), part))
    desk.start()
    return desk


def asked_for_all(firmware: str) -> Desk:
    desk = desk_for(firmware)
    for seq in range(3):
        desk.tell(request(seq))
    return desk


@BOTH
def test_a_whole_upload(firmware: str) -> None:
    desk = desk_for(firmware)
    assert desk.sent == [MissionCount(VEHICLE, 0, 3)]
    for seq in range(3):
        assert desk.tell(request(seq)) == [MissionItemInt(VEHICLE, 0, seq, ROWS[seq])]
    desk.tell(ack(MavResult.ACCEPTED, opaque_id=77))
    assert desk.machine.outcome.status == "accepted"
    assert desk.machine.outcome.opaque_id == 77
    assert desk.machine.deadline is None


def test_an_empty_list_is_not_uploaded() -> None:
    with pytest.raises(InputError, match="clear the list instead"):
        Upload((), peer_of("px4"))


@BOTH
def test_both_requests_are_answered_with_the_precise_item(firmware: str) -> None:
    desk = desk_for(firmware)
    (item,) = desk.tell(request(0, legacy=True))
    assert isinstance(item, MissionItemInt)
    assert not item.legacy


@BOTH
def test_any_row_is_sent_as_often_as_asked_for_in_any_order(firmware: str) -> None:
    desk = desk_for(firmware)
    for seq in (0, 0, 2, 1, 1, 0, 2):
        assert desk.tell(request(seq)) == [MissionItemInt(VEHICLE, 0, seq, ROWS[seq])]
    assert desk.tell(request(3)) == []


@pytest.mark.parametrize(("firmware", "early"), [("ardupilot", 0), ("px4", 3)])
def test_the_count_is_repeated_then_given_up(firmware: str, early: int) -> None:
    """Again after 1.5 s, and sooner where the vehicle would have asked twice by then."""
    desk = desk_for(firmware)
    for wait in [0.5] * early + [1.5]:
        assert desk.wait(wait - 0.01) == []
        assert desk.wait(0.01) == [MissionCount(VEHICLE, 0, 3)]
    assert desk.wait(1.49) == []
    desk.wait(60)
    assert desk.sent == [MissionCount(VEHICLE, 0, 3)] * (6 + early)
    assert desk.machine.outcome.status == "silent"


def test_a_slow_vehicle_is_no_silent_one() -> None:
    desk = desk_for("px4")
    for seq in range(3):
        desk.wait(0.8 * 1.5)
        desk.tell(request(seq))
    desk.wait(0.8 * 1.5)
    desk.tell(ack(MavResult.ACCEPTED))
    assert desk.machine.outcome.status == "accepted"
    assert desk.sent.count(MissionCount(VEHICLE, 0, 3)) == 3


@BOTH
def test_a_vehicle_that_stops_asking_is_silent_and_is_told(firmware: str) -> None:
    desk = desk_for(firmware)
    desk.tell(request(0))
    desk.wait(8.9)
    assert not desk.machine.outcome
    sent = desk.wait(2.0)
    assert sent[-1] == MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED)
    assert desk.machine.outcome.status == "silent"
    assert desk.machine.outcome.last_requested == 0


def seqs(messages: Sequence[Any]) -> list[int]:
    return [message.seq for message in messages]


def test_px4_is_sent_the_next_item_and_the_same_again_it_takes_one_of_them() -> None:
    desk = desk_for("px4", rows_for("px4", 9))
    desk.tell(request(0))
    assert seqs(desk.wait(0.3)) == [1, 0]
    assert seqs(desk.wait(0.5)) == [2, 1, 0]
    assert seqs(desk.wait(1.0)) == [3, 2, 1, 0]
    assert seqs(desk.wait(1.5)) == [3, 2, 1, 0]
    assert seqs(desk.tell(request(2))) == [2]


def test_px4_is_never_sent_the_last_item_before_it_asks() -> None:
    desk = desk_for("px4", rows_for("px4", 4))
    desk.tell(request(1))
    assert seqs(desk.wait(0.8)) == [2, 1, 2, 1]
    desk.tell(request(2))
    assert seqs(desk.wait(1.1)) == [2]
    desk.tell(ack(MavResult.ACCEPTED))
    assert not desk.machine.outcome


def test_what_px4_has_taken_unasked_is_sent() -> None:
    desk = desk_for("px4", rows_for("px4", 5))
    desk.tell(request(0))
    desk.wait(0.3)
    for seq in (2, 3, 4):  # the request for item 1 was lost
        desk.tell(request(seq))
    desk.tell(ack(MavResult.ACCEPTED))
    assert desk.machine.outcome.status == "accepted"
    assert desk.machine.progress == ("uploading mission", 5, 5)


def test_an_unknown_autopilot_is_sent_nothing_unasked() -> None:
    desk = desk_for("generic", rows_for("px4", 9))
    for seq in range(3):
        desk.tell(request(seq))
        assert desk.wait(8.0) == []


@pytest.mark.parametrize("result", [MavResult.INVALID_PARAM1, MavResult.ERROR])
def test_which_item_px4_refuses_is_found_out(result: MavResult) -> None:
    desk = desk_for("px4", rows_for("px4", 9))
    desk.tell(request(0))
    desk.wait(0.3)
    desk.tell(ack(result))  # of item 0, or of item 1
    assert MissionCount(VEHICLE, 0, 9) in desk.wait(1.6)
    desk.tell(request(0))
    desk.tell(request(1))
    assert set(seqs(desk.wait(0.6))) == {1}
    desk.tell(ack(result))
    desk.wait(1.6)
    outcome = desk.machine.outcome
    assert (outcome.status, outcome.result, outcome.last_requested) == ("refused", result, 1)


def test_ardupilot_is_sent_an_item_again_and_the_next_when_it_has_that() -> None:
    desk = desk_for("ardupilot", rows_for("ardupilot", 5))
    desk.tell(request(0))
    again = desk.wait(0.3)
    assert [message.seq for message in again] == [0]
    (following,) = desk.tell(ack(MavResult.INVALID_SEQUENCE))
    assert following.seq == 1
    # Said again, of the same repetition, it is no news.
    assert desk.tell(ack(MavResult.INVALID_SEQUENCE)) == []


@pytest.mark.parametrize(("count", "ahead"), [(9, [2, 3, 4]), (4, [2])])
def test_ardupilot_is_sent_three_items_ahead_and_not_the_last_one(
    count: int, ahead: list[int]
) -> None:
    desk = desk_for("ardupilot", rows_for("ardupilot", 9)[:count])
    desk.tell(request(1))
    sent: list[int] = []
    for _ in range(5):
        desk.wait(1.6)
        sent += seqs(desk.tell(ack(MavResult.INVALID_SEQUENCE)))
    assert sent == ahead
    assert set(seqs(desk.wait(1.6))) == {ahead[-1]}


def test_invalid_sequence_from_ardupilot_ends_nothing() -> None:
    desk = asked_for_all("ardupilot")
    desk.tell(ack(MavResult.INVALID_SEQUENCE))
    assert not desk.machine.outcome
    desk.tell(ack(MavResult.ACCEPTED))
    assert desk.machine.outcome.status == "accepted"


def test_a_lost_last_answer_of_px4_is_asked_for_by_the_last_item() -> None:
    desk = asked_for_all("px4")
    assert desk.wait(0.3) == [MissionItemInt(VEHICLE, 0, 2, ROWS[2])]
    desk.tell(ack(MavResult.ACCEPTED))
    assert desk.machine.outcome.status == "accepted"


def test_without_any_last_answer_of_px4_it_is_unknown_what_it_holds() -> None:
    desk = asked_for_all("px4")
    assert desk.wait(60) == [MissionItemInt(VEHICLE, 0, 2, ROWS[2])] * 5
    assert desk.machine.outcome.status == "unknown"


def test_ardupilot_is_never_sent_the_last_item_unasked() -> None:
    desk = asked_for_all("ardupilot")
    assert desk.wait(60) == [MissionItemInt(VEHICLE, 0, 1, ROWS[1])] * 5
    assert desk.machine.outcome.status == "unknown"


def test_ardupilot_tells_by_the_item_before_whether_it_waits_for_the_last() -> None:
    desk = asked_for_all("ardupilot")
    assert desk.tell(ack(MavResult.INVALID_SEQUENCE)) == []  # of something earlier
    assert desk.wait(0.3) == [MissionItemInt(VEHICLE, 0, 1, ROWS[1])]
    assert desk.tell(ack(MavResult.INVALID_SEQUENCE)) == [MissionItemInt(VEHICLE, 0, 2, ROWS[2])]
    assert desk.wait(0.6) == [MissionItemInt(VEHICLE, 0, 1, ROWS[1])]
    desk.tell(ack(MavResult.ERROR))
    desk.wait(0.6)
    outcome = desk.machine.outcome
    assert (outcome.status, outcome.result) == ("unknown", MavResult.ERROR)


def test_of_a_single_item_there_is_none_before() -> None:
    desk = desk_for("ardupilot", rows_for("ardupilot", 2)[:1])
    desk.tell(request(0))
    assert desk.wait(60) == []
    assert desk.machine.outcome.status == "unknown"


def test_an_error_after_everything_was_sent_leaves_it_to_reading_back() -> None:
    # ArduPilot says it of a duplicate of the last item; ACCEPTED may have been lost before.
    desk = asked_for_all("ardupilot")
    desk.tell(ack(MavResult.ERROR))
    desk.wait(3)
    assert desk.machine.outcome.status == "unknown"
    assert desk.machine.outcome.result == MavResult.ERROR


def test_an_early_acceptance_is_about_something_else() -> None:
    desk = desk_for("px4")
    desk.tell(ack(MavResult.ACCEPTED))
    desk.tell(request(0))
    desk.tell(ack(MavResult.ACCEPTED))
    assert not desk.machine.outcome


FINAL = sorted(
    set(MavResult)
    - {
        MavResult.ACCEPTED,
        MavResult.INVALID_SEQUENCE,
        MavResult.OPERATION_CANCELLED,
        *TENTATIVE,
    }
)


@BOTH
@pytest.mark.parametrize("result", FINAL)
@pytest.mark.parametrize("requests", [0, 1, 3])
def test_a_refusal_is_final_at_any_moment(firmware: str, result: MavResult, requests: int) -> None:
    desk = desk_for(firmware)
    for seq in range(requests):
        desk.tell(request(seq))
    desk.tell(ack(result))
    desk.tell(Statustext(4, "because"))
    assert desk.tell(request(0)) == []
    desk.wait(2.0)
    outcome = desk.machine.outcome
    assert (outcome.status, outcome.result, outcome.said) == ("refused", result, ("because",))
    assert outcome.last_requested == (requests - 1 if requests else None)
    assert desk.tell(request(0)) == []


def test_an_error_is_final_when_nothing_more_is_asked_for() -> None:
    desk = desk_for("px4")
    desk.tell(request(0))
    desk.tell(ack(MavResult.ERROR))
    desk.wait(1.6)
    assert desk.machine.outcome.status == "refused"


def test_an_error_about_a_duplicate_count_does_not_end_the_transfer() -> None:
    desk = desk_for("px4")
    desk.tell(request(0))
    desk.tell(ack(MavResult.ERROR))
    desk.wait(0.2)
    desk.tell(request(1))
    desk.wait(5)
    assert not desk.machine.outcome


def test_a_busy_px4_is_asked_again_until_it_is_free() -> None:
    desk = desk_for("px4")
    for _ in range(3):
        desk.tell(ack(MavResult.ERROR))
        assert desk.wait(1.5) == [MissionCount(VEHICLE, 0, 3)]
    assert desk.tell(request(0)) == [MissionItemInt(VEHICLE, 0, 0, ROWS[0])]


def test_a_px4_that_stays_busy_has_refused() -> None:
    desk = desk_for("px4")
    desk.tell(ack(MavResult.ERROR))
    desk.wait(60)
    assert (desk.machine.outcome.status, desk.machine.outcome.result) == (
        "refused",
        MavResult.ERROR,
    )


def test_no_space_while_booting_means_not_yet() -> None:
    desk = desk_for("ardupilot")
    desk.tell(Heartbeat(2, 3, 0, 0, 2))
    desk.tell(ack(MavResult.NO_SPACE))
    assert desk.wait(20) == []
    desk.tell(Heartbeat(2, 3, 0, 0, 2))
    assert desk.tell(Heartbeat(2, 3, 0, 0, 3)) == [MissionCount(VEHICLE, 0, 3)]
    desk.tell(ack(MavResult.NO_SPACE))
    desk.wait(1.5)
    assert (desk.machine.outcome.status, desk.machine.outcome.result) == (
        "refused",
        MavResult.NO_SPACE,
    )


def test_a_reboot_in_the_middle_begins_anew_when_the_vehicle_is_ready() -> None:
    """A real ArduCopter, 50 ms after its power was cut: UNSUPPORTED, and CALIBRATING later."""
    desk = desk_for("ardupilot")
    desk.tell(request(0))
    desk.tell(ack(MavResult.UNSUPPORTED))
    assert desk.wait(1.0) == []
    for state in (2, 2):
        desk.tell(Heartbeat(2, 3, 0, 0, state))
        desk.tell(ack(MavResult.UNSUPPORTED))
        assert desk.wait(1.0) == []
    assert desk.tell(Heartbeat(2, 3, 0, 0, 3)) == [MissionCount(VEHICLE, 0, 3)]
    for seq in range(3):
        assert [message.seq for message in desk.tell(request(seq))] == [seq]
    desk.tell(ack(MavResult.ACCEPTED))
    assert desk.machine.outcome.status == "accepted"


@pytest.mark.parametrize("heard", [True, False])
def test_a_refusal_by_a_vehicle_that_is_ready_is_final(heard: bool) -> None:
    desk = desk_for("ardupilot")
    desk.tell(request(0))
    desk.tell(ack(MavResult.UNSUPPORTED))
    if heard:
        desk.tell(Heartbeat(2, 3, 0, 0, 3))
    desk.wait(0.4 if heard else 2.0)
    assert desk.machine.outcome.status == "refused"
    assert desk.machine.outcome.last_requested == 0


def test_denied_about_a_late_request_of_a_download_ends_nothing() -> None:
    desk = desk_for("ardupilot")
    desk.tell(ack(MavResult.DENIED))
    for seq in range(3):
        desk.tell(request(seq))
        desk.tell(ack(MavResult.DENIED))
    desk.tell(ack(MavResult.ACCEPTED))
    assert desk.machine.outcome.status == "accepted"


@BOTH
@pytest.mark.parametrize("requests", [0, 2])
def test_nothing_more_is_written_once_the_vehicle_is_armed(firmware: str, requests: int) -> None:
    desk = desk_for(firmware)
    for seq in range(requests):
        desk.tell(request(seq))
    assert desk.tell(Heartbeat(18, 8, 128, 0, 4), Address(1, 191)) == []  # a companion's flag
    assert desk.tell(Heartbeat(2, 3, 128, 0, 4)) == [
        MissionAck(VEHICLE, MissionType.MISSION, MavResult.OPERATION_CANCELLED)
    ]
    assert desk.machine.outcome.status == "armed"
    assert desk.tell(request(requests)) == []
    assert desk.wait(60) == []


def test_a_vehicle_that_asks_for_the_first_item_for_ever_is_given_up() -> None:
    desk = desk_for("px4")
    while not desk.machine.outcome:
        desk.tell(request(0))
        desk.wait(0.25)
    assert desk.machine.outcome.status == "stalled"
    assert desk.now < 40


def test_a_vehicle_that_always_boots_again_is_given_up() -> None:
    desk = desk_for("ardupilot")
    while not desk.machine.outcome:
        for state in (1, 3):
            desk.tell(Heartbeat(2, 3, 0, 0, state))
            desk.tell(ack(MavResult.NO_SPACE))
            desk.wait(1.0)
        assert desk.now < 70
    assert desk.machine.outcome.result == MavResult.NO_SPACE


def test_booting_for_ever_ends_too() -> None:
    desk = desk_for("ardupilot")
    desk.tell(Heartbeat(2, 3, 0, 0, 1))
    desk.tell(ack(MavResult.NO_SPACE))
    desk.wait(120)
    assert desk.machine.outcome.result == MavResult.NO_SPACE


@pytest.mark.parametrize(
    ("message", "sender"),
    [
        (request(0), FOREIGN),
        (request(0), Address(2, 1)),
        (request(0), Address(1, 2)),
        (request(0, target=FOREIGN), VEHICLE),
        (request(0, target=Address(255, 1)), VEHICLE),
        (request(0, mission_type=1), VEHICLE),
        (ack(MavResult.DENIED), FOREIGN),
        (ack(MavResult.DENIED, target=FOREIGN), VEHICLE),
        (ack(MavResult.DENIED, mission_type=2), VEHICLE),
        (MissionCount(ME, 0, 3), VEHICLE),
        (Heartbeat(2, 3, 128, 0, 4), Address(2, 1)),
        (Heartbeat(2, 3, 0, 0, 4), VEHICLE),
    ],
)
def test_what_is_said_to_others_or_about_other_lists_is_ignored(
    message: Any, sender: Address
) -> None:
    desk = desk_for("px4")
    assert desk.tell(message, sender) == []
    assert not desk.machine.outcome
    assert desk.tell(request(0)) != []


@BOTH
def test_acceptance_by_another_vehicle_is_none(firmware: str) -> None:
    desk = asked_for_all(firmware)
    desk.tell(ack(MavResult.ACCEPTED), Address(2, 1))
    desk.tell(ack(MavResult.ACCEPTED, target=FOREIGN))
    desk.tell(ack(MavResult.ACCEPTED, mission_type=1))
    assert not desk.machine.outcome


def test_who_gives_up_tells_the_vehicle() -> None:
    desk = desk_for("px4")
    desk.tell(request(0))
    assert desk.machine.cancel(desk.now) == [MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED)]
    assert desk.machine.outcome.status == "cancelled"
    assert desk.machine.cancel(desk.now) == ()


def test_the_vehicle_may_give_up_as_well() -> None:
    desk = desk_for("ardupilot")
    desk.tell(request(0))
    desk.tell(ack(MavResult.OPERATION_CANCELLED))
    outcome = desk.machine.outcome
    assert (outcome.status, outcome.result) == ("cancelled", MavResult.OPERATION_CANCELLED)


def test_progress_counts_rows() -> None:
    desk = desk_for("px4")
    assert desk.machine.progress == ("uploading mission", 0, 3)
    desk.tell(request(0))
    desk.tell(request(0))
    desk.tell(request(1))
    assert desk.machine.progress == ("uploading mission", 2, 3)


@pytest.mark.parametrize("part", [MissionType.FENCE, MissionType.RALLY])
def test_other_lists_go_the_same_way(part: MissionType) -> None:
    desk = desk_for("px4", part=part)
    assert desk.sent == [MissionCount(VEHICLE, part, 3)]
    assert desk.tell(request(0)) == []
    assert desk.tell(request(0, mission_type=part)) == [MissionItemInt(VEHICLE, part, 0, ROWS[0])]
