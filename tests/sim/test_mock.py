"""Mock autopilots take and give lists as real ones did, and what no recorded exchange shows."""

import math
from collections.abc import Sequence
from typing import Any, TypeVar

import pytest
from exchanges import exchanges, played, recorded
from stations import FOREIGN, HOME, VEHICLE, Desk, a_mission, places, rows_for, vehicle_of

from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.px4 import PX4, px4_mode
from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.wire import messages
from faao_mav.wire.messages import Message, WireItem
from faao_mav.wire.parameters import carried, value_in
from faao_mav.wire.protocol import GROUND_STATION, Address, MavResult, MissionType
from faao_mav.wire.wire_items import wire_items

T = TypeVar("T", bound=Message)

BOTH = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
MISSION, _, RALLY = MissionType
RTL, AUTO = 6, {"ardupilot": 3, "px4": px4_mode(4, 4)}
HOLD, OFFBOARD, LAND = px4_mode(4, 3), px4_mode(6, 0), px4_mode(4, 6)
STILL = messages.SetPositionTargetLocalNed(VEHICLE, 0, 1, 3072, 0, 0, -20.0, 0, 0, 0, 0, 0, 0)
"""A setpoint 20 m above home."""


def desk_for(
    kind: MockKind, mission: Mission | None = None, refusals: Any = (), **options: Any
) -> Desk:
    behaviour = behaviour_of(kind, refusals=dict(refusals))
    desk = Desk(MockAutopilot(behaviour, home=HOME, **options), GROUND_STATION)
    desk.start()
    for part in MissionType if mission is not None else ():
        desk.machine.lists.replace(part, wire_items(mission, part, vehicle_of(kind)))
    return desk


def only(said: Sequence[Message], kind: type[T]) -> list[T]:
    return [message for message in said if isinstance(message, kind)]


# ---- lists


@pytest.mark.parametrize(
    ("kind", "aircraft", "real"),
    [
        ("ardupilot", "copter", "arducopter"),
        ("ardupilot", "plane", "arduplane"),
        ("px4", "copter", "px4"),
    ],
)
def test_the_mock_answers_as_the_real_one(kind: MockKind, aircraft: str, real: str) -> None:
    desk = desk_for(kind, aircraft=aircraft, rate=0.0)

    def talk(sent: list[Message], seconds: float, expected: int) -> list[Message]:
        said = [answer for message in sent for answer in desk.tell(message)]
        return only([*said, *([] if sent else desk.wait(seconds))], messages.ListMessage)

    for name, lines in exchanges(recorded(real)).items():
        assert (name, played(lines, talk, VEHICLE)) == (name, lines)


def count(n: int, part: int = MISSION) -> messages.MissionCount:
    return messages.MissionCount(VEHICLE, part, n)


def item(seq: int, row: WireItem, part: MissionType = MISSION) -> messages.MissionItemInt:
    return messages.MissionItemInt(VEHICLE, part, seq, row)


def results(said: Sequence[Message]) -> list[int]:
    return [message.type for message in only(said, messages.MissionAck)]


def asked(said: Sequence[Message]) -> list[int]:
    return [message.seq for message in only(said, messages.MissionRequestInt)]


def upload(desk: Desk, rows: Sequence[WireItem], sender: Address = GROUND_STATION) -> list[int]:
    """Upload without a fault and return the last answer's results."""
    out = desk.tell(count(len(rows)), sender)
    for seq, row in enumerate(rows):
        assert asked(out) == [seq]
        out = desk.tell(item(seq, row), sender)
    return results(out)


@BOTH
def test_an_upload_that_stops_is_asked_for_and_given_up(kind: MockKind) -> None:
    """After 8 s ArduPilot says so and has old and new items mixed; after 5 s PX4 has the old."""
    ardupilot = kind == "ardupilot"
    desk, old, new = desk_for(kind), rows_for(kind, 4), rows_for(kind, 4, shift=0.1)
    upload(desk, old)
    desk.tell(count(len(new)))
    for seq in range(3):
        desk.tell(item(seq, new[seq]))
    assert asked(desk.wait(1.01)) == [3] * (1 if ardupilot else 4)
    out = desk.wait(7.0 if ardupilot else 4.0)
    assert results(out) == [MavResult.OPERATION_CANCELLED] * ardupilot
    assert any("timeout" in each.text for each in only(out, messages.Statustext))
    held = (*new[:3], *old[3:]) if ardupilot else old
    assert places(desk.machine.lists.items(MISSION)) == places(held)
    assert results(desk.tell(item(3, new[3]))) == [MavResult.ERROR]
    assert upload(desk, new) == [MavResult.ACCEPTED]


@BOTH
def test_another_partner_is_denied_by_ardupilot_and_an_error_for_px4(kind: MockKind) -> None:
    """ArduPilot takes two lists at once, PX4 does not, and is freed by a cancellation."""
    ardupilot, desk, rows = kind == "ardupilot", desk_for(kind), rows_for(kind, 3)
    desk.tell(count(len(rows)))
    refusal = MavResult.DENIED if ardupilot else MavResult.ERROR
    assert results(desk.tell(count(3), FOREIGN)) == [refusal]
    out = desk.tell(item(0, rows[0]), FOREIGN)
    assert results(out) == [MavResult.DENIED] * ardupilot
    assert asked(desk.tell(item(0, rows[0]))) == [1]
    out = desk.tell(count(1, RALLY))
    assert (asked(out), results(out)) == (([0], []) if ardupilot else ([], [1]))
    desk.tell(messages.MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED))
    assert asked(desk.tell(count(3), FOREIGN)) == [0] * (not ardupilot)


def test_what_is_no_list_or_comes_before_it_is_ready_or_is_no_item() -> None:
    """Items are refused by the field; what is prescribed comes before."""
    for kind, limit in (("ardupilot", 655), ("px4", 1000)):
        desk = desk_for(kind)  # type: ignore[arg-type]
        assert results(desk.tell(count(1, 230))) == [MavResult.UNSUPPORTED]
        assert results(desk.tell(count(limit + 1))) == [MavResult.NO_SPACE]
        assert asked(desk.tell(count(limit))) == [0]
    desk = desk_for("ardupilot", boot=5.0)
    assert results(desk.tell(count(3))) == [MavResult.NO_SPACE]
    desk.wait(5.1)
    assert asked(desk.tell(count(3))) == [0]
    place, none = (-353_000_000, 1_491_000_000, 9.0), (0.0, 0.0, 0.0, 0.0)
    first, unset = rows_for("px4", 2)[0], (math.nan,) * 4
    for kind, row, result in (
        ("ardupilot", WireItem(1, 3, none, *place), MavResult.INVALID),
        ("ardupilot", WireItem(16, 3, (0.0, *unset[1:]), *place), MavResult.INVALID_PARAM2),
        ("ardupilot", WireItem(16, 3, none, 910_000_000, 0, 9.0), MavResult.INVALID_PARAM5_X),
        ("px4", WireItem(82, 3, none, *place), MavResult.UNSUPPORTED),
        ("px4", WireItem(16, 10, none, *place), MavResult.UNSUPPORTED_FRAME),
        ("px4", WireItem(16, 3, unset, *place), MavResult.ACCEPTED),
    ):
        assert upload(desk_for(kind), (first, row)) == [result], (kind, row)  # type: ignore[arg-type]
        told = MavResult.INVALID_PARAM3
        assert upload(desk_for("px4", refusals={(MISSION, 1): told}), (first, row)) == [told]


# ---- commands, parameters, flight


def command(number: int, *params: float) -> messages.CommandLong:
    return messages.CommandLong(VEHICLE, number, 0, *map(float, params))


ARM, DISARM, START, REBOOT = command(400, 1), command(400, 0), command(300), command(246, 1)


def result(desk: Desk, order: Message | int) -> int:
    """Return the answer to an order, or to being set to a mode."""
    said = desk.tell(messages.SetMode(1, 1, order) if isinstance(order, int) else order)
    (ack,) = only(said, messages.CommandAck)
    return ack.result


def height(desk: Desk, seconds: float) -> float:
    """Return how high it is after a while, m above home."""
    return only(desk.wait(seconds), messages.GlobalPositionInt)[-1].relative_alt / 1000


def test_a_plane_has_its_own_number_and_modes() -> None:
    desk = desk_for("ardupilot", a_mission(5), aircraft="plane", speedup=20.0)
    assert (result(desk, ARM), result(desk, AUTO["ardupilot"])) == (0, 0)  # training, for a plane
    assert height(desk, 2.0) == 0
    assert result(desk, 10) == 0
    assert height(desk, 2.0) > 0
    assert only(desk.wait(1.5), messages.Heartbeat)[-1].type == 1


@BOTH
def test_it_flies_what_it_holds_once_it_is_armed_and_told_to(kind: MockKind) -> None:
    """Broken off by another mode it holds its place, or returns; disarmed it stands at home."""
    auto, desk = AUTO[kind], desk_for(kind)
    assert (result(desk, auto), result(desk, START)) == ({"ardupilot": 4, "px4": 1}[kind], 2)
    desk = desk_for(kind, a_mission(12))
    assert (result(desk, auto), height(desk, 5.0), result(desk, DISARM)) == (0, 0, 0)
    assert (result(desk, 0), result(desk, ARM), height(desk, 5.0)) == (0, 0, 0)
    assert result(desk, START) == 0
    assert height(desk, 5.0) > 0
    desk.wait(20.0)
    there = desk.machine.flight.aircraft.at(desk.now)
    assert result(desk, 0) == 0
    desk.wait(20.0)
    held = desk.machine.flight.aircraft.at(desk.now)
    assert held.position == pytest.approx(there.position, abs=0.1)
    assert held.item == there.item
    assert result(desk, auto) == 0
    assert not only(desk.wait(1.0), messages.Statustext)
    if kind == "ardupilot":  # which keeps a mission that it flies
        assert results(desk.tell(messages.MissionClearAll(VEHICLE, 0))) == [MavResult.ERROR]
    assert result(desk, desk.machine.flight.modes.at_fence["return"]) == 0
    said = only(desk.wait(300.0), messages.Statustext)
    assert "Landed, disarming" in [text.text for text in said]
    assert desk.machine.flight.aircraft.at(desk.now).position == pytest.approx([0, 0, 0])
    assert (result(desk, auto), result(desk, ARM)) == (0, 0)
    assert height(desk, 3.0) > 0
    assert (result(desk, DISARM), height(desk, 2.0)) == (0, 0)


def test_a_mode_is_asked_for_as_each_autopilot_has_it() -> None:
    """PX4 accepts what is no mode to it, and changes nothing: the mode itself has to tell."""
    copter, px4 = desk_for("ardupilot"), desk_for("px4")
    rest = px4.machine.mode
    for desk, params, answer, mode in (
        (copter, ARDUPILOT.mode_parameters(17), 0, 17),
        (copter, (0, 4), 2, 17),  # not a custom mode
        (px4, (1, OFFBOARD), 0, rest),
        (px4, (0, 4, 4), 0, rest),
        (px4, (1, 300, 4), 0, rest),
        (px4, PX4.mode_parameters(LAND), 0, LAND),
    ):
        assert (result(desk, command(176, *params)), desk.machine.mode) == (answer, mode)


@BOTH
def test_parameters(kind: MockKind) -> None:
    desk = desk_for(kind)
    values, vehicle = desk.tell(messages.ParamRequestList(VEHICLE)), desk.machine.vehicle
    assert [value.param_index for value in values] == list(range(len(values)))
    assert {value.param_count for value in values} == {len(values)}
    told = {value.param_id: value_in(value, vehicle) for value in values}
    assert told.items() >= vehicle.defaults().items()
    second = values[1]
    for name, index, answer in (
        ("", 1, [second]),
        (second.param_id, -1, [second]),
        ("NO_SUCH", -1, []),
        ("", 999, []),
    ):
        assert desk.tell(messages.ParamRequestRead(VEHICLE, name, index)) == answer
    (changed,) = desk.tell(messages.ParamSet(VEHICLE, second.param_id, 7.0, 9))
    assert changed.param_value == 7.0
    if kind == "px4":  # takes no other type than it has
        assert desk.tell(messages.ParamSet(VEHICLE, "GF_ACTION", 3.0, 9)) == []
        (answer,) = desk.tell(messages.ParamSet(VEHICLE, "GF_ACTION", carried(3, 6, vehicle), 6))
        assert (value_in(answer, vehicle), answer.param_type) == (3, 6)


def test_a_reboot_keeps_what_is_stored() -> None:
    desk = desk_for("px4", a_mission(5), boot=2.0)
    desk.wait(3.0)
    assert result(desk, ARM) == 0
    for _ in range(20):
        desk.tell(STILL)
        desk.wait(0.1)
    assert result(desk, REBOOT) == 0
    assert result(desk, OFFBOARD) == 1  # no setpoints since
    assert not desk.machine.armed
    assert result(desk, ARM) == 1
    assert len(desk.machine.lists.items(MISSION)) == 5
    desk.wait(2.5)
    assert result(desk, ARM) == 0


def kept_within(metres: float, north: float = 0.0) -> Mission:
    """Return a mission to a place 222 m to the north, and a round fence about another one."""
    items = (
        MissionItem(22, 3, x=HOME.latitude, y=HOME.longitude, z=20.0),
        MissionItem(16, 3, x=HOME.latitude + 0.002, y=HOME.longitude, z=20.0),
        MissionItem(20, 2),
    )
    circle = Circle((HOME.latitude + north, HOME.longitude), metres, inclusion=True)
    return Mission(items, HOME, Fence(circles=(circle,)))


@pytest.mark.parametrize(
    ("kind", "parameters", "farthest", "end", "modes"),
    [
        ("ardupilot", {"FENCE_ENABLE": 1}, 102, (0, 0), [0, 3, RTL]),
        ("ardupilot", {}, 222, (0, 0), [0, 3]),
        ("px4", {}, 102, (102, 20), [HOLD, AUTO["px4"], HOLD]),
        ("px4", {"GF_ACTION": 3}, 102, (0, 0), [HOLD, AUTO["px4"], px4_mode(4, 5)]),
        ("px4", {"GF_ACTION": 1}, 222, (0, 0), [HOLD, AUTO["px4"], px4_mode(4, 5)]),
    ],
)
def test_at_its_fence_it_does_what_its_parameters_say(
    kind: MockKind,
    parameters: dict[str, float],
    farthest: float,
    end: tuple[float, float],
    modes: list[int],
) -> None:
    """ArduPilot returns, PX4 holds by default; where it is not to be kept it flies on."""
    desk = desk_for(kind, kept_within(100.0), parameters=parameters)
    assert (result(desk, ARM), result(desk, AUTO[kind])) == (0, 0)
    desk.wait(220.0)
    flown = only(desk.sent, messages.GlobalPositionInt)
    north = [(place.lat * 1e-7 - HOME.latitude) * 111_000 for place in flown]
    assert max(north) == pytest.approx(farthest, abs=3)
    assert (north[-1], flown[-1].relative_alt / 1000) == pytest.approx(end, abs=3)
    assert desk.machine.armed == (end[1] > 0)
    changes = [beat.custom_mode for beat in only(desk.sent, messages.Heartbeat)]
    assert [m for m, before in zip(changes, [None, *changes], strict=False) if m != before] == modes
    told = kind == "px4" or bool(parameters)
    assert told == any("fence" in text.text for text in only(desk.sent, messages.Statustext))
    desk = desk_for(kind, kept_within(100.0, north=0.01), parameters=parameters)
    keeps = kind == "ardupilot" and bool(parameters)  # it does not arm outside
    assert result(desk, ARM) == (4 if keeps else 0)
