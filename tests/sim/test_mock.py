"""Mock autopilots take and give lists as real ones did, and what no recorded exchange shows."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import pytest
from exchanges import EXCHANGES, at_desk, exchanges, played, recorded, written
from stations import HOME, VEHICLE, Desk, a_mission, vehicle_of

from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.px4 import PX4, px4_mode
from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.wire import messages
from faao_mav.wire.messages import Message, Statustext
from faao_mav.wire.parameters import carried, value_in
from faao_mav.wire.protocol import GROUND_STATION, MavResult, MissionType
from faao_mav.wire.wire_items import wire_items

T = TypeVar("T", bound=Message)

BOTH = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
BY_HAND = exchanges((EXCHANGES / "mock.txt").read_text())
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
    if mission is not None:
        for part in MissionType:
            desk.machine.lists.replace(part, wire_items(mission, part, vehicle_of(kind)))
    return desk


def only(said: Sequence[Message], kind: type[T]) -> list[T]:
    return [message for message in said if isinstance(message, kind)]


# ---- lists


@pytest.mark.parametrize("real", ["arducopter", "arduplane", "px4"])
def test_the_mock_answers_as_the_real_one(real: str) -> None:
    kind: MockKind = "px4" if real == "px4" else "ardupilot"
    aircraft = "plane" if real == "arduplane" else "copter"
    tell = at_desk(desk_for(kind, aircraft=aircraft, rate=0.0), VEHICLE)

    def about_lists(line: str, expected: int) -> list[Message]:
        return only(tell(line, expected), messages.ListMessage)

    for name, lines in exchanges(recorded(real)).items():
        assert (name, played(lines, about_lists)) == (name, lines)


@pytest.mark.parametrize("name", BY_HAND)
def test_the_mock_answers_what_no_real_one_was_asked(name: str) -> None:
    kind: Any = name.partition(":")[0]
    assert played(BY_HAND[name], at_desk(desk_for(kind), VEHICLE)) == BY_HAND[name]


def test_lists_come_after_booting_and_what_is_prescribed_before_what_it_does_by_itself() -> None:
    """In its exchanges a mock is ready, and answers for itself."""
    desk = desk_for("ardupilot", boot=5.0)
    for answer in ("ack mission NO_SPACE", "request mission 0 legacy"):
        assert [written(each) for each in at_desk(desk, VEHICLE)("> count mission 3", 1)] == [
            answer
        ]
        desk.wait(5.1)
    tell = at_desk(
        desk_for("px4", refusals={(MissionType.MISSION, 0): MavResult.INVALID_PARAM3}), VEHICLE
    )
    tell("> count mission 1", 1)
    assert [written(each) for each in tell("> item mission 0 way", 1)] == [
        "ack mission INVALID_PARAM3"
    ]


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
    desk = desk_for("ardupilot", a_mission(30), aircraft="plane", speedup=20.0)
    assert (result(desk, ARM), result(desk, AUTO["ardupilot"])) == (0, 0)  # training, for a plane
    assert height(desk, 2.0) == 0
    assert result(desk, 10) == 0
    assert height(desk, 2.0) > 0
    for mode, begins_anew in ((10, False), (2, True)):  # disarmed in AUTO it keeps its item
        assert (result(desk, DISARM), result(desk, mode)) == (0, 0)
        assert (only(desk.wait(1.5), messages.MissionCurrent)[-1].seq == 0) == begins_anew
    assert only(desk.wait(1.5), messages.Heartbeat)[-1].type == 1


@pytest.mark.parametrize(("options", "answer"), [(0, 4), (2, 4), (3, 0)])
def test_a_copter_arms_in_auto_as_its_parameter_allows(options: int, answer: int) -> None:
    desk = desk_for("ardupilot", a_mission(5), parameters={"AUTO_OPTIONS": options})
    assert (result(desk, AUTO["ardupilot"]), result(desk, ARM)) == (0, answer)


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
    assert not only(desk.wait(1.0), Statustext)
    assert result(desk, desk.machine.flight.modes.at_fence["return"]) == 0
    said = only(desk.wait(300.0), Statustext)
    assert "Landed, disarming" in [text.text for text in said]
    assert desk.machine.flight.aircraft.at(desk.now).position == pytest.approx([0, 0, 0])
    assert (result(desk, 0), result(desk, ARM), result(desk, START)) == (0, 0, 0)
    assert height(desk, 3.0) > 0
    (kept,) = desk.tell(messages.MissionClearAll(VEHICLE, 0))  # ArduPilot keeps what it flies
    assert kept.type == (MavResult.ERROR if kind == "ardupilot" else MavResult.ACCEPTED)
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


def stream(desk: Desk) -> None:
    """Send setpoints for two seconds."""
    for _ in range(20):
        desk.tell(STILL)
        desk.wait(0.1)


@BOTH
def test_no_setpoint_brings_it_down(kind: MockKind) -> None:
    desk = desk_for(kind)
    stream(desk)
    guided = desk.machine.flight.modes.guided
    assert (result(desk, guided), result(desk, ARM)) == (0, 0)
    desk.tell(command(22, *[0] * 6, 20.0))
    for value in (0.0, math.nan, math.inf, 3e38, -3e38):
        for field in ("x", "vx", "afx"):
            wrong: dict[str, Any] = {field: value}
            desk.tell(replace(STILL, **wrong))
            assert only(desk.wait(0.5), messages.GlobalPositionInt)
    assert desk.machine.armed


def test_a_reboot_keeps_what_is_stored() -> None:
    desk = desk_for("px4", a_mission(5), boot=2.0)
    desk.wait(3.0)
    assert result(desk, ARM) == 0
    stream(desk)
    assert result(desk, REBOOT) == 0
    assert result(desk, OFFBOARD) == 1  # no setpoints since
    assert not desk.machine.armed
    assert result(desk, ARM) == 1
    assert len(desk.machine.lists.items(MissionType.MISSION)) == 5
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
    begun = only(desk.sent, messages.MissionCurrent)[-1].seq > 0
    assert begun == (desk.machine.armed or kind == "px4")  # which keeps its item
    changes = [beat.custom_mode for beat in only(desk.sent, messages.Heartbeat)]
    assert [m for m, before in zip(changes, [None, *changes], strict=False) if m != before] == modes
    told = kind == "px4" or bool(parameters)
    assert told == any("fence" in text.text for text in only(desk.sent, Statustext))
    desk = desk_for(kind, kept_within(100.0, north=0.01), parameters=parameters)
    keeps = kind == "ardupilot" and bool(parameters)  # it does not arm outside
    assert result(desk, ARM) == (4 if keeps else 0)
