"""Missions as rows, rows as packets, and back."""

import dataclasses
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common
from stations import FENCE, HOME, RALLY, VEHICLE, a_mission, vehicle_of

from faao_mav.errors import InputError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import RallyPoint
from faao_mav.wire import messages
from faao_mav.wire.codec import Codec, Packet
from faao_mav.wire.protocol import GROUND_STATION, MissionType
from faao_mav.wire.wire_items import mission_of, wire_items

MISSION = MissionType.MISSION


def there_and_back(mission: Mission, firmware: str) -> Mission:
    """Return what comes of `mission` when its rows have gone through packets."""
    vehicle, codec = vehicle_of(firmware), Codec(VEHICLE)
    lists = {
        part: [
            message_of(found).item
            for row in wire_items(mission, part, vehicle)
            for found in codec.parse(codec.pack(messages.MissionItemInt(VEHICLE, part, 0, row)))
        ]
        for part in MissionType
    }
    return mission_of(lists, vehicle)


def test_home_is_row_0_of_ardupilot_and_no_row_of_px4() -> None:
    mission = a_mission(3)
    first, *rest = wire_items(mission, MISSION, vehicle_of("ardupilot"))
    assert (first.command, first.frame, first.z) == (16, 0, 584.0)
    assert (first.x, first.y) == (-353_632_620, 1_491_652_370)
    px4 = wire_items(mission, MISSION, vehicle_of("px4"))
    assert [row.command for row in px4] == [row.command for row in rest] == [22, 16, 20]
    assert [row.current for row in px4] == [1, 0, 0]
    assert [first.current, *(row.current for row in rest)] == [1, 0, 0, 0]
    jump = MissionItem(177, 2, (1.0, 3.0, 0.0, 0.0))
    mission = Mission((*mission.items, jump), HOME)
    assert wire_items(mission, MISSION, vehicle_of("ardupilot"))[-1].params[0] == 1
    assert wire_items(mission, MISSION, vehicle_of("px4"))[-1].params[0] == 0
    for firmware, home in (("ardupilot", HOME), ("px4", None)):
        found = there_and_back(mission, firmware)
        assert (found.items[-1], found.home) == (jump, home)
        assert mission_of({MISSION: ()}, vehicle_of(firmware)) == Mission(())


def test_what_is_not_set_or_not_carried() -> None:
    yaw = MissionItem(16, 3, (0.0, 0.0, 0.0, math.nan), -35.0, 149.0, 20.0)
    nowhere = dataclasses.replace(yaw, x=math.nan, z=math.nan)
    (row,) = wire_items(Mission((yaw,)), MISSION, vehicle_of("px4"))
    assert math.isnan(row.params[3])
    assert wire_items(Mission((yaw,)), MISSION, vehicle_of("ardupilot"))[1].params == (0.0,) * 4
    for autopilot in ("ardupilot", "px4"):
        with pytest.raises(InputError, match=r"latitude and altitude not set.* take for 0"):
            wire_items(Mission((nowhere,)), MISSION, vehicle_of(autopilot))
    for item, told in (
        (MissionItem(183, 2, x=3e9), "item 0: x 3000000000.0"),
        (MissionItem(16, 3, (1e39, 0.0, 0.0, 0.0)), "single-precision"),
    ):
        with pytest.raises(InputError, match=told):
            wire_items(Mission((item,)), MISSION, vehicle_of("px4"))
    low = RallyPoint(-35.0, 149.0, math.nan)
    with pytest.raises(InputError, match="rally point 1: its altitude is not set"):
        wire_items(Mission((), rally=(low,)), MissionType.RALLY, vehicle_of("px4"))


degrees = st.integers(-900_000_000, 900_000_000).map(lambda n: n / 1e7)
floats = st.floats(width=32, allow_nan=False, allow_infinity=False)
items = st.builds(
    MissionItem,
    st.sampled_from([16, 17, 19, 21, 22, 82]),
    st.sampled_from([0, 3]),
    st.tuples(floats, floats, floats, floats),
    degrees,
    degrees,
    floats,
    st.booleans(),
)


@settings(max_examples=15)
@given(st.lists(items, min_size=1, max_size=5), st.sampled_from(["ardupilot", "px4"]))
def test_rows_hold_all_of_an_item_of_a_fence_and_of_a_rally_point(
    items: Any, firmware: str
) -> None:
    fence = dataclasses.replace(FENCE, breach_return=RallyPoint(-35.35, 149.15, 60.0))
    mission = Mission(tuple(items), Home(47.0, 8.5, 400.0), fence, RALLY)
    found = there_and_back(mission, firmware)
    assert (found.items, found.fence, found.rally) == (mission.items, fence, RALLY)


MESSAGES: list[messages.Message] = [
    messages.Heartbeat(2, 3, 128, 3, 4),
    messages.Statustext(4, "Only 655 items are supported"),
    messages.MissionCount(GROUND_STATION, 0, 700),
    messages.MissionCurrent(5, 38, 3, 0xDEADBEEF),
    messages.MissionCurrent(5, 38, 3),
    messages.MissionAck(GROUND_STATION, 2, 4),
    messages.MissionRequestInt(GROUND_STATION, 1, 12),
    messages.MissionRequest(GROUND_STATION, 1, 12),
    messages.CommandLong(VEHICLE, 400, 0, 1.0),
    messages.ParamValue("WPNAV_SPEED", 1000.0, 9, 12, 3),
]


def message_of(packet: Packet) -> Any:
    assert packet.envelope is not None
    return packet.envelope.message


def test_messages_survive_the_wire() -> None:
    """But for one that is damaged; one that is not known says nothing, and is logged."""
    sender, receiver = Codec(VEHICLE), Codec(GROUND_STATION)
    sent = [sender.pack(message) for message in MESSAGES]
    found = [packet for data in sent for packet in receiver.parse(data)]
    assert [message_of(packet) for packet in found] == MESSAGES
    assert {packet.envelope and packet.envelope.sender for packet in found} == {VEHICLE}
    damaged = bytearray(sent[0])
    damaged[12] ^= 1
    assert receiver.parse(bytes(damaged)) == []
    unknown = common.MAVLink_vfr_hud_message(0, 0, 0, 0, 0, 0).pack(common.MAVLink(None, 1, 1))
    assert receiver.parse(b"noise" + unknown) == [Packet(unknown, None)]
