"""What counts as the same mission, and what does not."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import pytest
from stations import FENCE, HOME, RALLY, rows_for, vehicle_of

from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.fence import RallyPoint
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.transfer.verify import compare
from faao_mav.wire.wire_items import wire_items

MISSION = MissionType.MISSION


def kinds(
    sent: Sequence[WireItem], found: Sequence[WireItem], firmware: str, part: MissionType = MISSION
) -> dict[tuple[int | None, str], str]:
    return {(d.item, d.field): d.kind for d in compare(sent, found, part, vehicle_of(firmware))}


def rows_with(firmware: str, *items: MissionItem) -> tuple[WireItem, ...]:
    return wire_items(Mission(items, HOME), MISSION, vehicle_of(firmware))


def changed(rows: Sequence[WireItem], index: int, **changes: Any) -> tuple[WireItem, ...]:
    return (*rows[:index], dataclasses.replace(rows[index], **changes), *rows[index + 1 :])


WAYPOINT = MissionItem(16, 3, (2.7, 5.0, 1.5, 30.0), -35.0, 149.0, 20.0)


@pytest.mark.parametrize(
    ("firmware", "params", "dropped"),
    [
        ("ardupilot", (2.0, 0.0, 0.0, 0.0), {"param1", "param2", "param3", "param4"}),
        ("px4", (2.7, 5.0, 0.0, 30.0), {"param3"}),
    ],
)
def test_what_storage_loses_is_told_and_no_error(firmware: str, params: Any, dropped: Any) -> None:
    sent = rows_with(firmware, WAYPOINT)
    found = changed(sent, len(sent) - 1, params=params)
    assert kinds(sent, found, firmware) == {(0, field): "dropped" for field in dropped}


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_anything_else_is_wrong(firmware: str) -> None:
    sent = rows_with(firmware, WAYPOINT)
    changes: tuple[dict[str, Any], ...] = (
        {"params": (3.0, 5.0, 1.5, 30.0)},
        {"params": (2.7, 5.0, 1.5, 31.0)},
        {"x": -350_000_005},
        {"z": 20.05},
        {"command": 82},
        {"frame": 0},
        {"frame": 5},
    )
    for change in changes:
        found = changed(sent, len(sent) - 1, **change)
        assert "wrong" in kinds(sent, found, firmware).values(), change


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_the_same_in_other_words(firmware: str) -> None:
    sent = rows_with(firmware, MissionItem(16, 3, (2.0, 0.0, 0.0, 0.0), -35.0, 149.0, 20.0))
    changes: tuple[dict[str, Any], ...] = (
        {},
        {"x": -349_999_999},
        {"z": 20.009},
        {"frame": 6},
        {"current": 1},
    )
    for change in changes:
        assert kinds(sent, changed(sent, len(sent) - 1, **change), firmware) == {}, change


def test_a_command_without_a_place_comes_back_from_ardupilot_in_frame_0() -> None:
    sent = rows_with("ardupilot", MissionItem(178, 2, (1.0, 5.0, -1.0, 0.0)))
    assert kinds(sent, changed(sent, 1, frame=0), "ardupilot") == {}
    assert kinds(sent, changed(sent, 1, frame=0), "px4") != {}


def test_not_set_may_read_back_as_nothing() -> None:
    sent = rows_with("px4", MissionItem(16, 3, (math.nan,) * 4, -35.0, 149.0, 20.0))
    assert kinds(sent, sent, "px4") == {}
    assert kinds(sent, changed(sent, 0, params=(0.0,) * 4), "px4") == {}
    assert kinds(sent, changed(sent, 0, params=(0.0, 0.0, 0.0, 1.0)), "px4")[0, "param4"] == "wrong"


def test_single_precision_is_precise_enough() -> None:
    sent = rows_with("px4", MissionItem(16, 3, (0.1, 0.0, 0.0, 0.3), -35.0, 149.0, 1234.567))
    found = changed(sent, 0, params=(0.10000000149011612, 0.0, 0.0, 0.30000001192092896))
    assert kinds(sent, changed(found, 0, z=1234.5670166015625), "px4") == {}


def test_missing_and_surplus_items() -> None:
    sent = rows_for("ardupilot", 5)
    for found in (sent[:-1], (*sent, sent[-1]), ()):
        (difference,) = compare(sent, found, MISSION, vehicle_of("ardupilot"))
        assert (difference.field, difference.kind) == ("count", "wrong")
        assert difference.sent == 5
    assert compare(sent, (), MISSION, vehicle_of("ardupilot"))[0].found == 0


def test_ardupilots_own_home_is_told() -> None:
    sent = rows_for("ardupilot", 3)
    found = changed(sent, 0, x=-353_700_000)
    (difference,) = compare(sent, found, MISSION, vehicle_of("ardupilot"))
    assert (difference.item, difference.field, difference.kind) == (None, "home", "dropped")
    assert compare(sent, changed(sent, 0, x=sent[0].x + 20), MISSION, vehicle_of("ardupilot")) == ()
    assert kinds(rows_for("px4", 3), changed(rows_for("px4", 3), 0, x=1), "px4")


def test_of_commands_that_are_not_known_numbers_may_be_lost_but_not_replaced() -> None:
    sent = rows_with("ardupilot", MissionItem(183, 2, (9.0, 1500.0, 2.0, 0.0)))
    lost = changed(sent, 1, frame=0, params=(9.0, 1500.0, 0.0, 0.0))
    assert kinds(sent, lost, "ardupilot") == {(0, "param3"): "dropped"}
    other = changed(sent, 1, frame=0, params=(9.0, 1600.0, 2.0, 0.0))
    assert kinds(sent, other, "ardupilot") == {(0, "param2"): "wrong"}


def test_a_generic_autopilot_is_excused_nothing() -> None:
    sent = rows_with("generic", WAYPOINT)
    found = changed(sent, 0, params=(2.0, 5.0, 1.5, 30.0))
    assert kinds(sent, found, "generic") == {(0, "param1"): "wrong"}


def test_differences_in_words() -> None:
    sent = rows_with("ardupilot", WAYPOINT)
    found = changed(sent, 1, params=(2.0, 0.0, 0.0, 0.0), x=-350_100_000)
    words = [str(each) for each in compare(sent, found, MISSION, vehicle_of("ardupilot"))]
    assert "mission item 0: param1 2.7 is kept as 2.0" in words
    assert "mission item 0: x: sent -35.0, found -35.01" in words


@pytest.mark.parametrize("firmware", ["ardupilot", "px4", "generic"])
@pytest.mark.parametrize("part", [MissionType.FENCE, MissionType.RALLY])
def test_nothing_comes_after_a_fence_or_rally_point(firmware: str, part: MissionType) -> None:
    sent = wire_items(Mission((), HOME, FENCE, RALLY), part, vehicle_of(firmware))
    found = [dataclasses.replace(row, autocontinue=0) for row in sent]
    assert kinds(sent, found, firmware, part) == {}
    assert kinds(sent, changed(found, 1, x=found[1].x + 100), firmware, part) == {(1, "x"): "wrong"}


def test_what_a_fence_loses_is_told() -> None:
    fence = dataclasses.replace(FENCE, breach_return=RallyPoint(-35.36, 149.16, 30.0))
    sent = wire_items(Mission((), HOME, fence), MissionType.FENCE, vehicle_of("ardupilot"))
    found = changed(sent, 0, z=0.0, frame=0, autocontinue=0)
    assert kinds(sent, found, "ardupilot", MissionType.FENCE) == {(0, "z"): "dropped"}
