"""The rest of the mock autopilot: heartbeats, commands, parameters, flight."""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar, cast

import numpy as np
import pytest
from mock_flights import fly
from stations import HOME, VEHICLE, Desk, a_mission, vehicle_of

from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.px4 import PX4, px4_mode
from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.wire.messages import (
    AutopilotVersion,
    CommandAck,
    CommandLong,
    Envelope,
    GlobalPositionInt,
    Heartbeat,
    HomePosition,
    LocalPositionNed,
    Message,
    MissionClearAll,
    MissionCurrent,
    MissionItemReached,
    MissionSetCurrent,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
    SetMode,
    SetPositionTargetLocalNed,
    Statustext,
)
from faao_mav.wire.parameters import setting_in
from faao_mav.wire.protocol import GROUND_STATION, Address, MavResult, MissionType
from faao_mav.wire.wire_items import wire_items

T = TypeVar("T", bound=Message)

TO = VEHICLE
MISSION = (MissionType.MISSION, vehicle_of("ardupilot"))
BOTH = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
AUTO = {"ardupilot": 3, "px4": 4 << 16 | 4 << 24}


STILL = SetPositionTargetLocalNed(VEHICLE, 0, 1, 3072, 0, 0, -20.0, 0, 0, 0, 0, 0, 0)
"""A setpoint 20 m above home."""


def desk_for(kind: MockKind, mission: Mission | None = None, **options: Any) -> Desk:
    mock = MockAutopilot(behaviour_of(kind), home=HOME, fly=fly, **options)
    desk = Desk(mock, GROUND_STATION)
    desk.start()
    if mission is not None:
        rows = wire_items(mission, MissionType.MISSION, vehicle_of(kind))
        mock.lists.replace(MissionType.MISSION, rows)
    return desk


def command(number: int, *params: float) -> CommandLong:
    return CommandLong(TO, number, 0, *map(float, params))


def result(messages: Sequence[Message]) -> int:
    (ack,) = [message for message in messages if isinstance(message, CommandAck)]
    return ack.result


def only(messages: Sequence[Message], kind: type[T]) -> list[T]:
    return [message for message in messages if isinstance(message, kind)]


def stream(desk: Desk) -> None:
    """Send setpoints for two seconds."""
    for _ in range(20):
        desk.tell(STILL)
        desk.wait(0.1)


def take_off(desk: Desk, kind: MockKind) -> None:
    assert result(desk.tell(command(400, 1))) == 0
    assert result(desk.tell(SetMode(1, 1, AUTO[kind]))) == 0


@BOTH
def test_a_heartbeat_a_second_that_tells_booting_from_ready(kind: MockKind) -> None:
    desk = desk_for(kind, boot=3.0)
    desk.wait(6.0)
    beats = only(desk.sent, Heartbeat)
    assert [beat.system_status for beat in beats] == [2, 2, 2, 3, 3, 3, 3]
    assert {beat.autopilot for beat in beats} == {3 if kind == "ardupilot" else 12}


@BOTH
def test_a_whole_flight(kind: MockKind) -> None:
    mission = a_mission(12)
    desk = desk_for(kind, mission, speedup=10.0)
    take_off(desk, kind)
    assert desk.machine.armed
    out = desk.wait(60.0)
    assert not desk.machine.armed
    first = 1 if kind == "ardupilot" else 0
    reached = [message.seq for message in only(out, MissionItemReached)]
    assert reached == [*range(first, first + 11), first + 11]
    heights = [message.relative_alt / 1000 for message in only(out, GlobalPositionInt)]
    assert max(heights) == pytest.approx(30.0, abs=0.1)
    assert heights[-1] == 0
    currents = [message.seq for message in only(out, MissionCurrent)]
    assert currents == sorted(currents)
    assert only(out, Heartbeat)[-1].base_mode & 128 == 0


def test_a_plane_has_its_own_number_modes_and_storage() -> None:
    items = list(a_mission(5).items)
    items[2] = dataclasses.replace(items[2], params=(7.0, 40.0, 0.0, 0.0))
    desk = desk_for("ardupilot", Mission(tuple(items), HOME), aircraft="plane", speedup=20.0)
    assert result(desk.tell(command(400, 1))) == 0
    assert result(desk.tell(SetMode(1, 1, AUTO["ardupilot"]))) == 0  # TRAINING, for a plane
    assert only(desk.wait(2.0), GlobalPositionInt)[-1].relative_alt == 0
    assert result(desk.tell(SetMode(1, 1, 10))) == 0
    assert only(desk.wait(2.0), GlobalPositionInt)[-1].relative_alt > 0
    assert only(desk.wait(1.5), Heartbeat)[-1].type == 1
    row = wire_items(Mission(tuple(items), HOME), *MISSION)[3]
    kept = desk.machine.lists.kept(MissionType.MISSION, 3, row)
    assert kept.params[:2] == (0.0, 40.0)


def test_positions_are_those_of_the_track() -> None:
    mission = a_mission(12)
    desk = desk_for("px4", mission)
    take_off(desk, "px4")
    desk.wait(5.0)
    track = fly(mission)
    (place,) = only(desk.wait(0.3), GlobalPositionInt)
    (local,) = only(desk.sent[-4:], LocalPositionNed)
    up = np.interp(place.time_boot_ms / 1000, track.t, track.position[:, 2])
    assert place.relative_alt / 1000 == pytest.approx(up, abs=0.01)
    assert place.alt - place.relative_alt == 584_000
    assert local.z == pytest.approx(-place.relative_alt / 1000, abs=1e-3)
    assert (local.vz < 0) == (place.vz < 0)


def test_a_waypoint_before_a_do_item_is_told_by_the_do_items_number() -> None:
    items = list(a_mission(4).items)
    items.insert(2, MissionItem(178, 2, (1.0, 5.0, -1.0, 0.0)))
    desk = desk_for("ardupilot", Mission(tuple(items), HOME), speedup=50.0)
    take_off(desk, "ardupilot")
    out = desk.wait(20.0)
    # Numbers with home: take-off 1, waypoint 2 (told as 3, the speed), waypoint 4, return 5.
    assert [message.seq for message in only(out, MissionItemReached)] == [1, 3, 4, 5]


@BOTH
def test_it_does_not_fly_without_being_armed_and_told_to(kind: MockKind) -> None:
    desk = desk_for(kind, a_mission(5))
    assert result(desk.tell(SetMode(1, 1, AUTO[kind]))) == 0
    assert only(desk.wait(5.0), GlobalPositionInt)[-1].relative_alt == 0
    desk = desk_for(kind, a_mission(5))
    assert result(desk.tell(command(400, 1))) == 0
    assert only(desk.wait(5.0), GlobalPositionInt)[-1].relative_alt == 0
    assert result(desk.tell(command(300))) == 0
    assert only(desk.wait(5.0), GlobalPositionInt)[-1].relative_alt > 0


@BOTH
def test_without_a_mission_there_is_nothing_to_fly(kind: MockKind) -> None:
    desk = desk_for(kind)
    assert result(desk.tell(SetMode(1, 1, AUTO[kind]))) == {"ardupilot": 4, "px4": 1}[kind]
    assert result(desk.tell(command(300))) == 2


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


def test_px4_takes_what_it_will_not_fly() -> None:
    mission = a_mission(5)
    low = dataclasses.replace(mission.items[0], z=0.0)
    for items in (
        (low, *mission.items[1:]),
        (*mission.items[1:3], mission.items[0], mission.items[3]),
        (MissionItem(21, 3, x=-35.0, y=149.0), *mission.items[1:]),
        (*mission.items, MissionItem(112, 2, (5.0, 0.0, 0.0, 0.0))),
    ):
        desk = desk_for("px4", Mission(items, HOME))
        assert result(desk.tell(command(176, 1, 4, 4))) == 1
    assert result(desk_for("px4", mission).tell(command(176, 1, 4, 4))) == 0


def test_ardupilot_does_not_clear_what_it_flies() -> None:
    desk = desk_for("ardupilot", a_mission(5))
    take_off(desk, "ardupilot")
    (ack,) = desk.tell(MissionClearAll(TO, 0))
    assert ack.type == MavResult.ERROR


@BOTH
def test_a_mission_is_broken_off_and_flown_on(kind: MockKind) -> None:
    """In another mode it holds its place, or returns; disarmed it stands at home."""
    desk = desk_for(kind, a_mission(12))
    take_off(desk, kind)
    desk.tell(SetMode(1, 1, 0))
    assert only(desk.wait(2.0), GlobalPositionInt)[-1].relative_alt == 0
    assert result(desk.tell(SetMode(1, 1, AUTO[kind]))) == 0
    desk.wait(20.0)
    there = desk.machine.posture(desk.now)
    desk.tell(SetMode(1, 1, 0))
    desk.wait(20.0)
    held = desk.machine.posture(desk.now)
    assert held.position == pytest.approx(there.position, abs=0.1)
    assert held.item == there.item
    desk.tell(SetMode(1, 1, AUTO[kind]))
    assert not only(desk.wait(1.0), Statustext)
    desk.tell(SetMode(1, 1, desk.machine.flight.modes.at_fence["return"]))
    assert "Landed, disarming" in [text.text for text in only(desk.wait(300.0), Statustext)]
    assert desk.machine.posture(desk.now).position == pytest.approx([0, 0, 0])
    desk.tell(SetMode(1, 1, AUTO[kind]))
    assert result(desk.tell(command(400, 1))) == 0
    assert only(desk.wait(3.0), GlobalPositionInt)[-1].relative_alt > 0
    assert result(desk.tell(command(400, 0))) == 0
    assert only(desk.wait(2.0), GlobalPositionInt)[-1].relative_alt == 0


@BOTH
def test_what_ground_stations_ask_for(kind: MockKind) -> None:
    desk = desk_for(kind)
    ack, version = desk.tell(command(512, 148))
    assert (ack.result, type(version)) == (0, AutopilotVersion)
    assert version.capabilities & 4
    ack, home = desk.tell(command(512, 242))
    assert home == HomePosition(-353_632_620, 1_491_652_370, 584_000)
    assert result(desk.tell(command(512, 30))) == 3
    assert result(desk.tell(command(511, 33, 1e5))) == 0
    assert result(desk.tell(command(520, 1))) == 0
    assert result(desk.tell(command(31_000))) == 3


@BOTH
def test_no_command_brings_it_down(kind: MockKind) -> None:
    nan, inf = float("nan"), float("inf")
    for value in (nan, inf, -1.0, 1e30):
        desk = desk_for(kind, a_mission(3))
        for number in (176, 224, 300, 400, 22, 511, 512, 520, 16, 0, 65_535):
            desk.tell(command(number, *[value] * 7))
            assert only(desk.wait(2.0), Heartbeat), number


@BOTH
def test_no_setpoint_brings_it_down(kind: MockKind) -> None:
    desk = desk_for(kind)
    stream(desk)
    assert result(desk.tell(SetMode(1, 1, desk.machine.flight.modes.guided))) == 0
    assert result(desk.tell(command(400, 1))) == 0
    desk.tell(command(22, *[0] * 6, 20.0))
    for value in (0.0, math.nan, math.inf, 3e38, -3e38):
        for field in ("x", "vx", "afx"):
            wrong: dict[str, Any] = {field: value}
            desk.tell(replace(STILL, **wrong))
            assert only(desk.wait(0.5), GlobalPositionInt)
    assert desk.machine.armed


def test_where_it_has_come_to_it_is_due_for_its_reports_only() -> None:
    mock, now = desk_for("ardupilot").machine, 0.0
    for message in (SetMode(1, 1, 4), command(400, 1), command(22, *[0] * 6, 20.0)):
        assert result(mock.on(Envelope(GROUND_STATION, message), now)) == 0
    for _ in range(150):  # of the position four times a second, and heartbeats
        now = mock.deadline
        mock.tick(now)
    assert now > 25.0
    assert mock.posture(now).position[2] == pytest.approx(20.0)


@BOTH
def test_parameters(kind: MockKind) -> None:
    desk = desk_for(kind)
    values = desk.tell(ParamRequestList(TO))
    assert [value.param_index for value in values] == list(range(len(values)))
    assert {value.param_count for value in values} == {len(values)}
    vehicle = desk.machine.vehicle
    told = {value.param_id: setting_in(value, vehicle).value for value in values}
    assert told.items() >= vehicle.defaults().items()
    second = values[1]
    assert desk.tell(ParamRequestRead(TO, "", 1)) == [second]
    assert desk.tell(ParamRequestRead(TO, second.param_id, -1)) == [second]
    assert desk.tell(ParamRequestRead(TO, "NO_SUCH", -1)) == []
    assert desk.tell(ParamRequestRead(TO, "", 999)) == []
    (changed,) = desk.tell(ParamSet(TO, second.param_id, 7.0, 9))
    assert isinstance(changed, ParamValue)
    assert changed.param_value == 7.0


@BOTH
def test_the_current_item(kind: MockKind) -> None:
    desk = desk_for(kind, a_mission(5))
    (current,) = desk.tell(MissionSetCurrent(TO, 3))
    assert (current.seq, current.total) == (3, 5)
    assert desk.tell(MissionSetCurrent(TO, 99)) == []
    assert result(desk.tell(command(224, 2))) == 0
    assert result(desk.tell(command(224, 99))) == 2


def test_a_reboot_keeps_what_is_stored() -> None:
    desk = desk_for("px4", a_mission(5), boot=2.0)
    desk.wait(3.0)
    take_off(desk, "px4")
    stream(desk)
    assert result(desk.tell(command(246, 1))) == 0
    assert result(desk.tell(SetMode(1, 1, px4_mode(6, 0)))) == 1  # no setpoints since
    assert not desk.machine.armed
    assert result(desk.tell(command(400, 1))) == 1
    assert len(desk.machine.lists.items(MissionType.MISSION)) == 5
    desk.wait(2.5)
    assert result(desk.tell(command(400, 1))) == 0


def test_commands_to_others_are_not_obeyed() -> None:
    desk = desk_for("px4")
    assert desk.tell(CommandLong(Address(2, 1), 400, 0, 1.0)) == []
    assert desk.tell(CommandLong(Address(1, 154), 400, 0, 1.0)) == []
    assert not desk.machine.armed


HEIGHT = 20.0
OUT = Mission(
    (
        MissionItem(22, 3, x=HOME.latitude, y=HOME.longitude, z=HEIGHT),
        MissionItem(16, 3, x=HOME.latitude + 0.002, y=HOME.longitude, z=HEIGHT),
        MissionItem(20, 2),
    ),
    HOME,
    Fence(circles=(Circle((HOME.latitude, HOME.longitude), 100.0, inclusion=True),)),
)
"""To a place 222 m to the north of home, with a fence at 100 m."""


def breach(kind: MockKind, **parameters: float) -> Desk:
    """Fly `OUT` for five minutes."""
    desk = desk_for(kind, OUT, rate=4.0, parameters=parameters)
    rows = wire_items(OUT, MissionType.FENCE, vehicle_of(kind))
    desk.machine.lists.replace(MissionType.FENCE, rows)
    take_off(desk, kind)
    desk.wait(300.0)
    return desk


def farthest_and_last(desk: Desk) -> tuple[float, float, float]:
    """Return how far north it got, m, and where it ended, metres north and up."""
    places = only(desk.sent, GlobalPositionInt)
    north = [(place.lat * 1e-7 - HOME.latitude) * 111_000 for place in places]
    return max(north), north[-1], places[-1].relative_alt / 1000


def test_ardupilot_goes_home_from_its_fence() -> None:
    desk = breach("ardupilot", FENCE_ENABLE=1)
    north, end, height = farthest_and_last(desk)
    assert 100 < north < 125
    assert (end, height) == pytest.approx((0, 0), abs=0.1)
    assert not desk.machine.armed
    modes = [beat.custom_mode for beat in only(desk.sent, Heartbeat)]
    assert list(dict.fromkeys(modes)) == [0, 3, 6]
    texts = [text.text for text in only(desk.sent, Statustext)]
    assert texts == ["Polygon fence breached", "Landed, disarming"]


def test_px4_holds_at_its_fence() -> None:
    desk = breach("px4")
    north, end, height = farthest_and_last(desk)
    assert 100 < north < 125
    assert 100 < end < north
    assert height == pytest.approx(HEIGHT)
    assert desk.machine.armed
    assert only(desk.sent, Heartbeat)[-1].custom_mode == 4 << 16 | 3 << 24


def test_px4_may_be_told_to_return_or_land() -> None:
    _, end, height = farthest_and_last(breach("px4", GF_ACTION=3))
    assert (end, height) == pytest.approx((0, 0), abs=0.1)
    north, end, height = farthest_and_last(breach("px4", GF_ACTION=5))
    assert (end, height) == pytest.approx((north, 0), abs=0.1)


def test_a_fence_that_is_not_to_be_kept() -> None:
    for kind, parameters, told in (
        ("ardupilot", {}, False),
        ("ardupilot", {"FENCE_ENABLE": 1, "FENCE_ACTION": 0}, True),
        ("px4", {"GF_ACTION": 0}, False),
        ("px4", {"GF_ACTION": 1}, True),
    ):
        desk = breach(cast(MockKind, kind), **cast(dict[str, float], parameters))
        north, end, height = farthest_and_last(desk)
        assert north == pytest.approx(222, abs=1)
        assert (end, height) == pytest.approx((0, 0), abs=0.1)
        assert told == any("ence" in text.text for text in only(desk.sent, Statustext))


def test_ardupilot_does_not_arm_outside_its_fence() -> None:
    away = Fence(circles=(Circle((HOME.latitude + 0.01, HOME.longitude), 100.0, inclusion=True),))
    for kind, parameters, expected in (
        ("ardupilot", {"FENCE_ENABLE": 1}, 4),
        ("ardupilot", {}, 0),
        ("px4", {}, 0),
    ):
        desk = desk_for(cast(MockKind, kind), OUT, parameters=parameters)
        rows = wire_items(replace(OUT, fence=away), MissionType.FENCE, vehicle_of(kind))
        desk.machine.lists.replace(MissionType.FENCE, rows)
        assert result(desk.tell(command(400, 1))) == expected
