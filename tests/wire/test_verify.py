"""What counts as the same mission, and what does not."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, cast

from stations import FENCE, HOME, RALLY, rows_for, vehicle_of

from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.fence import RallyPoint
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import compare, wire_items

MISSION = MissionType.MISSION
WAYPOINT = MissionItem(16, 3, (2.7, 5.0, 1.5, 30.0), -35.0, 149.0, 20.0)
PLAIN = MissionItem(16, 3, (2.0, 0.0, 0.0, 0.0), -35.0, 149.0, 20.0)
SPEED = MissionItem(178, 2, (1.0, 5.0, -1.0, 0.0))
GRIPPER = MissionItem(183, 2, (9.0, 1500.0, 2.0, 0.0))
UNSET = MissionItem(16, 3, (math.nan,) * 4, -35.0, 149.0, 20.0)
FINE = MissionItem(16, 3, (0.1, 0.0, 0.0, 0.3), -35.0, 149.0, 1234.567)


def kinds(
    sent: Sequence[WireItem], found: Sequence[WireItem], firmware: str, part: MissionType = MISSION
) -> dict[tuple[int | None, str], str]:
    return {(d.item, d.field): d.kind for d in compare(sent, found, part, vehicle_of(firmware))}


def rows_with(firmware: str, *items: MissionItem) -> tuple[WireItem, ...]:
    return wire_items(Mission(items, HOME), MISSION, vehicle_of(firmware))


def changed(rows: Sequence[WireItem], index: int, **changes: Any) -> tuple[WireItem, ...]:
    index %= len(rows)
    return (*rows[:index], dataclasses.replace(rows[index], **changes), *rows[index + 1 :])


def test_what_is_read_back_otherwise() -> None:
    for firmwares, item, change, expected in (
        # What storage loses is told, and no error.
        ("ardupilot", WAYPOINT, {"params": (2.0, 0.0, 0.0, 0.0)}, "d d d d"),
        ("px4", WAYPOINT, {"params": (2.7, 5.0, 0.0, 30.0)}, "d"),
        ("generic", WAYPOINT, {"params": (2.0, 5.0, 1.5, 30.0)}, "w"),
        # Anything else is wrong.
        ("ardupilot px4", WAYPOINT, {"params": (3.0, 5.0, 1.5, 30.0)}, "w"),
        ("ardupilot px4", PLAIN, {"x": -350_000_005}, "w"),
        ("ardupilot px4", PLAIN, {"z": 20.05}, "w"),
        ("ardupilot px4", PLAIN, {"frame": 0}, "w"),
        # The same in other words.
        ("ardupilot px4", PLAIN, {"z": 20.009}, ""),
        ("ardupilot px4", PLAIN, {"frame": 6}, ""),
        ("ardupilot px4", PLAIN, {"current": 1}, ""),
        ("px4", FINE, {"params": (0.10000000149011612, 0.0, 0.0, 0.30000001192092896)}, ""),
        # A command without a place comes back from ArduPilot in frame 0.
        ("ardupilot", SPEED, {"frame": 0}, ""),
        ("px4", SPEED, {"frame": 0}, "w"),
        # Not set may read back as nothing.
        ("px4", UNSET, {"params": (0.0,) * 4}, ""),
        ("px4", UNSET, {"params": (0.0, 0.0, 0.0, 1.0)}, "w"),
        # Of commands that are not known numbers may be lost, but not replaced.
        ("ardupilot", GRIPPER, {"frame": 0, "params": (9.0, 1500.0, 0.0, 0.0)}, "d"),
        ("ardupilot", GRIPPER, {"frame": 0, "params": (9.0, 1600.0, 2.0, 0.0)}, "w"),
    ):
        for firmware in firmwares.split():
            sent, given = rows_with(firmware, item), cast(dict[str, Any], change)
            found = kinds(sent, changed(sent, -1, **given), firmware).values()
            if expected == "w":
                assert "wrong" in found, (item, change)
            else:
                assert [kind[0] for kind in found] == expected.split(), (item, change)


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
    assert kinds(sent, found, "ardupilot") == {(None, "home"): "dropped"}
    assert kinds(sent, changed(sent, 0, x=sent[0].x + 20), "ardupilot") == {}
    assert kinds(rows_for("px4", 3), changed(rows_for("px4", 3), 0, x=1), "px4")


def test_nothing_comes_after_a_fence_or_rally_point() -> None:
    for firmware in ("ardupilot", "px4", "generic"):
        for part in (MissionType.FENCE, MissionType.RALLY):
            sent = wire_items(Mission((), HOME, FENCE, RALLY), part, vehicle_of(firmware))
            rows = [dataclasses.replace(row, autocontinue=0) for row in sent]
            assert kinds(sent, rows, firmware, part) == {}
            moved = changed(rows, 1, x=rows[1].x + 100)
            assert kinds(sent, moved, firmware, part) == {(1, "x"): "wrong"}
    fence = dataclasses.replace(FENCE, breach_return=RallyPoint(-35.36, 149.16, 30.0))
    sent = wire_items(Mission((), HOME, fence), MissionType.FENCE, vehicle_of("ardupilot"))
    found = changed(sent, 0, z=0.0, frame=0, autocontinue=0)
    assert kinds(sent, found, "ardupilot", MissionType.FENCE) == {(0, "z"): "dropped"}
