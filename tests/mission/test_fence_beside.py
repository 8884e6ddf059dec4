"""The fence of a .waypoints file: a second file beside it."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavwp import MAVWPLoader

from faao_mav.errors import InputError, MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.formats import (
    fence_path,
    losses_in,
    read_mission,
    read_mission_file,
    write_mission,
)
from faao_mav.mission.formats.wpl import read_wpl_fence, write_wpl_fence

HOME = Home(-35.363262, 149.165237, 584.0)
WAYPOINT = MissionItem(16, 3, x=-35.36, y=149.16, z=30.0)
FENCE = Fence(
    (
        Polygon(((-35.3, 149.1), (-35.4, 149.1), (-35.4, 149.2)), inclusion=True),
        Polygon(((-35.35, 149.15), (-35.36, 149.15), (-35.36, 149.16)), inclusion=False),
    ),
    (Circle((-35.36, 149.16), 40.5, inclusion=False),),
    RallyPoint(-35.36, 149.15, 30.0),
)
MISSION = Mission((WAYPOINT,), HOME, FENCE)

latitudes, longitudes = st.floats(-90, 90), st.floats(-180, 180)
places = st.tuples(latitudes, longitudes)
polygons = st.builds(
    Polygon, st.lists(places, min_size=3, max_size=6).map(tuple), inclusion=st.booleans()
)
circles = st.builds(Circle, places, st.floats(1e-3, 1e6), inclusion=st.booleans())
fences = st.builds(
    Fence, st.lists(polygons, max_size=3).map(tuple), st.lists(circles, max_size=3).map(tuple)
)

MISSION_PLANNER = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363262\t149.165237\t584.000000\t1
1\t0\t3\t5001\t3.00000000\t0.00000000\t0.00000000\t0.00000000\t-35.300000\t149.100000\t100.0\t1
2\t0\t3\t5001\t3.00000000\t0.00000000\t0.00000000\t0.00000000\t-35.400000\t149.100000\t100.0\t1
3\t0\t3\t5001\t3.00000000\t0.00000000\t0.00000000\t0.00000000\t-35.400000\t149.200000\t100.0\t1
4\t0\t3\t5004\t40.50000000\t0.00000000\t0.00000000\t0.00000000\t-35.360000\t149.160000\t100.0\t1
"""
"""A fence in the form in which Mission Planner saves one: a home row, six decimals, heights."""


@given(fence=fences)
def test_any_fence_is_read_back_bit_for_bit(fence: Fence) -> None:
    text = write_wpl_fence(Mission((), HOME, fence), "for m.waypoints")
    assert read_wpl_fence(text, "m.fence.waypoints") == fence


@pytest.mark.parametrize("name", ["m.waypoints", "m.txt"])
def test_it_is_written_and_read_beside_the_mission(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    written = write_mission(MISSION, path)
    assert written == (path, tmp_path / name.replace("m.", "m.fence."))
    file = read_mission_file(path)
    assert file.mission == MISSION
    assert [f"{written[1]}: the fence beside {name}, taken with it"] == list(file.warnings)
    assert losses_in(MISSION, path) == []


def test_a_plan_holds_its_own(tmp_path: Path) -> None:
    path = tmp_path / "m.plan"
    assert write_mission(MISSION, path) == (path,)
    (tmp_path / "m.fence.plan").write_text("not looked at")
    assert read_mission(path).fence == FENCE
    assert fence_path(path) is None


def test_pymavlink_reads_the_same_rows(tmp_path: Path) -> None:
    path = write_mission(MISSION, tmp_path / "m.waypoints")[1]
    loader = MAVWPLoader()
    loader.load(str(path))
    rows = [loader.wp(k) for k in range(loader.count())]
    assert [row.command for row in rows] == [16, 5000, *[5001] * 3, *[5002] * 3, 5004]
    assert [row.seq for row in rows] == list(range(9))
    assert (rows[2].param1, rows[8].param1) == (3.0, 40.5)
    assert (rows[8].x, rows[8].y) == pytest.approx((-35.36, 149.16), abs=1e-5)


def test_what_mission_planner_saves_is_read() -> None:
    fence = read_wpl_fence(MISSION_PLANNER, "saved.waypoints")
    assert fence == Fence(FENCE.polygons[:1], FENCE.circles)
    rows = MISSION_PLANNER.splitlines()
    without_home = "\n".join([rows[0], *rows[2:]])  # as MAVProxy saves it
    assert read_wpl_fence(without_home, "saved.txt") == fence


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("\t5001\t3.0", "\t16\t3.0", r"line 3, field command: '16'; expected 5000 to 5004"),
        ("\t5001\t3.0", "\t5001\t4.0", r"f: fence: a polygon stops after 3 of its vertices"),
        ("\t5004\t40.5", "\t5004\t-1", r"f: fence circle: radius -1.0"),
        ("QGC WPL 110", "-35.3 149.1", r"line 1: '-35\.3 149\.1'; expected 'QGC WPL 110'"),
    ],
)
def test_what_is_no_fence_is_refused(old: str, new: str, expected: str) -> None:
    with pytest.raises(MissionFileError, match=expected):
        read_wpl_fence(MISSION_PLANNER.replace(old, new), "f")


def test_the_fence_of_an_earlier_mission_goes_a_users_own_stays(tmp_path: Path) -> None:
    path, beside = tmp_path / "m.waypoints", tmp_path / "m.fence.waypoints"
    write_mission(MISSION, path)
    assert beside.is_file()
    write_mission(Mission((WAYPOINT,), HOME), path)
    assert not beside.exists()
    beside.write_text(MISSION_PLANNER)
    with pytest.raises(InputError, match=r"fence is to go there, but it is not of an earlier run"):
        write_mission(MISSION, path)
    assert beside.read_text() == MISSION_PLANNER
    write_mission(Mission((WAYPOINT,), HOME), path)
    assert read_mission(path).fence.circles == FENCE.circles
