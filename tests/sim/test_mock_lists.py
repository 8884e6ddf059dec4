"""Mock autopilots take and give lists as real ones did, and what no recorded exchange shows."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from exchanges import exchanges, played, recorded
from stations import FOREIGN, VEHICLE, Desk, mock_of, places, rows_for

from faao_mav.sim import Behaviour, behaviour_of
from faao_mav.wire import messages
from faao_mav.wire.messages import Message, WireItem
from faao_mav.wire.protocol import GROUND_STATION, Address, MavResult, MissionType

MISSION, _, RALLY = MissionType
PLACE = (-353_000_000, 1_491_000_000)
RALLY_ROW = WireItem(5100, 3, (0.0, 0.0, 0.0, 0.0), *PLACE, 30.0)


def desk_for(kind: str | Behaviour, **options: Any) -> Desk:
    desk = Desk(mock_of(kind, **options), GROUND_STATION)
    desk.start()
    return desk


def count(n: int, part: int = MISSION) -> messages.MissionCount:
    return messages.MissionCount(VEHICLE, part, n)


def item(seq: int, row: WireItem, part: MissionType = MISSION) -> messages.MissionItemInt:
    return messages.MissionItemInt(VEHICLE, part, seq, row)


def results(said: Sequence[Message]) -> list[int]:
    return [message.type for message in said if isinstance(message, messages.MissionAck)]


def asked(said: Sequence[Message]) -> list[int]:
    return [message.seq for message in said if isinstance(message, messages.MissionRequestInt)]


def upload(desk: Desk, rows: Sequence[WireItem], sender: Address = GROUND_STATION) -> list[int]:
    """Upload without a fault and return the last answer's results."""
    out = desk.tell(count(len(rows)), sender)
    for seq, row in enumerate(rows):
        assert asked(out) == [seq]
        out = desk.tell(item(seq, row), sender)
    return results(out)


@pytest.mark.parametrize(
    ("kind", "aircraft", "real"),
    [
        ("ardupilot", "copter", "arducopter"),
        ("ardupilot", "plane", "arduplane"),
        ("px4", "copter", "px4"),
    ],
)
def test_the_mock_answers_as_the_real_one(kind: str, aircraft: str, real: str) -> None:
    desk = desk_for(kind, aircraft=aircraft)

    def talk(sent: list[Message], seconds: float, expected: int) -> list[Message]:
        said = [answer for message in sent for answer in desk.tell(message)]
        said += [] if sent else desk.wait(seconds)
        return [answer for answer in said if isinstance(answer, messages.ListMessage)]

    for name, lines in exchanges(recorded(real)).items():
        assert (name, played(lines, talk, VEHICLE)) == (name, lines)


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
        assert any(isinstance(each, messages.Statustext) and "timeout" in each.text for each in out)
        held = (*new[:3], *old[3:]) if kind == "ardupilot" else old
        assert places(desk.machine.lists.items(MISSION)) == places(held)
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
        # ArduPilot takes two lists at once, PX4 does not.
        out = desk.tell(count(1, RALLY))
        assert (asked(out), results(out)) == (([0], []) if kind == "ardupilot" else ([], [1]))


def test_what_is_no_list_or_comes_before_it_is_ready() -> None:
    for kind, limit in (("ardupilot", 655), ("px4", 1000)):
        desk = desk_for(kind)
        assert results(desk.tell(count(1, 230))) == [MavResult.UNSUPPORTED]
        assert results(desk.tell(count(limit + 1))) == [MavResult.NO_SPACE]
        assert asked(desk.tell(count(limit))) == [0]
    desk = desk_for("ardupilot", boot=5.0)
    assert results(desk.tell(count(3))) == [MavResult.NO_SPACE]
    desk.wait(5.1)
    assert asked(desk.tell(count(3))) == [0]


def test_px4_changes_its_request_when_told_unsupported_and_is_freed_by_a_cancellation() -> None:
    desk = desk_for("px4")
    (request,) = desk.tell(count(3))
    (other,) = desk.tell(messages.MissionAck(VEHICLE, 0, MavResult.UNSUPPORTED))
    assert request == messages.MissionRequest(GROUND_STATION, 0, 0)
    assert other == messages.MissionRequestInt(GROUND_STATION, 0, 0)
    desk.tell(messages.MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED))
    assert asked(desk.tell(count(3), FOREIGN)) == [0]


def test_which_items_are_refused() -> None:
    """By the field; what is prescribed comes before."""
    for kind, row, result in (
        ("ardupilot", WireItem(1, 3, (0.0,) * 4, *PLACE, 9.0), MavResult.INVALID),
        (
            "ardupilot",
            WireItem(16, 3, (0.0, math.nan, 0, 0), *PLACE, 9.0),
            MavResult.INVALID_PARAM2,
        ),
        ("ardupilot", WireItem(16, 3, (0.0,) * 4, 910_000_000, 0, 9.0), MavResult.INVALID_PARAM5_X),
        ("px4", WireItem(82, 3, (0.0,) * 4, *PLACE, 9.0), MavResult.UNSUPPORTED),
        ("px4", WireItem(16, 10, (0.0,) * 4, *PLACE, 9.0), MavResult.UNSUPPORTED_FRAME),
        ("px4", WireItem(16, 3, (math.nan,) * 4, *PLACE, 9.0), MavResult.ACCEPTED),
    ):
        rows = (*rows_for(kind, 2)[:1], row)
        assert upload(desk_for(kind), rows) == [result], (kind, row)
        prescribed = behaviour_of("px4", refusals={(MISSION, 1): MavResult.INVALID_PARAM3})
        assert upload(desk_for(prescribed), rows) == [MavResult.INVALID_PARAM3]


def test_numbers_tell_px4_missions_apart() -> None:
    desk, numbers = desk_for("px4"), []
    for shift in (0.0, 0.1, 0.0):
        upload(desk, rows_for("px4", 3, shift))
        (told,) = [m for m in desk.wait(1.0) if isinstance(m, messages.MissionCurrent)]
        numbers.append(told.mission_id)
    assert numbers[0] == numbers[2] != numbers[1]
