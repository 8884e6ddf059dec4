"""Mission files as the field has them: which are read, and what the others are told."""

import math
import re
from pathlib import Path

import pytest

from faao_mav.errors import MissionFileError
from faao_mav.mission import Home, Mission
from faao_mav.mission.fence import RallyPoint
from faao_mav.mission.formats import read_mission, read_mission_file

FOLDER = Path(__file__).parent.parent / "data" / "missions"

TAKEOFF = (22, (0, 0, 0, 0), 30)
SPEED = (178, (1, 5, -1, 0), 0)
WAYPOINT = (16, (10, 0, 0, 0), 30)
JUMP = (177, (3, 2, 0, 0), 0)
RTL = (20, (0, 0, 0, 0), 0)
FLIGHT = [TAKEOFF, SPEED, WAYPOINT, JUMP, RTL]
SURVEY = [TAKEOFF, SPEED, (16, (0, 0, 0, 0), 30), (206, (25, 0, 1, 0), 0),
          (16, (0, 0, 0, 0), 30), (206, (0, 0, 0, 0), 0), RTL]  # fmt: skip

READ = {
    "plain.waypoints": FLIGHT,
    "crlf.waypoints": FLIGHT,
    "bom.waypoints": FLIGHT,
    "no_last_newline.waypoints": FLIGHT,
    "spaces.waypoints": FLIGHT,
    "comments.waypoints": FLIGHT,
    "mavproxy.txt": FLIGHT,
    "mission_planner_home.waypoints": FLIGHT,
    "no_current.waypoints": FLIGHT,
    "nan_yaw.waypoints": FLIGHT,
    "home_in_frame_3.txt": FLIGHT,
    "gap.waypoints": [TAKEOFF, WAYPOINT, JUMP, RTL],
    "px4.plan": FLIGHT,
    "bom.plan": FLIGHT,
    "no_fence_no_rally.plan": FLIGHT,
    "fence_and_rally.plan": FLIGHT,
    "empty_rally_version_1.plan": FLIGHT,
    "jump_ids_with_gaps.plan": FLIGHT,
    "survey.plan": SURVEY,
    "corridor.plan": SURVEY,
}
REFUSED = {
    "nan_latitude.waypoints": "line 5, field latitude: 'nan'; expected a finite number from -90",
    "inf_altitude.waypoints": "line 5, field altitude: 'inf'; expected a finite number",
    "eleven_columns.waypoints": "line 5: 11 fields; expected 12, tab-separated: index current",
    "thirteen_columns.waypoints": "line 5: 13 fields; expected 12, tab-separated: index current",
    "two_current.waypoints": "line 4, field current: '1'; expected 0: line 2 is already current",
    "header_only.waypoints": "a header but no items; expected row 0, the home position",
    "no_home_row.waypoints": "line 2, field command: '22'; expected 16: row 0 is the home",
    "decimal_comma.waypoints": "line 5, field latitude: '-35,3625'; expected a finite number "
    "with a decimal point, not a comma from -90 to 90 degrees",
    "protobuf.waypoints": "line 1: 'QGC WPL PB 110'; expected 'QGC WPL 110'",
    "latin1.waypoints": "line 3: byte 0xe9 is not UTF-8; expected a text file",
    "nan_literal.plan": "mission.items[2].params[3]: nan; expected a finite number or null",
    "truncated.plan": "line 28, column 13: not JSON: Expecting value",
    "duplicate_key.plan": "key 'frame': is there twice in one object; remove one",
    "wrong_type.plan": "fileType: 'Mission'; expected 'Plan'",
    "plan_version_2.plan": "version: 2; expected 1: open the file in a current QGroundControl",
    "mission_version_1.plan": "mission.version: 1; expected 2: open the file in a current",
    "no_mission.plan": "mission: is missing",
    "six_params.plan": "[2].params: [10, 0, 0, None, 47.3985, 8.5461]; expected a list of 7",
    "text_latitude.plan": "items[2].params[4]: '47.3985'; expected a finite number or null (not",
    "scaled_latitude.plan": "mission.items[2].params[4]: 473985000; expected null or degrees",
    "jump_to_nowhere.plan": "mission.items[3].params[0]: 9; expected the doJumpId of an item",
    "fence_of_two_corners.plan": "geoFence.polygons[0]: fence polygon: 2 vertices; exp",
    "fence_version_1.plan": "geoFence.version: 1; expected 2: open the file in a current",
    "survey_without_items.plan": "mission.items[2].TransectStyleComplexItem.Items: is missing: "
    "the pattern was saved without its waypoints; open the file in a current QGroundControl",
    "structure_scan.plan": "mission.items[2].complexItemType: 'StructureScan'; expected "
    "'survey' or 'CorridorScan', or simple items: replace the pattern by waypoints, or upload",
    "landing_pattern.plan": "mission.items[2].complexItemType: 'fwLandingPattern'; expected 'sur",
    "unknown_item_type.plan": "items[2].type: 'missionItem'; expected 'SimpleItem' or 'Complex",
    "not_an_object.plan": "nothing; expected an object",
}


def outline(mission: Mission) -> list[tuple[int, tuple[float, ...], float]]:
    # NaN, a yaw that is not set, is in some of the files and 0 in the others.
    return [
        (item.command, tuple(0 if math.isnan(p) else p for p in item.params), item.z)
        for item in mission.items
    ]


def test_every_file_is_accounted_for() -> None:
    assert sorted(READ | REFUSED) == sorted(path.name for path in FOLDER.iterdir())


def test_the_sound_ones_are_read_the_odd_ones_with_warnings() -> None:
    files = {name: read_mission_file(FOLDER / name) for name in READ}
    assert {name: outline(file.mission) for name, file in files.items()} == READ
    assert all(file.mission.home is not None for file in files.values())
    warned = {name for name, file in files.items() if file.warnings}
    assert warned == {"gap.waypoints", "home_in_frame_3.txt"}
    told = files["fence_and_rally.plan"]
    assert (told.firmware, told.vehicle_type) == (12, 2)
    assert told.mission.home == Home(47.397742, 8.545594, 488.2)
    assert told.mission.fence.breach_return == RallyPoint(47.3975, 8.5455, 50.0)


def test_the_others_are_refused() -> None:
    for name, told in REFUSED.items():
        with pytest.raises(MissionFileError, match=re.escape(told)) as caught:
            read_mission(FOLDER / name)
        assert str(caught.value).startswith(f"{FOLDER / name}: ")
        assert "\n" not in str(caught.value)
