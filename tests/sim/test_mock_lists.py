"""How mock autopilots take and give lists, beyond what the recorded exchanges show."""

import math
from collections.abc import Sequence
from typing import Any

from stations import FOREIGN, VEHICLE, Desk, mock_of, places, rows_for

from faao_mav.sim import Behaviour, behaviour_of
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
PLACE = (-353_000_000, 1_491_000_000)
RALLY_ROW = WireItem(5100, 3, (0.0, 0.0, 0.0, 0.0), *PLACE, 30.0)


def desk_for(kind: str | Behaviour, **options: Any) -> Desk:
    desk = Desk(mock_of(kind, **options), GROUND_STATION)
    desk.start()
    return desk


def count(n: int, part: int = MISSION) -> MissionCount:
    return MissionCount(VEHICLE, part, n)


def item(seq: int, row: WireItem, part: MissionType = MISSION) -> MissionItemInt:
    return MissionItemInt(VEHICLE, part, seq, row)


def results(messages: Sequence[Message]) -> list[int]:
    return [message.type for message in messages if isinstance(message, MissionAck)]


def asked(messages: Sequence[Message]) -> list[int]:
    return [message.seq for message in messages if isinstance(message, MissionRequestInt)]


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


def test_an_upload_that_stops_is_asked_for_and_given_up() -> None:
    """After 8 s ArduPilot says so and has old and new items mixed; after 5 s PX4 has the old."""
    for kind, asks, patience, answers in (
        ("ardupilot", 1, 8.0, [MavResult.OPERATION_CANCELLED]),
        ("px4", 4, 5.0, list[int]()),
    ):
        desk, old, new = desk_for(kind), rows_for(kind, 4), rows_for(kind, 4, shift=0.1)
        upload(desk, old)
        desk.tell(count(len(new)))
        for seq in range(3):
            desk.tell(item(seq, new[seq]))
        assert asked(desk.wait(1.01)) == [3] * asks
        out = desk.wait(patience - 1.0)
        assert results(out) == answers
        assert any(isinstance(each, Statustext) and "timeout" in each.text for each in out)
        assert asked(desk.wait(9.0)) == []
        assert stored(desk) == places((*new[:3], *old[3:]) if kind == "ardupilot" else old)
        assert results(desk.tell(item(3, new[3]))) == [MavResult.ERROR]
        assert upload(desk, new) == [MavResult.ACCEPTED]


def test_another_partner_is_denied_by_ardupilot_and_an_error_for_px4() -> None:
    for kind, refusal in (("ardupilot", MavResult.DENIED), ("px4", MavResult.ERROR)):
        desk, rows = desk_for(kind), rows_for(kind, 3)
        desk.tell(count(len(rows)))
        assert results(desk.tell(count(3), FOREIGN)) == [refusal]
        out = desk.tell(item(0, rows[0]), FOREIGN)
        assert results(out) == ([MavResult.DENIED] if kind == "ardupilot" else [])
        assert asked(desk.tell(item(0, rows[0]))) == [1]


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


def test_what_is_no_list_or_does_not_fit() -> None:
    for kind, limit in (("ardupilot", 655), ("px4", 1000)):
        desk = desk_for(kind)
        assert results(desk.tell(count(1, 230))) == [MavResult.UNSUPPORTED]
        assert results(desk.tell(count(limit + 1))) == [MavResult.NO_SPACE]
        assert asked(desk.tell(count(limit))) == [0]
    desk = desk_for("ardupilot", boot=5.0)
    assert results(desk.tell(count(3))) == [MavResult.NO_SPACE]
    desk.wait(5.1)
    assert asked(desk.tell(count(3))) == [0]


def test_clearing_one_list_leaves_the_others() -> None:
    for kind in ("ardupilot", "px4"):
        desk = desk_for(kind)
        upload(desk, rows_for(kind, 3))
        upload(desk, (RALLY_ROW,), RALLY)
        assert results(desk.tell(MissionClearAll(VEHICLE, 0))) == [MavResult.ACCEPTED]
        assert (stored(desk), len(stored(desk, RALLY))) == ([], 1)
        assert results(desk.tell(MissionClearAll(VEHICLE, 255))) == [MavResult.ACCEPTED]
        assert stored(desk, RALLY) == []


def test_px4_changes_its_request_when_told_unsupported_and_is_freed_by_a_cancellation() -> None:
    assert not desk_for("px4").tell(count(3))[0].legacy
    desk = desk_for("px4-legacy-first")
    (request,) = desk.tell(count(3))
    (other,) = desk.tell(MissionAck(VEHICLE, 0, MavResult.UNSUPPORTED))
    assert (request.legacy, other.legacy, other.seq) == (True, False, 0)
    desk.tell(MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED))
    assert asked(desk.wait(3)) == []
    assert asked(desk.tell(count(3), FOREIGN)) == [0]


def test_which_items_are_refused() -> None:
    """By the field, whatever the list; what is prescribed comes before."""
    nan, speed, none = math.nan, (1.0, 5.0, -1.0, 0.0), (0.0,) * 4
    for kind, row, result in (
        ("ardupilot", WireItem(16, 10, none, *PLACE, 9.0), MavResult.ACCEPTED),
        ("ardupilot", WireItem(1, 3, none, *PLACE, 9.0), MavResult.INVALID),
        ("ardupilot", WireItem(16, 3, (0.0, nan, 0, 0), *PLACE, 9.0), MavResult.INVALID_PARAM2),
        ("ardupilot", WireItem(16, 3, none, 910_000_000, 0, 9.0), MavResult.INVALID_PARAM5_X),
        ("ardupilot", WireItem(178, 3, speed, 0, 0, 0.0), MavResult.ACCEPTED),
        ("px4", WireItem(1, 3, none, *PLACE, 9.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(82, 3, none, *PLACE, 9.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(178, 3, speed, 0, 0, 0.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(178, 2, speed, 0, 0, 0.0), MavResult.ACCEPTED),
        ("px4", WireItem(178, 10, speed, 0, 0, 0.0), MavResult.UNSUPPORTED_FRAME),
        ("px4", WireItem(16, 2, none, *PLACE, 9.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(16, 3, (nan,) * 4, *PLACE, 9.0), MavResult.ACCEPTED),
        ("px4", WireItem(16, 3, none, 0, 1_810_000_000, 9.0), MavResult.INVALID_PARAM6_Y),
    ):
        rows = (*rows_for(kind, 2)[:1], row)
        assert upload(desk_for(kind), rows) == [result], (kind, row)
        prescribed = behaviour_of("px4", refusals={(MISSION, 1): MavResult.INVALID_PARAM3})
        assert upload(desk_for(prescribed), rows) == [MavResult.INVALID_PARAM3]


def test_a_fence_is_replaced_as_a_whole() -> None:
    desk = desk_for("ardupilot")
    corner = WireItem(5001, 0, (3.0, 0.0, 0.0, 0.0), *PLACE, 0.0)
    upload(desk, (corner,) * 3, FENCE)
    desk.tell(count(3, FENCE))
    desk.tell(item(0, WireItem(5003, 0, (9.0, 0.0, 0.0, 0.0), *PLACE, 0.0), FENCE))
    desk.wait(10)
    assert upload(desk, (corner,) * 2, FENCE) == [MavResult.ERROR]
    assert stored(desk, FENCE) == places((corner,) * 3)


def test_numbers_tell_px4_lists_apart() -> None:
    desk = desk_for("px4")
    numbers = []
    for shift in (0.0, 0.1, 0.0):
        upload(desk, rows_for("px4", 3, shift))
        (found,) = desk.tell(MissionRequestList(VEHICLE, 0))
        desk.tell(MissionAck(VEHICLE, 0, MavResult.ACCEPTED))
        numbers.append(found.opaque_id)
    assert numbers[0] == numbers[2] != numbers[1]
