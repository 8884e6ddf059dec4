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
EXPECTED = dict(line.split("\t") for line in (FOLDER / "expected.tsv").read_text().splitlines()[1:])

TAKEOFF = (22, (0, 0, 0, 0), 30)
SPEED = (178, (1, 5, -1, 0), 0)
WAYPOINT, CORNER = (16, (10, 0, 0, 0), 30), (16, (0, 0, 0, 0), 30)
JUMP = (177, (3, 2, 0, 0), 0)
RTL = (20, (0, 0, 0, 0), 0)
OUTLINES = {
    "flight": [TAKEOFF, SPEED, WAYPOINT, JUMP, RTL],
    "gap": [TAKEOFF, WAYPOINT, JUMP, RTL],
    "survey": [TAKEOFF, SPEED, CORNER, (206, (25, 0, 1, 0), 0), CORNER, (206, (0,) * 4, 0), RTL],
}


def outline(mission: Mission) -> list[tuple[int, tuple[float, ...], float]]:
    # NaN, a yaw that is not set, is in some of the files and 0 in the others.
    return [
        (item.command, tuple(0 if math.isnan(p) else p for p in item.params), item.z)
        for item in mission.items
    ]


def test_the_sound_ones_are_read_the_others_are_told() -> None:
    assert {*EXPECTED, "expected.tsv"} == {path.name for path in FOLDER.iterdir()}
    warned = set()
    for name, told in EXPECTED.items():
        if told in OUTLINES:
            file = read_mission_file(FOLDER / name)
            assert outline(file.mission) == OUTLINES[told], name
            assert file.mission.home is not None
            warned |= {name} if file.warnings else set()
        else:
            with pytest.raises(MissionFileError, match=re.escape(told)) as caught:
                read_mission(FOLDER / name)
            assert str(caught.value).startswith(f"{FOLDER / name}: ")
            assert "\n" not in str(caught.value)
    assert warned == {"gap.waypoints", "home_in_frame_3.txt"}
    file = read_mission_file(FOLDER / "fence_and_rally.plan")
    assert (file.firmware, file.vehicle_type) == (12, 2)
    assert file.mission.home == Home(47.397742, 8.545594, 488.2)
    assert file.mission.fence.breach_return == RallyPoint(47.3975, 8.5455, 50.0)
