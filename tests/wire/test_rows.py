"""Missions as rows, rows as packets and back; what counts as the same mission."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from exchanges import EXCHANGES
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st
from judged import given
from pymavlink.dialects.v20 import common
from stations import FENCE, HOME, RALLY, VEHICLE, a_mission, rows_for, vehicle_of

from faao_mav.errors import InputError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import RallyPoint
from faao_mav.wire import messages
from faao_mav.wire.codec import Codec, Packet
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import GROUND_STATION, MissionType
from faao_mav.wire.wire_items import compare, mission_of, wire_items

MISSION, FENCES, RALLIES = MissionType


def message_of(packet: Packet) -> Any:
    assert packet.envelope is not None
    return packet.envelope.message


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
    """Numbers of items count it."""
    mission = a_mission(3)
    jump = MissionItem(177, 2, (1.0, 3.0, 0.0, 0.0))
    mission = replace(mission, items=(*mission.items, jump))
    home, *rest = wire_items(mission, MISSION, vehicle_of("ardupilot"))
    px4 = wire_items(mission, MISSION, vehicle_of("px4"))
    place = (-353_632_620, 1_491_652_370, 584.0)
    assert (home.command, home.frame, home.x, home.y, home.z) == (16, 0, *place)
    assert [row.command for row in px4] == [row.command for row in rest] == [22, 16, 20, 177]
    assert (
        [row.current for row in px4] == [row.current for row in (home, *rest[:3])] == [1, 0, 0, 0]
    )
    assert (rest[-1].params[0], px4[-1].params[0]) == (1, 0)
    for firmware, told in (("ardupilot", HOME), ("px4", None)):
        found = there_and_back(mission, firmware)
        assert (found.items[-1], found.home) == (jump, told)
        assert mission_of({MISSION: ()}, vehicle_of(firmware)) == Mission(())


def test_what_is_not_set_or_not_carried() -> None:
    yaw = MissionItem(16, 3, (0.0, 0.0, 0.0, math.nan), -35.0, 149.0, 20.0)
    assert math.isnan(wire_items(Mission((yaw,)), MISSION, vehicle_of("px4"))[0].params[3])
    assert wire_items(Mission((yaw,)), MISSION, vehicle_of("ardupilot"))[1].params == (0.0,) * 4
    low, nowhere = RallyPoint(-35.0, 149.0, math.nan), replace(yaw, x=math.nan, z=math.nan)
    for mission, part, told in (
        (Mission((nowhere,)), MISSION, r"latitude and altitude not set.* take for 0"),
        (Mission((MissionItem(183, 2, x=3e9),)), MISSION, "x 3000000000.0"),
        (Mission((MissionItem(16, 3, (1e39, 0, 0, 0)),)), MISSION, "single-precision"),
        (Mission((), rally=(low,)), RALLIES, "rally point 1: its altitude is not set"),
    ):
        for autopilot in ("ardupilot", "px4"):
            with pytest.raises(InputError, match=told):
                wire_items(mission, part, vehicle_of(autopilot))


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
@drawn(st.lists(items, min_size=1, max_size=5), st.sampled_from(["ardupilot", "px4"]))
def test_rows_hold_all_of_an_item_of_a_fence_and_of_a_rally_point(
    items: Any, firmware: str
) -> None:
    fence = replace(FENCE, breach_return=RallyPoint(-35.35, 149.15, 60.0))
    mission = Mission(tuple(items), Home(47.0, 8.5, 400.0), fence, RALLY)
    found = there_and_back(mission, firmware)
    assert (found.items, found.fence, found.rally) == (mission.items, fence, RALLY)


def test_a_damaged_packet_is_none_and_one_that_is_not_known_says_nothing() -> None:
    """The one that is not known is there for the log."""
    packet = bytearray(Codec(VEHICLE).pack(messages.Heartbeat(2, 3, 128, 3, 4)))
    packet[12] ^= 1
    assert Codec(GROUND_STATION).parse(bytes(packet)) == []
    unknown = common.MAVLink_vfr_hud_message(0, 0, 0, 0, 0, 0).pack(common.MAVLink(None, 1, 1))
    assert Codec(GROUND_STATION).parse(b"noise" + unknown) == [Packet(unknown, None)]


# ---- what is read back


def kinds(
    sent: Sequence[WireItem], found: Sequence[WireItem], firmware: str, part: MissionType = MISSION
) -> dict[tuple[int | None, str], str]:
    return {(d.item, d.field): d.kind for d in compare(sent, found, part, vehicle_of(firmware))}


def changed(rows: Sequence[WireItem], index: int, **changes: Any) -> tuple[WireItem, ...]:
    index %= len(rows)
    return (*rows[:index], replace(rows[index], **changes), *rows[index + 1 :])


def test_what_is_read_back_otherwise() -> None:
    table = (EXCHANGES / "read_back.tsv").read_text().splitlines()
    for line in (each for each in table if not each.startswith("#")):
        firmwares, *words, expected = line.split("\t")
        for firmware in firmwares.split():
            missions = (Mission(given(each).mission.items, HOME) for each in words)
            sent, back = (wire_items(each, MISSION, vehicle_of(firmware)) for each in missions)
            found = [kind[0] for kind in kinds(sent, back, firmware).values()]
            assert "w" in found if expected == "w" else found == expected.split(), line
    sent = rows_for("ardupilot", 5)
    for rows in (sent[:-1], (*sent, sent[-1]), ()):
        (difference,) = compare(sent, rows, MISSION, vehicle_of("ardupilot"))
        assert (difference.field, difference.kind, difference.sent) == ("count", "wrong", 5)
        assert difference.found == max(len(rows) - 1, 0)
    assert kinds(sent, changed(sent, -1, current=1), "ardupilot") == {}
    # ArduPilot's own home is told.
    moved = changed(sent, 0, x=-353_700_000)
    assert kinds(sent, moved, "ardupilot") == {(None, "home"): "dropped"}
    assert kinds(sent, changed(sent, 0, x=sent[0].x + 20), "ardupilot") == {}
    assert kinds(sent[1:], changed(sent[1:], 0, x=1), "px4")


def test_nothing_comes_after_a_fence_or_rally_point() -> None:
    for firmware in ("ardupilot", "px4", "generic"):
        for part in (FENCES, RALLIES):
            sent = wire_items(Mission((), HOME, FENCE, RALLY), part, vehicle_of(firmware))
            rows = [replace(row, autocontinue=0) for row in sent]
            assert kinds(sent, rows, firmware, part) == {}
            moved = changed(rows, 1, x=rows[1].x + 100)
            assert kinds(sent, moved, firmware, part) == {(1, "x"): "wrong"}
    fence = replace(FENCE, breach_return=RallyPoint(-35.36, 149.16, 30.0))
    sent = wire_items(Mission((), HOME, fence), FENCES, vehicle_of("ardupilot"))
    found = changed(sent, 0, z=0.0, frame=0, autocontinue=0)
    assert kinds(sent, found, "ardupilot", FENCES) == {(0, "z"): "dropped"}
