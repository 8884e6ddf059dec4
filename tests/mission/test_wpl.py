"""QGC WPL 110, against itself, pymavlink and damaged files."""

import dataclasses
import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavwp import MAVWPLoader
from relay_flights import STEADY, dash_hover_dash, mission_of, plan_with

from faao_mav.errors import MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.formats import losses_in, read_mission, read_mission_file, render_mission
from faao_mav.mission.formats.wpl import read_wpl, write_wpl


@pytest.fixture(scope="module")
def mission() -> Mission:
    return mission_of(*dash_hover_dash(), plan_with(on_finish="land"))


numbers = st.floats(allow_nan=False, allow_infinity=False)
latitudes, longitudes = st.floats(-90, 90), st.floats(-180, 180)


@st.composite
def items(draw: st.DrawFn) -> MissionItem:
    frame = draw(st.integers(0, 255))
    x, y = (numbers, numbers) if frame == 2 else (latitudes, longitudes)
    params = draw(st.tuples(numbers, numbers, numbers, numbers))
    command = draw(st.integers(0, 65_535))
    return MissionItem(command, frame, params, draw(x), draw(y), draw(numbers), draw(st.booleans()))


homes = st.builds(Home, latitudes, longitudes, numbers).filter(
    lambda home: any(dataclasses.astuple(home))
)
missions = st.builds(Mission, st.lists(items(), max_size=6).map(tuple), st.none() | homes)


@STEADY
@given(missions)
def test_what_is_written_is_read_back_bit_for_bit(mission: Mission) -> None:
    # repr tells the sign of zero, which == does not.
    assert repr(read_wpl(write_wpl(mission), "x").mission) == repr(mission)


@STEADY
@given(missions)
def test_the_form_that_every_reader_accepts(mission: Mission) -> None:
    text = write_wpl(mission)
    assert text.endswith(("1\n", "0\n"))
    assert "\r" not in text
    header, *rows = text.splitlines()
    assert header == "QGC WPL 110"
    fields = [row.split("\t") for row in rows]
    assert all(len(f) == 12 for f in fields)
    assert [int(f[0]) for f in fields] == list(range(len(mission.items) + 1))
    assert [int(f[1]) for f in fields] == [1] + [0] * len(mission.items)
    assert fields[0][2:4] == ["0", "16"]
    for value in (v for f in fields for v in f[4:11]):
        assert len(value.split(".")[1]) >= 8


def test_what_is_not_set_is_written_as_0_and_told() -> None:
    nan = math.nan
    item = MissionItem(16, 3, (1.0, nan, 2.0, nan), nan, 8.5, nan)
    mission = Mission((READ.items[0], item), READ.home)
    (_, read) = read_wpl(write_wpl(mission), "x").mission.items
    assert read == MissionItem(16, 3, (1.0, 0.0, 2.0, 0.0), 0.0, 8.5, 0.0)
    assert losses_in(mission, "x.txt") == [
        "not set (NaN) becomes 0: item 2 param2, item 2 param4, item 2 latitude, item 2 altitude"
    ]


@pytest.mark.parametrize("home", [Home(-35.363262, 149.165237, 584.0), None])
def test_pymavlink_reads_the_same(mission: Mission, home: Home | None, tmp_path: Path) -> None:
    path = tmp_path / "x.waypoints"
    path.write_text(write_wpl(dataclasses.replace(mission, home=home)))
    loader = MAVWPLoader()
    assert loader.load(str(path)) == len(mission.items) + 1
    row = loader.wp(0)
    assert (row.command, row.frame, row.current) == (16, 0, 1)
    assert (row.x, row.y, row.z) == (dataclasses.astuple(home) if home else (0, 0, 0))
    for index, item in enumerate(mission.items, start=1):
        row = loader.wp(index)
        assert (row.seq, row.current, row.command, row.frame) == (
            *(index, 0),
            *(item.command, item.frame),
        )
        assert (row.param1, row.param2, row.param3, row.param4) == item.params
        # It keeps doubles in memory: its precision is the file's.
        assert (row.x, row.y, row.z) == (item.x, item.y, item.z)


HOME = "0\t1\t0\t16\t0\t0\t0\t0\t47.4\t8.5\t400\t1"
ITEM = "1\t0\t3\t16\t0\t0\t0\t0\t47.5\t8.6\t50\t1"
GOOD = f"QGC WPL 110\n{HOME}\n{ITEM}\n"
READ = Mission((MissionItem(16, 3, x=47.5, y=8.6, z=50.0),), Home(47.4, 8.5, 400.0))


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\r"),
        GOOD.removesuffix("\n"),
        GOOD.replace("\t", "   "),
        GOOD.replace("\n", "  \n\n"),
        f"# by hand\nQGC WPL 110\n# home\n{HOME}\n  # first\n{ITEM}\n",
        GOOD.replace("QGC WPL 110", "QGC\tWPL  110 "),
        GOOD.replace("\t1\t0\t16", "\t0\t0\t16", 1),  # no current item
        GOOD.replace("47.5", "+4.75e1").replace("8.6", "8.60"),
        GOOD.replace("\t16\t", "\t0\t", 1),  # home as Mission Planner has written it
        f"QGC WPL 120\n{ITEM}\n".replace("\n1\t0", "\n0\t1"),
    ],
)
def test_harmless_oddities_are_read(text: str) -> None:
    read = read_wpl(text, "x").mission
    assert read.items == READ.items
    assert read.home == (None if "120" in text else READ.home)


V100 = (
    "QGC WPL 100\n"
    "0\t0\t25\t0\t0\t0\t0\t1\t8.5\t47.4\t400\t0\t1\n"
    "1\t3\t24\t3\t4\t1\t2\t0\t8.6\t47.5\t50\t90\t1\n"
    "2\t3\t27\t15\t1\t0\t0\t0\t8.7\t47.6\t60\t0\t0\n"
)


def test_version_100_is_read_as_pymavlink_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "old.txt"
    path.write_text(V100)
    loader = MAVWPLoader()
    assert loader.load(str(path)) == 3
    mission = read_mission(path)
    home = loader.wp(0)
    assert mission.home == Home(home.x, home.y, home.z)
    for row, item in zip((loader.wp(1), loader.wp(2)), mission.items, strict=True):
        assert (row.command, row.frame, row.autocontinue) == (
            *(item.command, item.frame),
            item.autocontinue,
        )
        assert (row.param1, row.param2, row.param3, row.param4) == item.params
        assert (row.x, row.y, row.z) == (item.x, item.y, item.z)


def jump(target: float) -> MissionItem:
    return MissionItem(177, 2, (target, 3.0, 0.0, 0.0))


def test_a_jump_goes_to_the_same_item_with_and_without_a_home_row() -> None:
    mission = Mission((READ.items[0], jump(1.0)), READ.home)
    rows = write_wpl(mission).splitlines()
    target = int(float(rows[3].split("\t")[4]))
    assert rows[1 + target].split("\t")[3] == "16"
    assert read_wpl("\n".join(rows), "x").mission == mission
    bare = "QGC WPL 120\n" + "\n".join(rows[2:]).replace("1\t0", "0\t1", 1)
    bare = bare.replace("\n2\t", "\n1\t").replace("177\t1.", "177\t0.")
    assert read_wpl(bare, "x").mission.items == mission.items


def with_field(index: int, value: str, row: str = ITEM) -> str:
    fields = row.split("\t")
    fields[index] = value
    return GOOD.replace(row, "\t".join(fields))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "x: nothing in it; expected 'QGC WPL 110'"),
        ("\n\n", "nothing in it"),
        ("QGC WPL 110\n", "a header but no items"),
        (f"{HOME}\n{ITEM}\n", "line 1: '0"),
        ("QGC WPL 130\n" + HOME, "line 1: 'QGC WPL 130'; expected 'QGC WPL 110'"),
        ("QGC WPL 120\n", "a header but no items; expected items"),
        ("QGC WPL 100\n" + HOME, "line 2: 12 fields; expected 13, tab-separated: index frame"),
        (V100.replace("\t24\t", "\t16\t"), "line 3, field command: '16'; expected one of 2, 3, 4"),
        (V100.replace("\t25\t", "\t24\t", 1), "line 2, field command: '24'; expected 16: row 0"),
        ("\x00\x01\x02", r"line 1: '\x00\x01\x02'; expected"),
        (GOOD.replace("\t50\t1", "\t50"), "line 3: 11 fields; expected 12"),
        (GOOD.replace("\t50\t1", "\t50\t1\t0"), "line 3: 13 fields; expected 12"),
        (with_field(0, "-1"), "field index: '-1'; expected a whole number from 0 to 65535"),
        (with_field(0, "1.0"), "field index: '1.0'; expected a whole number"),
        (with_field(1, "1"), "field current: '1'; expected 0: line 2 is already current"),
        (with_field(1, "2"), "field current: '2'; expected a whole number from 0 to 1"),
        (with_field(2, "256"), "field frame: '256'; expected a whole number from 0 to 255"),
        (with_field(3, "16.0"), "field command: '16.0'; expected a whole number"),
        (with_field(3, "65536"), "field command: '65536'"),
        (with_field(3, "١٦"), "field command: '١٦'"),
        (with_field(4, "+nan"), "field param1: '+nan'; expected a finite number or nan"),
        (with_field(4, "1_0"), "field param1: '1_0'"),
        (with_field(4, "0x10"), "field param1: '0x10'"),
        (with_field(7, "inf"), "field param4: 'inf'; expected a finite number or nan"),
        (with_field(8, "nan"), "field latitude: 'nan'; expected a finite number from -90 to 90"),
        (with_field(8, "90.01"), "field latitude: '90.01'"),
        (with_field(8, "47,5"), "field latitude: '47,5'"),
        (with_field(9, "-180.1"), "field longitude: '-180.1'"),
        (with_field(10, "1e999"), "field altitude: '1e999'; expected a finite number"),
        (with_field(10, "nan"), "field altitude: 'nan'"),
        (with_field(10, "9" * 500), "field altitude: '9999999"),
        (with_field(11, "true"), "field autocontinue: 'true'; expected a whole number from 0"),
        (with_field(3, "22", HOME), "line 2, field command: '22'; expected 16: row 0 is the home"),
        (with_field(2, "10", HOME), "line 2, field frame: '10'; expected 0: row 0 is the home"),
    ],
)
def test_damage_is_named(text: str, message: str) -> None:
    with pytest.raises(MissionFileError, match=re.escape(message)) as caught:
        read_wpl(text, "x")
    assert str(caught.value).startswith("x: ")
    assert len(str(caught.value)) < 250


def rows(*indexes: int, item: str = ITEM) -> str:
    return GOOD.replace(ITEM, "\n".join(f"{index}{item[1:]}" for index in indexes))


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        (rows(1, 2, 3), None),
        (rows(1, 3, 4), "x: line 4, field index: '3': indexes do not count up; rows are taken in"),
        (rows(1, 2, 2), "x: line 5, field index: '2': indexes do not count up"),
        (rows(3, 2, 1), "x: line 3, field index: '3': indexes do not count up"),
        (with_field(2, "3", HOME), "x: line 2, field frame: '3': row 0 is the home position; its "
         "altitude is taken as above mean sea level"),
    ],
)  # fmt: skip
def test_oddities_of_real_files_are_read_with_a_warning(
    text: str, warning: str | None, tmp_path: Path
) -> None:
    read = read_wpl(text, "x")
    assert read.mission.home == READ.home
    assert read.mission.items == READ.items * (text.count("\n") - 2)
    assert [w[: len(warning or "")] for w in read.warnings] == ([warning] if warning else [])
    (tmp_path / "x.txt").write_text(text)
    loader = MAVWPLoader()
    assert loader.load(str(tmp_path / "x.txt")) == 1 + len(read.mission.items)


def test_a_jump_among_rows_that_do_not_count_up_goes_by_their_order(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    path.write_text(rows(2, 4, 6) + "8\t0\t3\t177\t2\t1\t0\t0\t0\t0\t0\t1\n")
    read = read_mission_file(path)
    assert read.mission.items[-1].params[0] == 2
    assert read.warnings == (
        f"{path}: line 3, field index: '2': indexes do not count up; rows are taken in the file's "
        "order, in which targets of DO_JUMP count too",
    )
    loader = MAVWPLoader()  # pymavlink numbers the rows anew, and leaves the target as it is
    loader.load(str(path))
    assert [loader.wp(k).seq for k in range(5)] == [0, 1, 2, 3, 4]
    assert loader.wp(4).param1 == 2


def test_coordinates_of_the_mission_frame_are_plain_parameters() -> None:
    text = with_field(2, "2").replace("47.5", "1000")
    assert read_wpl(text, "x").mission.items[0].x == 1000


def reads_or_complains(text: str) -> None:
    try:
        mission = read_wpl(text, "x").mission
    except MissionFileError:
        return
    assert repr(read_wpl(write_wpl(mission), "x").mission) == repr(mission)


@STEADY
@given(st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    reads_or_complains(text)
    reads_or_complains("QGC WPL 110\n" + text)


@STEADY
@given(st.data())
def test_a_mutated_file_is_read_or_refused(data: st.DataObject) -> None:
    text = GOOD
    for _ in range(data.draw(st.integers(1, 4))):
        begin = data.draw(st.integers(0, len(text)))
        end = min(len(text), begin + data.draw(st.integers(0, 6)))
        patch = data.draw(st.text("0123456789.-+eEnaif\t\n\r #\x00", max_size=6))
        text = text[:begin] + patch + text[end:]
    reads_or_complains(text)


@pytest.mark.parametrize("suffix", [".waypoints", ".txt", ".plan", ".WAYPOINTS", ".Plan"])
def test_a_file_is_read_by_its_ending(mission: Mission, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    path.write_text(render_mission(mission, path), newline="")
    assert read_mission(path) == read_mission(str(path)) == mission


@pytest.mark.parametrize("name", ["flight.mission", "flight", ".waypoints"])
def test_an_unknown_ending_is_refused(mission: Mission, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(MissionFileError, match=r"ends in .*\.txt .*, \.plan .* or \.kml"):
        read_mission(path)
    with pytest.raises(MissionFileError, match=re.escape(str(path))):
        render_mission(mission, path)


def test_a_file_that_cannot_be_opened_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissionFileError, match=r"none\.waypoints: cannot be read: No such file"):
        read_mission(tmp_path / "none.waypoints")
    (tmp_path / "folder.txt").mkdir()
    with pytest.raises(MissionFileError, match="cannot be read: Is a directory"):
        read_mission(tmp_path / "folder.txt")
    with pytest.raises(MissionFileError, match="cannot be read: embedded null"):
        read_mission("a\0.txt")


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.waypoints"
    path.write_bytes(b"QGC WPL 110\n\xff\xfe")
    with pytest.raises(MissionFileError, match=r"x\.waypoints: line 2: byte 0xff is not UTF-8"):
        read_mission(path)
    path.write_bytes(b"#" * 16_000_001)
    with pytest.raises(MissionFileError, match="more than 16,000,000 bytes"):
        read_mission(path)
