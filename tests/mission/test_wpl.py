"""QGC WPL 110: the form that other programs read and write, and damaged files; files by ending."""

import dataclasses
import re
from pathlib import Path

import pytest
from pymavlink.mavwp import MAVWPLoader

from faao_mav.errors import InputError, MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.formats import read_mission, read_mission_file, write_mission
from faao_mav.mission.formats.wpl import read_wpl, read_wpl_fence
from faao_mav.mission.item import fence_items, home_item

HOME = "0\t1\t0\t16\t0\t0\t0\t0\t47.4\t8.5\t400\t1"
ITEM = "1\t0\t3\t16\t0\t0\t0\t0\t47.5\t8.6\t50\t1"
GOOD = f"QGC WPL 110\n{HOME}\n{ITEM}\n"
READ = Mission((MissionItem(16, 3, x=47.5, y=8.6, z=50.0),), Home(47.4, 8.5, 400.0))
FLOWN = (
    MissionItem(22, 3, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 30.0),
    MissionItem(178, 2, (1.0, 5.1, -1.0, 0.0)),
    MissionItem(82, 3, (1 / 3, 0.0, 1e-9, 0.0), 47.123456789012345, -8.6, 50.1),
    MissionItem(20, 2),
)


def loaded(path: Path) -> MAVWPLoader:
    loader = MAVWPLoader()
    loader.load(str(path))
    return loader


def with_field(index: int, value: str, row: str = ITEM) -> str:
    fields = row.split("\t")
    fields[index] = value
    return GOOD.replace(row, "\t".join(fields))


def test_harmless_oddities_are_read_damage_is_named() -> None:
    for text in (
        GOOD.replace("\n", "\r"),
        GOOD.replace("\n", "  \n\n"),
        GOOD.replace("QGC WPL 110", "QGC\tWPL  110 "),
        GOOD.replace("47.5", "+4.75e1").replace("8.6", "8.60"),
    ):
        assert read_wpl(text).mission == READ
    for text, told in (
        ("", "nothing in it; expected 'QGC WPL 110'"),
        (f"{HOME}\n{ITEM}\n", "line 1: '0"),
        ("QGC WPL 120\n" + ITEM, "expected 'QGC WPL 110': open the file in QGroundControl and"),
        ("QGC WPL 100\n" + HOME, "expected 'QGC WPL 110': load the file in MAVProxy (wp load)"),
        ("\x00\x01\x02", r"line 1: '\x00\x01\x02'; expected"),
        (with_field(0, "-1"), "field index: '-1'; expected a whole number from 0 to 65535"),
        (with_field(1, "2"), "field current: '2'; expected a whole number from 0 to 1"),
        (with_field(2, "256"), "field frame: '256'; expected a whole number from 0 to 255"),
        (with_field(3, "١٦"), "field command: '١٦'"),
        (with_field(4, "+nan"), "field param1: '+nan'; expected a finite number or nan"),
        (with_field(4, "1_0"), "field param1: '1_0'"),
        (with_field(8, "90.01"), "field latitude: '90.01'"),
        (with_field(10, "1e999"), "field altitude: '1e999'; expected a finite number"),
        (with_field(10, "9" * 500), "field altitude: '9999999"),
        (with_field(2, "10", HOME), "line 2, field frame: '10'; expected 0: row 0 is the home"),
    ):
        with pytest.raises(MissionFileError, match=re.escape(told)) as caught:
            read_wpl(text)
        assert len(str(caught.value)) < 250


def test_rows_that_do_not_count_up_are_read_in_their_order(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    rows = "\n".join(f"{index}{ITEM[1:]}" for index in (2, 4, 4))
    jump = "8\t0\t3\t177\t2\t1\t0\t0\t0\t0\t0\t1\n"
    path.write_text(f"{with_field(2, '3', HOME).replace(ITEM, rows)}{jump}")
    read = read_mission_file(path)
    assert read.mission.items[:3] == READ.items * 3
    assert read.mission.items[-1].params[0] == 2
    assert [warning.partition("; ")[0] for warning in read.warnings] == [
        f"{path}: line 2, field frame: '3': row 0 is the home position",
        f"{path}: line 3, field index: '2': indexes do not count up",
    ]
    loader = loaded(path)  # pymavlink numbers the rows anew, and leaves the target as it is
    assert [loader.wp(k).seq for k in range(5)] == [0, 1, 2, 3, 4]
    assert loader.wp(4).param1 == 2


FENCE = Fence(
    (
        Polygon(((-35.3, 149.1), (-35.4, 149.1), (-35.4, 149.2)), inclusion=True),
        Polygon(((-35.35, 149.15), (-35.36, 149.15), (-35.36, 149.16)), inclusion=False),
    ),
    (Circle((-35.36, 149.16), 40.5, inclusion=False),),
    RallyPoint(-35.36, 149.15, 30.0),
)
FENCED = dataclasses.replace(READ, items=FLOWN, fence=FENCE)

MISSION_PLANNER = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363262\t149.165237\t584.000000\t1
1\t0\t3\t5001\t3.00000000\t0.00000000\t0.00000000\t0.00000000\t-35.300000\t149.100000\t100.0\t1
2\t0\t3\t5001\t3.00000000\t0.00000000\t0.00000000\t0.00000000\t-35.400000\t149.100000\t100.0\t1
3\t0\t3\t5001\t3.00000000\t0.00000000\t0.00000000\t0.00000000\t-35.400000\t149.200000\t100.0\t1
4\t0\t3\t5004\t40.50000000\t0.00000000\t0.00000000\t0.00000000\t-35.360000\t149.160000\t100.0\t1
"""
"""A fence in the form in which Mission Planner saves one: a home row, six decimals, heights."""


def test_files_by_their_ending_the_fence_of_text_files_beside_them(tmp_path: Path) -> None:
    for suffix in (".waypoints", ".txt", ".WAYPOINTS", ".plan", ".Plan"):
        path, beside = tmp_path / f"m{suffix}", tmp_path / f"m.fence{suffix}"
        text = suffix.lower() != ".plan"
        assert [*write_mission(FENCED, path).contents] == ([path, beside] if text else [path])
        file = read_mission_file(path)
        assert file.mission == read_mission(str(path)) == FENCED
        taken = f"{beside}: the fence beside {path.name}, taken with it"
        assert file.warnings == ((taken,) if text else ())
        for name, items in ((path, FLOWN), (beside, fence_items(FENCE))) if text else ():
            header, *lines = [x for x in name.read_text().splitlines() if not x.startswith("#")]
            assert header == "QGC WPL 110"
            numbers = [value for line in lines for value in line.split("\t")[4:11]]
            assert all(len(value.split(".")[1]) >= 8 for value in numbers)
            loader = loaded(name)  # pymavlink keeps doubles: its precision is the file's
            assert loader.count() == len(items) + 1
            for index, item in enumerate((home_item(FENCED.home), *items)):
                row = loader.wp(index)
                assert (row.seq, row.current) == (index, index == 0)
                assert (row.command, row.frame) == (item.command, item.frame)
                params = (row.param1, row.param2, row.param3, row.param4)
                assert (*params, row.x, row.y, row.z) == item.numbers


def test_what_mission_planner_saves_is_read() -> None:
    rows = MISSION_PLANNER.splitlines()
    for text in (MISSION_PLANNER, "\n".join([rows[0], *rows[2:]])):  # as MAVProxy saves it
        assert read_wpl_fence(text) == Fence(FENCE.polygons[:1], FENCE.circles)
    for old, new, told in (
        ("\t5001\t3.0", "\t16\t3.0", r"line 3, field command: '16'; expected 5000 to 5004"),
        ("\t5001\t3.0", "\t5001\t4.0", r"fence: a polygon stops after 3 of its vertices"),
        ("\t5004\t40.5", "\t5004\t-1", r"fence circle: radius -1.0"),
    ):
        with pytest.raises(InputError, match=told):
            read_wpl_fence(MISSION_PLANNER.replace(old, new))


def test_the_fence_of_an_earlier_mission_goes_a_users_own_stays(tmp_path: Path) -> None:
    path, beside = tmp_path / "m.waypoints", tmp_path / "m.fence.waypoints"
    write_mission(FENCED, path)
    assert beside.is_file()
    write_mission(READ, path)
    assert not beside.exists()
    beside.write_text(MISSION_PLANNER)
    with pytest.raises(InputError, match=r"fence is to go there, but it is not of an earlier run"):
        write_mission(FENCED, path)
    assert beside.read_text() == MISSION_PLANNER
    write_mission(READ, path)
    assert read_mission(path).fence.circles == FENCE.circles


def test_what_is_no_mission_file_is_refused(tmp_path: Path) -> None:
    for name, content, told in (
        ("flight", b"", "no ending; expected a name that ends in .waypoints"),
        ("x.kml", b"<kml>", "KML is written for drawing and lacks"),
        ("x.txt", None, "cannot be read: No such file"),
        ("x.waypoints", b"#" * 16_000_001, "more than 16,000,000 bytes"),
        ("x.plan", b"[" * 100_000, "nested too deep for a plan"),
    ):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(MissionFileError, match=f"{name}: {told}"):
            read_mission(tmp_path / name)
