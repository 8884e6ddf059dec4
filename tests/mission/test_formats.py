"""QGC WPL 110, QGroundControl's plans, KML: the forms that others read, damage, what is lost."""

import json
import math
import re
from dataclasses import astuple, replace
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest
from pymavlink.mavwp import MAVWPLoader

from faao_mav.errors import InputError, MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.formats import (
    PlanTarget,
    read_mission,
    read_mission_file,
    render_files,
    render_mission,
    write_mission,
    write_qgc_plan,
)
from faao_mav.mission.formats.kml import write_kml
from faao_mav.mission.formats.qgc_plan import read_qgc_plan
from faao_mav.mission.formats.wpl import read_wpl, read_wpl_fence
from faao_mav.mission.item import fence_items, home_item

FENCES = Path(__file__).parents[1] / "data" / "fences"
HOME_ROW = "0\t1\t0\t16\t0\t0\t0\t0\t47.4\t8.5\t400\t1"
ROW = "1\t0\t3\t16\t0\t0\t0\t0\t47.5\t8.6\t50\t1"
WPL = f"QGC WPL 110\n{HOME_ROW}\n{ROW}\n"
HOME = Home(47.4, 8.5, 400.0)
PLACE = MissionItem(16, 3, x=47.5, y=8.6, z=50.0)
READ = Mission((PLACE,), HOME)
TAKEOFF = MissionItem(22, 3, z=30.0)
FLOWN = (
    TAKEOFF,
    MissionItem(178, 2, (1.0, 5.1, -1.0, 0.0)),
    MissionItem(82, 3, (1 / 3, 0.0, 1e-9, 0.0), 47.123456789012345, -8.6, 50.1),
    MissionItem(20, 2),
)
FENCE = Fence(
    (
        Polygon(((-35.3, 149.1), (-35.4, 149.1), (-35.4, 149.2)), inclusion=True),
        Polygon(((-35.35, 149.15), (-35.36, 149.15), (-35.36, 149.16)), inclusion=False),
    ),
    (Circle((-35.36, 149.16), 40.5, inclusion=False),),
    RallyPoint(-35.36, 149.15, 30.0),
)
FENCED = Mission(FLOWN, HOME, FENCE)
PX4 = PlanTarget(12, 2)
PLAN = write_qgc_plan(READ, PX4)


def with_field(index: int, value: str, row: str = ROW) -> str:
    fields = row.split("\t")
    fields[index] = value
    return WPL.replace(row, "\t".join(fields))


def test_harmless_oddities_are_read_damage_is_named() -> None:
    for text in (
        WPL.replace("\n", "\r"),
        WPL.replace("\n", "  \n\n"),
        WPL.replace("QGC WPL 110", "QGC\tWPL  110 "),
        WPL.replace("47.5", "+4.75e1").replace("8.6", "8.60"),
    ):
        assert read_wpl(text).mission == READ
    assert read_qgc_plan(PLAN.replace('"command": 16', '"command": 16.0')).mission == READ
    wpl = (
        ("", "nothing in it; expected 'QGC WPL 110'"),
        (f"{HOME_ROW}\n{ROW}\n", "line 1: '0"),
        ("QGC WPL 100\n" + ROW, "expected 'QGC WPL 110': load the file in MAVProxy (wp load)"),
        ("\x00\x01\x02", r"line 1: '\x00\x01\x02'; expected"),
        (with_field(0, "-1"), "field index: '-1'; expected a whole number from 0 to 65535"),
        (with_field(1, "2"), "field current: '2'; expected a whole number from 0 to 1"),
        (with_field(2, "256"), "field frame: '256'; expected a whole number from 0 to 255"),
        (with_field(3, "١٦"), "field command: '١٦'"),
        (with_field(4, "+nan"), "field param1: '+nan'; expected a finite number or nan"),
        (with_field(4, "1_0"), "field param1: '1_0'"),
        (with_field(8, "90.01"), "field latitude: '90.01'"),
        (with_field(10, "9" * 500), "field altitude: '9999999"),
        (with_field(2, "10", HOME_ROW), "line 2, field frame: '10'; expected 0: row 0 is the home"),
    )
    plans = (
        ("", "line 1, column 1: not JSON"),
        ("9" * 5000, "a number of thousands of digits"),
        ('{"fileType": "Plan", "version": true}', "version: true; expected 1: open"),
        ('{"fileType": "Plan", "version": 1e400}', "version: inf; expected 1: open"),
        ('{"a": {"b": [0, {"c": 1, "c": 2}]}}', "key 'c': is there twice in one object"),
        (PLAN.replace("16", "9" * 400), "items[0].command: 9999"),
        (PLAN.replace("16", "true"), "items[0].command: true; expected a whole number from 0 to"),
    )
    for read, cases in ((read_wpl, wpl), (read_qgc_plan, plans)):
        for text, told in cases:
            with pytest.raises(MissionFileError, match=re.escape(told)) as caught:
                read(text)
            assert len(str(caught.value)) < 250


def loaded(path: Path) -> MAVWPLoader:
    """What pymavlink reads; it keeps doubles: its precision is the file's."""
    loader = MAVWPLoader()
    loader.load(str(path))
    return loader


def test_rows_that_do_not_count_up_are_read_in_their_order(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    rows = "\n".join(f"{index}{ROW[1:]}" for index in (2, 4, 4))
    path.write_text(with_field(2, "3", HOME_ROW).replace(ROW, rows))
    read = read_mission_file(path)
    assert read.mission.items == (PLACE,) * 3
    assert [warning.partition("; ")[0] for warning in read.warnings] == [
        f"{path}: line 2, field frame: '3': row 0 is the home position",
        f"{path}: line 3, field index: '2': indexes do not count up",
    ]
    assert [loaded(path).wp(k).seq for k in range(4)] == [0, 1, 2, 3]  # as pymavlink does


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
            numbers = [value for line in lines for value in line.split("\t")[4:11]]
            assert header == "QGC WPL 110"
            assert all(len(value.split(".")[1]) >= 8 for value in numbers)
            loader = loaded(name)
            assert loader.count() == len(items) + 1
            for index, item in enumerate((home_item(HOME), *items)):
                row = loader.wp(index)
                assert (row.seq, row.current) == (index, index == 0)
                assert (row.command, row.frame) == (item.command, item.frame)
                params = (row.param1, row.param2, row.param3, row.param4)
                assert (*params, row.x, row.y, row.z) == item.numbers
    for other, content, told in (
        ("flight", b"", "no ending; expected a name that ends in .waypoints"),
        ("x.kml", b"<kml>", "KML is written for drawing and lacks"),
        ("x.txt", None, "cannot be read: No such file"),
        ("x.waypoints", b"#" * 16_000_001, "more than 16,000,000 bytes"),
        ("x.plan", b"[" * 100_000, "nested too deep for a plan"),
    ):
        if content is not None:
            (tmp_path / other).write_bytes(content)
        with pytest.raises(MissionFileError, match=f"{other}: {told}"):
            read_mission(tmp_path / other)


MISSION_PLANNER = (FENCES / "mission_planner.waypoints").read_text()
"""A fence in the form in which Mission Planner saves one: a home row, six decimals, heights."""


def test_a_fence_that_others_saved_is_read_and_stays_that_of_an_earlier_run_goes(
    tmp_path: Path,
) -> None:
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


def test_the_form_that_qgroundcontrol_asks_for() -> None:
    frames = [0, 2, 3, 5, 6, 10, 11]
    plan = json.loads(write_qgc_plan(Mission(tuple(replace(PLACE, frame=f) for f in frames)), PX4))
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    assert (plan["geoFence"]["version"], plan["rallyPoints"]["version"]) == (2, 2)
    part = plan["mission"]
    assert (part["version"], part["firmwareType"], part["vehicleType"]) == (2, 12, 2)
    assert part["plannedHomePosition"] == [0, 0, 0]
    assert [item["doJumpId"] for item in part["items"]] == list(range(1, len(frames) + 1))
    assert [x.get("AltitudeMode") for x in part["items"]] == [2, None, 1, 2, 1, 4, 4]
    shown = part["items"][0]
    assert (shown["Altitude"], shown["AMSLAltAboveTerrain"]) == (50.0, None)
    keys = ("cruiseSpeed", "hoverSpeed", "globalPlanAltitudeMode")
    assert [part[key] for key in keys] == [15, 5, 0]
    for target in (0.0, 3.0, 1.5, math.nan, -1.0):
        jump = MissionItem(177, 2, (target, 1.0, 0.0, 0.0))
        with pytest.raises(MissionFileError, match=r"x\.plan: item 2: DO_JUMP to .*, 1 to 2"):
            render_mission(Mission((PLACE, jump)), "x.plan")
    low = RallyPoint(47.0, 8.5, math.nan)  # a height that is null is not known
    mission = Mission((), Home(47.0, 8.0, math.nan), Fence(breach_return=low), (low,))
    text = write_qgc_plan(mission)
    assert json.loads(text)["mission"]["plannedHomePosition"] == [47.0, 8.0, None]
    assert repr(astuple(read_qgc_plan(text).mission)) == repr(astuple(mission))
    with pytest.raises(InputError, match=r"rallyPoints.points\[0\]: rally point: nan"):
        read_qgc_plan(text.replace("47.0,\n                8.5,", "null, 8.5,"))


def drawn(mission: Mission, path: str, name: str = "") -> list[str]:
    """The texts at a path of a mission's KML."""
    root = Xml.fromstring(write_kml(mission, name=name).encode())
    path = ".//" + "/".join(f"{{http://www.opengis.net/kml/2.2}}{tag}" for tag in path.split("/"))
    return [node.text or "" for node in root.findall(path)]


def places(text: str) -> list[tuple[float, ...]]:
    return [tuple(map(float, spot.split(","))) for spot in text.split()]


def test_kml_draws_route_and_fence() -> None:
    spline = MissionItem(82, 0, x=47.6, y=8.7, z=460.0)
    mission = Mission((*FLOWN[:2], PLACE, spline, FLOWN[3]), HOME)
    named, mode, line = "Placemark/name", "LineString/altitudeMode", "LineString/coordinates"
    assert drawn(mission, "name", "a & <hill>\x00\ud800\uffff\x1b")[0] == "a & <hill>????"
    assert drawn(mission, named) == ["Route", "1", "3", "4"]
    assert drawn(mission, mode) == ["absolute"]
    route = [(8.5, 47.4, 430.0), (8.6, 47.5, 450.0), (8.7, 47.6, 460.0)]
    assert [*map(places, drawn(mission, line))] == [route]  # a take-off at 0, 0 is where home is
    for home in (None, Home(47.0, 8.0, math.nan)):
        mission = Mission((PLACE, replace(PLACE, z=math.nan), PLACE), home)
        assert drawn(mission, mode) == ["relativeToGround"]
        assert [*map(places, drawn(mission, line))] == [[(8.6, 47.5, 50.0)] * 2]
    assert drawn(Mission((TAKEOFF, PLACE)), named) == ["2"]  # the take-off would be at home
    circles = Circle((47.0, 8.0), 300.0, True), Circle((47.0, 8.0), 20.0, False)
    fenced = Mission((), HOME, Fence(circles=circles))
    assert drawn(fenced, named) == ["inclusion circle", "exclusion circle"]
    assert drawn(fenced, "styleUrl") == ["#inclusion", "#exclusion"]
    for ring in map(places, drawn(fenced, "outerBoundaryIs/LinearRing/coordinates")):
        assert ring[0] == ring[-1]
        assert max(abs(y - 47) for _, y, _ in ring) == pytest.approx(
            max(abs(x - 8) for x, _, _ in ring) * math.cos(math.radians(47)), rel=0.01
        )


def test_what_a_format_cannot_hold_is_told() -> None:
    nowhere = Mission(READ.items, unread=("fence",))
    terrain = replace(READ, items=(replace(PLACE, frame=10), *FLOWN))
    for mission, name, target, lost in (
        (READ, "x.plan", PX4, ()),
        (READ, "x.plan", None, ("no autopilot is known: the plan is for a generic one",)),
        (nowhere, "x.plan", PX4, (
            "without the fence that the vehicle may hold: not read from it; QGroundControl clears "
            "it there when it uploads this plan",
            "no home is known: the file says 0, 0, 0, which means none",
        )),
        (terrain, "x.kml", None, (
            "KML holds route and fence alone: no commands, speeds or holds, and cannot be read "
            "back",
            "heights above terrain, or above a home without a height, are drawn above the ground",
            "spline waypoints are joined by straight lines",
        )),
    ):  # fmt: skip
        assert render_files(mission, name, target).lost == lost
    plain = replace(READ, items=(PLACE,), rally=(RallyPoint(1.0, 2.0, 3.0),))
    said, _ = render_files(plain, "x.kml").lost  # nothing of terrain and splines
    assert said == "KML holds no rally points: 1 point left out"
    assert read_qgc_plan(write_qgc_plan(nowhere)).mission.unread == ("fence",)
