"""The mock autopilots' side of the mission protocol, as the real ones have it."""

from collections.abc import Sequence
from typing import Any, TypeVar

import pytest
from stations import FOREIGN, HOME, VEHICLE, Desk, mock_of, places, rows_for

from faao_mav.sim import Behaviour, MockKind, behaviour_of
from faao_mav.wire.messages import (
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    Statustext,
    WireItem,
)
from faao_mav.wire.protocol import GROUND_STATION, Address, MavResult, MissionType

MISSION, FENCE, RALLY = MissionType
T = TypeVar("T", bound=Message)

TO = VEHICLE
PLACE = (-353_000_000, 1_491_000_000)
RALLY_ROW = WireItem(5100, 3, (0.0, 0.0, 0.0, 0.0), *PLACE, 30.0)


def desk_for(kind: str | Behaviour, **options: Any) -> Desk:
    desk = Desk(mock_of(kind, **options), GROUND_STATION)
    desk.start()
    return desk


def count(n: int, part: int = MISSION) -> MissionCount:
    return MissionCount(TO, part, n)


def item(seq: int, row: WireItem, part: MissionType = MISSION) -> MissionItemInt:
    return MissionItemInt(TO, part, seq, row)


def answers(messages: Sequence[Message], kind: type[T]) -> list[T]:
    return [message for message in messages if isinstance(message, kind)]


def results(messages: Sequence[Message]) -> list[int]:
    return [message.type for message in answers(messages, MissionAck)]


def asked(messages: Sequence[Message]) -> list[int]:
    return [message.seq for message in answers(messages, MissionRequestInt)]


def upload(
    desk: Desk,
    rows: Sequence[WireItem],
    part: MissionType = MISSION,
    sender: Address = GROUND_STATION,
) -> list[int]:
    """Upload without a fault and return the last answer's results."""
    out = desk.tell(count(len(rows), part), sender)
    for seq, row in enumerate(rows):
        assert asked(out) == [seq]
        out = desk.tell(item(seq, row, part), sender)
    return results(out)


def stored(desk: Desk, part: MissionType = MISSION) -> list[tuple[int, int, int, float]]:
    return places(desk.machine.lists.items(part))


@pytest.mark.parametrize(
    ("kind", "legacy"), [("ardupilot", True), ("px4", False), ("px4-legacy-first", True)]
)
def test_who_asks_with_which_message(kind: MockKind, legacy: bool) -> None:
    (request,) = desk_for(kind).tell(count(3))
    assert request.legacy is legacy


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_what_is_uploaded_can_be_downloaded(kind: MockKind) -> None:
    desk, rows = desk_for(kind), rows_for(kind, 4)
    assert upload(desk, rows) == [MavResult.ACCEPTED]
    (found,) = desk.tell(MissionRequestList(TO, 0))
    assert found.count == len(rows)
    for seq, row in enumerate(rows):
        (answer,) = desk.tell(MissionRequestInt(TO, 0, seq))
        assert places([answer.item]) == places([row])
    desk.tell(MissionAck(TO, 0, MavResult.ACCEPTED))


def test_ardupilot_keeps_its_own_home_in_row_0() -> None:
    desk = desk_for("ardupilot")
    rows = rows_for("ardupilot", 3)
    elsewhere = WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), *PLACE, 1.0)
    upload(desk, (elsewhere, *rows[1:]))
    home = desk.machine.lists.items(MISSION)[0]
    assert (home.x, home.y, home.z) == (round(HOME.latitude * 1e7), 1_491_652_370, 584.0)


def test_storage_loses_what_the_real_one_loses() -> None:
    fussy = WireItem(16, 6, (2.75, 5.0, 1.0, 30.0), *PLACE, 20.123)
    for kind, params, frame in (
        ("ardupilot", (2.0, 0.0, 0.0, 0.0), 3),
        ("px4", (2.75, 5.0, 0.0, 30.0), 6),
    ):
        desk = desk_for(kind)
        first = rows_for(kind, 2)[:1]
        upload(desk, (*first, fussy))
        found = desk.machine.lists.items(MISSION)[1]
        assert (found.params, found.frame) == (params, frame)


def test_ardupilot_asks_again_after_1_s_and_gives_up_after_8() -> None:
    desk = desk_for("ardupilot")
    desk.tell(count(3))
    assert asked(desk.wait(0.99)) == []
    assert asked(desk.wait(0.02)) == [0]
    out = desk.wait(7.5)
    assert results(out) == [MavResult.OPERATION_CANCELLED]
    assert "Mission upload timeout" in [text.text for text in answers(out, Statustext)]
    assert results(desk.tell(item(0, rows_for("ardupilot")[0]))) == [MavResult.ERROR]
    assert upload(desk, rows_for("ardupilot")) == [MavResult.ACCEPTED]


def test_px4_asks_again_after_a_quarter_and_gives_up_in_silence_after_5() -> None:
    desk = desk_for("px4")
    desk.tell(count(3))
    assert asked(desk.wait(1.01)) == [0] * 4
    out = desk.wait(6)
    assert results(out) == []
    assert "Operation timeout\t" in [text.text for text in answers(out, Statustext)]
    assert asked(desk.wait(6)) == []


def test_ardupilot_says_so_of_a_wrong_item_and_goes_on() -> None:
    desk, rows = desk_for("ardupilot"), rows_for("ardupilot", 3)
    desk.tell(count(4))
    assert results(desk.tell(item(2, rows[2]))) == [MavResult.INVALID_SEQUENCE]
    for seq in range(3):
        assert asked(desk.tell(item(seq, rows[seq]))) == [seq + 1]


def test_px4_passes_over_a_wrong_item() -> None:
    desk, rows = desk_for("px4"), rows_for("px4", 3)
    desk.tell(count(3))
    assert desk.tell(item(2, rows[2])) == []
    assert asked(desk.tell(item(0, rows[0]))) == [1]


def test_the_last_item_again_is_an_error_for_ardupilot() -> None:
    desk, rows = desk_for("ardupilot"), rows_for("ardupilot", 3)
    upload(desk, rows)
    assert results(desk.tell(item(len(rows) - 1, rows[-1]))) == [MavResult.ERROR]


def test_the_last_item_again_is_accepted_by_px4_any_other_is_an_error() -> None:
    desk, rows = desk_for("px4"), rows_for("px4", 3)
    upload(desk, rows)
    assert results(desk.tell(item(2, rows[2]))) == [MavResult.ACCEPTED]
    assert results(desk.tell(item(1, rows[1]))) == [MavResult.ERROR]


@pytest.mark.parametrize("complete_only", [True, False])
def test_a_late_item_of_an_upload_that_px4_gave_up(complete_only: bool) -> None:
    desk, rows = desk_for(behaviour_of("px4", complete_only=complete_only)), rows_for("px4", 3)
    desk.tell(count(3))
    desk.tell(item(0, rows[0]))
    desk.wait(6)
    late = MavResult.ERROR if complete_only else MavResult.ACCEPTED
    assert results(desk.tell(item(0, rows[0]))) == [late]
    assert stored(desk) == []


def test_ardupilot_is_left_with_old_and_new_items_px4_is_not() -> None:
    for kind, mixed in (("ardupilot", True), ("px4", False)):
        desk = desk_for(kind)
        old, new = rows_for(kind, 4), rows_for(kind, 4, shift=0.1)
        upload(desk, old)
        desk.tell(count(len(new)))
        for seq in range(3):
            desk.tell(item(seq, new[seq]))
        desk.wait(10)
        expected = places((*new[:3], *old[3:])) if mixed else places(old)
        assert stored(desk) == expected


def test_another_partner_is_denied_by_ardupilot_and_an_error_for_px4() -> None:
    for kind, refusal in (("ardupilot", MavResult.DENIED), ("px4", MavResult.ERROR)):
        desk, rows = desk_for(kind), rows_for(kind, 3)
        desk.tell(count(len(rows)))
        assert results(desk.tell(count(3), FOREIGN)) == [refusal]
        out = desk.tell(item(0, rows[0]), FOREIGN)
        assert results(out) == ([MavResult.DENIED] if kind == "ardupilot" else [])
        out = desk.tell(item(0, rows[0]))
        assert asked(out) == [1]


def test_a_count_again_begins_anew_for_ardupilot() -> None:
    desk, rows = desk_for("ardupilot"), rows_for("ardupilot", 3)
    desk.tell(count(4))
    desk.tell(item(0, rows[0]))
    assert asked(desk.tell(count(4))) == [0]


def test_a_count_again_is_an_error_for_px4_once_it_has_an_item() -> None:
    desk, rows = desk_for("px4"), rows_for("px4", 3)
    desk.tell(count(3))
    assert asked(desk.tell(count(3))) == [0]
    desk.tell(item(0, rows[0]))
    assert results(desk.tell(count(3))) == [MavResult.ERROR]
    assert asked(desk.tell(item(1, rows[1]))) == [2]


def test_downloading_during_an_upload() -> None:
    desk = desk_for("ardupilot")
    desk.tell(count(3))
    assert results(desk.tell(MissionRequestList(TO, 0))) == [MavResult.DENIED]
    desk = desk_for("px4")
    desk.tell(count(3))
    out = desk.tell(MissionRequestList(TO, 0))
    assert results(out) == []
    assert answers(out, MissionCount) == []


def test_ardupilot_takes_two_lists_at_once_px4_does_not() -> None:
    desk = desk_for("ardupilot")
    desk.tell(count(3))
    assert asked(desk.tell(count(1, RALLY))) == [0]
    assert results(desk.tell(item(0, RALLY_ROW, RALLY))) == [MavResult.ACCEPTED]
    desk = desk_for("px4")
    desk.tell(count(3))
    # Before the first item it takes any count for a repetition of the one that it knows.
    (request,) = desk.tell(count(1, RALLY))
    assert request.mission_type == MISSION
    desk.tell(item(0, rows_for("px4")[0]))
    assert results(desk.tell(count(1, RALLY))) == [MavResult.ERROR]


def test_too_many_items() -> None:
    for kind, limit in (("ardupilot", 655), ("px4", 1000)):
        desk = desk_for(kind)
        assert results(desk.tell(count(16_000))) == [MavResult.NO_SPACE]
        assert results(desk.tell(count(limit + 1))) == [MavResult.NO_SPACE]
        assert asked(desk.tell(count(limit))) == [0]


def test_an_unknown_list() -> None:
    assert results(desk_for("ardupilot").tell(count(1, 230))) == [MavResult.UNSUPPORTED]
    assert results(desk_for("px4").tell(count(1, 230))) == [MavResult.INVALID]


def test_ardupilot_has_no_space_while_it_boots() -> None:
    desk = desk_for("ardupilot", boot=5.0)
    assert results(desk.tell(count(3))) == [MavResult.NO_SPACE]
    desk.wait(5.1)
    assert asked(desk.tell(count(3))) == [0]


def test_clearing_one_list_leaves_the_others() -> None:
    for kind in ("ardupilot", "px4"):
        desk = desk_for(kind)
        upload(desk, rows_for(kind, 3))
        upload(desk, (RALLY_ROW,), RALLY)
        assert results(desk.tell(MissionClearAll(TO, 0))) == [MavResult.ACCEPTED]
        assert stored(desk) == []
        assert len(stored(desk, RALLY)) == 1
        assert results(desk.tell(MissionClearAll(TO, 255))) == [MavResult.ACCEPTED]
        assert stored(desk, RALLY) == []


def test_a_count_of_none_clears() -> None:
    for kind in ("ardupilot", "px4"):
        desk = desk_for(kind)
        upload(desk, rows_for(kind, 3))
        assert results(desk.tell(count(0))) == [MavResult.ACCEPTED]
        assert stored(desk) == []


def test_px4_changes_its_request_when_told_unsupported() -> None:
    desk = desk_for("px4-legacy-first")
    (request,) = desk.tell(count(3))
    (other,) = desk.tell(MissionAck(TO, 0, MavResult.UNSUPPORTED))
    assert (request.legacy, other.legacy) == (True, False)
    assert other.seq == 0


def test_px4_is_freed_by_a_cancellation() -> None:
    desk = desk_for("px4")
    desk.tell(count(3))
    desk.tell(MissionAck(TO, 0, MavResult.OPERATION_CANCELLED))
    assert asked(desk.wait(3)) == []
    assert asked(desk.tell(count(3), FOREIGN)) == [0]


def test_px4_downloads_in_order_only() -> None:
    desk, rows = desk_for("px4"), rows_for("px4", 4)
    upload(desk, rows)
    assert desk.tell(MissionRequestInt(TO, 0, 0)) == []
    desk.tell(MissionRequestList(TO, 0))
    for seq in (0, 0, 1):
        (answer,) = desk.tell(MissionRequestInt(TO, 0, seq))
        assert answer.seq == seq
    assert results(desk.tell(MissionRequestInt(TO, 0, 3))) == [MavResult.ERROR]
    assert desk.tell(MissionRequestInt(TO, 0, 1)) == []


def test_ardupilot_downloads_in_any_order() -> None:
    desk, rows = desk_for("ardupilot"), rows_for("ardupilot", 3)
    upload(desk, rows)
    for seq in (3, 0, 2):
        (answer,) = desk.tell(MissionRequestInt(TO, 0, seq, legacy=True))
        assert (answer.seq, answer.legacy) == (seq, True)
    assert results(desk.tell(MissionRequestInt(TO, 0, 9))) == [MavResult.ERROR]
    assert results(desk.tell(MissionRequestInt(TO, 2, 9))) == [MavResult.INVALID_SEQUENCE]


NAN = float("nan")


@pytest.mark.parametrize(
    ("kind", "row", "result"),
    [
        ("ardupilot", WireItem(16, 1, (0.0,) * 4, *PLACE, 9.0), MavResult.UNSUPPORTED_FRAME),
        ("ardupilot", WireItem(16, 10, (0.0,) * 4, *PLACE, 9.0), MavResult.ACCEPTED),
        ("ardupilot", WireItem(1, 3, (0.0,) * 4, *PLACE, 9.0), MavResult.INVALID),
        (
            "ardupilot",
            WireItem(16, 3, (0.0, NAN, 0.0, 0.0), *PLACE, 9.0),
            MavResult.INVALID_PARAM2,
        ),
        (
            "ardupilot",
            WireItem(16, 3, (0.0,) * 4, 910_000_000, 0, 9.0),
            MavResult.INVALID_PARAM5_X,
        ),
        ("ardupilot", WireItem(82, 3, (0.0,) * 4, *PLACE, 9.0), MavResult.ACCEPTED),
        ("ardupilot", WireItem(178, 3, (1.0, 5.0, -1.0, 0.0), 0, 0, 0.0), MavResult.ACCEPTED),
        ("px4", WireItem(82, 3, (0.0,) * 4, *PLACE, 9.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(178, 3, (1.0, 5.0, -1.0, 0.0), 0, 0, 0.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(178, 2, (1.0, 5.0, -1.0, 0.0), 0, 0, 0.0), MavResult.ACCEPTED),
        (
            "px4",
            WireItem(178, 10, (1.0, 5.0, -1.0, 0.0), 0, 0, 0.0),
            MavResult.UNSUPPORTED_FRAME,
        ),
        ("px4", WireItem(16, 10, (0.0,) * 4, *PLACE, 9.0), MavResult.UNSUPPORTED_FRAME),
        ("px4", WireItem(16, 2, (0.0,) * 4, *PLACE, 9.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(16, 3, (NAN,) * 4, *PLACE, 9.0), MavResult.ACCEPTED),
        ("px4", WireItem(20, 3, (0.0,) * 4, 0, 0, 0.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(5001, 0, (3.0, 0.0, 0.0, 0.0), *PLACE, 0.0), MavResult.ERROR),
        ("px4", WireItem(16, 3, (0.0,) * 4, 0, 1_810_000_000, 9.0), MavResult.INVALID_PARAM6_Y),
    ],
)
def test_which_items_are_refused(kind: MockKind, row: WireItem, result: MavResult) -> None:
    desk = desk_for(kind)
    first = rows_for(kind, 2)[:1]
    assert upload(desk, (*first, row)) == [result]


def test_a_fence_is_checked_and_replaced_as_a_whole() -> None:
    desk = desk_for("ardupilot")
    corner = WireItem(5001, 0, (3.0, 0.0, 0.0, 0.0), *PLACE, 0.0)
    upload(desk, (corner,) * 3, FENCE)
    desk.tell(count(3, FENCE))
    desk.tell(item(0, WireItem(5003, 0, (9.0, 0.0, 0.0, 0.0), *PLACE, 0.0), FENCE))
    desk.wait(10)
    assert stored(desk, FENCE) == places((corner,) * 3)
    assert upload(desk, (corner,) * 2, FENCE) == [MavResult.ERROR]
    assert stored(desk, FENCE) == places((corner,) * 3)


def test_refusals_can_be_prescribed() -> None:
    manners = behaviour_of("ardupilot", refusals={(MISSION, 1): MavResult.INVALID_PARAM3})
    desk = desk_for(manners)
    rows = rows_for("ardupilot", 2)
    assert upload(desk, rows[:2]) == [MavResult.INVALID_PARAM3]


def test_numbers_tell_px4_lists_apart() -> None:
    desk = desk_for("px4")
    numbers = []
    for shift in (0.0, 0.1, 0.0):
        upload(desk, rows_for("px4", 3, shift))
        (found,) = desk.tell(MissionRequestList(TO, 0))
        desk.tell(MissionAck(TO, 0, MavResult.ACCEPTED))
        numbers.append(found.opaque_id)
    assert numbers[0] == numbers[2] != numbers[1]
