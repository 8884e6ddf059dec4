"""The rest of the mock autopilot: heartbeats, commands, parameters, flight."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import pytest
from stations import HOME, VEHICLE, Desk, a_mission, vehicle_of

from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.px4 import PX4, px4_mode
from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.wire import messages
from faao_mav.wire.messages import Message
from faao_mav.wire.parameters import carried, value_in
from faao_mav.wire.protocol import GROUND_STATION, MavResult, MissionType
from faao_mav.wire.wire_items import wire_items

T = TypeVar("T", bound=Message)

BOTH = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
AUTO = {"ardupilot": 3, "px4": 4 << 16 | 4 << 24}
STILL = messages.SetPositionTargetLocalNed(VEHICLE, 0, 1, 3072, 0, 0, -20.0, 0, 0, 0, 0, 0, 0)
"""A setpoint 20 m above home."""


def desk_for(kind: MockKind, mission: Mission | None = None, **options: Any) -> Desk:
    mock = MockAutopilot(behaviour_of(kind), home=HOME, **options)
    desk = Desk(mock, GROUND_STATION)
    desk.start()
    for part in MissionType:
        mock.lists.replace(part, wire_items(mission or Mission(()), part, vehicle_of(kind)))
    return desk


def command(number: int, *params: float) -> messages.CommandLong:
    return messages.CommandLong(VEHICLE, number, 0, *map(float, params))


def result(said: Sequence[Message]) -> int:
    (ack,) = only(said, messages.CommandAck)
    return ack.result


def only(said: Sequence[Message], kind: type[T]) -> list[T]:
    return [message for message in said if isinstance(message, kind)]


def stream(desk: Desk) -> None:
    """Send setpoints for two seconds."""
    for _ in range(20):
        desk.tell(STILL)
        desk.wait(0.1)


def take_off(desk: Desk, kind: MockKind) -> None:
    assert result(desk.tell(command(400, 1))) == 0
    assert result(desk.tell(messages.SetMode(1, 1, AUTO[kind]))) == 0


def height(desk: Desk, seconds: float) -> float:
    """Return how high it is after a while, m above home."""
    return only(desk.wait(seconds), messages.GlobalPositionInt)[-1].relative_alt / 1000


def test_a_plane_has_its_own_number_and_modes() -> None:
    desk = desk_for("ardupilot", a_mission(5), aircraft="plane", speedup=20.0)
    assert result(desk.tell(command(400, 1))) == 0
    training = messages.SetMode(1, 1, AUTO["ardupilot"])  # for a plane
    assert result(desk.tell(training)) == 0
    assert height(desk, 2.0) == 0
    assert result(desk.tell(messages.SetMode(1, 1, 10))) == 0
    assert height(desk, 2.0) > 0
    assert only(desk.wait(1.5), messages.Heartbeat)[-1].type == 1


@BOTH
def test_it_does_not_fly_without_a_mission_or_without_being_armed_and_told_to(
    kind: MockKind,
) -> None:
    desk = desk_for(kind)
    assert result(desk.tell(messages.SetMode(1, 1, AUTO[kind]))) == {"ardupilot": 4, "px4": 1}[kind]
    assert result(desk.tell(command(300))) == 2
    desk = desk_for(kind, a_mission(5))
    assert result(desk.tell(messages.SetMode(1, 1, AUTO[kind]))) == 0
    assert height(desk, 5.0) == 0
    desk = desk_for(kind, a_mission(5))
    assert result(desk.tell(command(400, 1))) == 0
    assert height(desk, 5.0) == 0
    assert result(desk.tell(command(300))) == 0
    assert height(desk, 5.0) > 0
    (ack,) = desk.tell(messages.MissionClearAll(VEHICLE, 0))
    assert ack.type == (MavResult.ERROR if kind == "ardupilot" else MavResult.ACCEPTED)


def test_a_mode_is_asked_for_as_each_autopilot_has_it() -> None:
    """PX4 accepts what is no mode to it, and changes nothing: the mode itself has to tell."""
    copter, px4 = desk_for("ardupilot"), desk_for("px4")
    rest = px4.machine.mode
    assert result(copter.tell(command(176, *ARDUPILOT.mode_parameters(17)))) == 0
    assert copter.machine.mode == 17
    assert result(copter.tell(command(176, 0, 4))) == 2  # not a custom mode
    assert copter.machine.mode == 17
    for params in ((1, px4_mode(6, 0)), (0, 4, 4), (1, 300, 4)):
        assert result(px4.tell(command(176, *params))) == 0
        assert px4.machine.mode == rest
    assert result(px4.tell(command(176, *PX4.mode_parameters(px4_mode(4, 6))))) == 0
    assert px4.machine.mode == px4_mode(4, 6)


@BOTH
def test_a_mission_is_broken_off_and_flown_on(kind: MockKind) -> None:
    """In another mode it holds its place, or returns; disarmed it stands at home."""
    desk = desk_for(kind, a_mission(12))
    take_off(desk, kind)
    desk.tell(messages.SetMode(1, 1, 0))
    assert height(desk, 2.0) == 0
    assert result(desk.tell(messages.SetMode(1, 1, AUTO[kind]))) == 0
    desk.wait(20.0)
    there = desk.machine.flight.aircraft.at(desk.now)
    desk.tell(messages.SetMode(1, 1, 0))
    desk.wait(20.0)
    held = desk.machine.flight.aircraft.at(desk.now)
    assert held.position == pytest.approx(there.position, abs=0.1)
    assert held.item == there.item
    desk.tell(messages.SetMode(1, 1, AUTO[kind]))
    assert not only(desk.wait(1.0), messages.Statustext)
    desk.tell(messages.SetMode(1, 1, desk.machine.flight.modes.at_fence["return"]))
    assert "Landed, disarming" in [
        text.text for text in only(desk.wait(300.0), messages.Statustext)
    ]
    assert desk.machine.flight.aircraft.at(desk.now).position == pytest.approx([0, 0, 0])
    desk.tell(messages.SetMode(1, 1, AUTO[kind]))
    assert result(desk.tell(command(400, 1))) == 0
    assert height(desk, 3.0) > 0
    assert result(desk.tell(command(400, 0))) == 0
    assert height(desk, 2.0) == 0


@BOTH
def test_no_command_and_no_setpoint_brings_it_down(kind: MockKind) -> None:
    for value in (math.nan, math.inf, -1.0, 1e30):
        desk = desk_for(kind, a_mission(3))
        for number in (176, 224, 300, 400, 22, 511, 512, 16, 0, 65_535):
            desk.tell(command(number, *[value] * 7))
            assert only(desk.wait(2.0), messages.Heartbeat), number
    desk = desk_for(kind)
    stream(desk)
    assert result(desk.tell(messages.SetMode(1, 1, desk.machine.flight.modes.guided))) == 0
    assert result(desk.tell(command(400, 1))) == 0
    desk.tell(command(22, *[0] * 6, 20.0))
    for value in (0.0, math.nan, math.inf, 3e38, -3e38):
        for field in ("x", "vx", "afx"):
            wrong: dict[str, Any] = {field: value}
            desk.tell(replace(STILL, **wrong))
            assert only(desk.wait(0.5), messages.GlobalPositionInt)
    assert desk.machine.armed


@BOTH
def test_parameters(kind: MockKind) -> None:
    desk = desk_for(kind)
    values = desk.tell(messages.ParamRequestList(VEHICLE))
    assert [value.param_index for value in values] == list(range(len(values)))
    assert {value.param_count for value in values} == {len(values)}
    vehicle = desk.machine.vehicle
    told = {value.param_id: value_in(value, vehicle) for value in values}
    assert told.items() >= vehicle.defaults().items()
    second = values[1]
    assert desk.tell(messages.ParamRequestRead(VEHICLE, "", 1)) == [second]
    assert desk.tell(messages.ParamRequestRead(VEHICLE, second.param_id, -1)) == [second]
    assert desk.tell(messages.ParamRequestRead(VEHICLE, "NO_SUCH", -1)) == []
    assert desk.tell(messages.ParamRequestRead(VEHICLE, "", 999)) == []
    (changed,) = desk.tell(messages.ParamSet(VEHICLE, second.param_id, 7.0, 9))
    assert changed.param_value == 7.0
    if kind == "px4":  # takes no other type than it has
        assert desk.tell(messages.ParamSet(VEHICLE, "GF_ACTION", 3.0, 9)) == []
        (answer,) = desk.tell(messages.ParamSet(VEHICLE, "GF_ACTION", carried(3, 6, vehicle), 6))
        assert (value_in(answer, vehicle), answer.param_type) == (3, 6)


def test_a_reboot_keeps_what_is_stored() -> None:
    desk = desk_for("px4", a_mission(5), boot=2.0)
    desk.wait(3.0)
    take_off(desk, "px4")
    stream(desk)
    assert result(desk.tell(command(246, 1))) == 0
    assert result(desk.tell(messages.SetMode(1, 1, px4_mode(6, 0)))) == 1  # no setpoints since
    assert not desk.machine.armed
    assert result(desk.tell(command(400, 1))) == 1
    assert len(desk.machine.lists.items(MissionType.MISSION)) == 5
    desk.wait(2.5)
    assert result(desk.tell(command(400, 1))) == 0


OUT = Mission(
    (
        MissionItem(22, 3, x=HOME.latitude, y=HOME.longitude, z=20.0),
        MissionItem(16, 3, x=HOME.latitude + 0.002, y=HOME.longitude, z=20.0),
        MissionItem(20, 2),
    ),
    HOME,
    Fence(circles=(Circle((HOME.latitude, HOME.longitude), 100.0, inclusion=True),)),
)
"""To a place 222 m to the north of home, with a fence at 100 m."""

RTL, HOLD = 6, 4 << 16 | 3 << 24


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
    desk = desk_for(kind, OUT, parameters=parameters)
    take_off(desk, kind)
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
    # ArduPilot does not arm outside.
    away = Fence(circles=(Circle((HOME.latitude + 0.01, HOME.longitude), 100.0, inclusion=True),))
    desk = desk_for(kind, replace(OUT, fence=away), parameters=parameters)
    keeps = kind == "ardupilot" and bool(parameters)
    assert result(desk.tell(command(400, 1))) == (4 if keeps else 0)
