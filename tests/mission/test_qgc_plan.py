"""QGroundControl's plans, against themselves and damaged texts."""

import json
import math
import time
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st
from relay_flights import STEADY, dash_hover_dash, mission_of, plan_with

from faao_mav.errors import MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.formats import (
    PlanTarget,
    losses_in,
    render_mission,
    write_qgc_plan,
)
from faao_mav.mission.formats.qgc_plan_reader import read_qgc_plan

PX4, ARDUPILOT = PlanTarget(12, 2), PlanTarget(3, 2, takes_null=False)


def test_a_height_that_is_null_is_not_known() -> None:
    low = RallyPoint(47.0, 8.5, math.nan)
    mission = Mission((), Home(47.0, 8.0, math.nan), Fence(breach_return=low), (low,))
    text = write_qgc_plan(mission)
    assert json.loads(text)["mission"]["plannedHomePosition"] == [47.0, 8.0, None]
    read = read_qgc_plan(text, "x.plan").mission
    assert read.home is not None
    assert (read.home.latitude, read.rally[0].longitude) == (47.0, 8.5)
    assert all(map(math.isnan, (read.home.altitude, read.rally[0].altitude)))
    assert read.fence.breach_return is not None
    assert math.isnan(read.fence.breach_return.altitude)
    with pytest.raises(MissionFileError, match=r"rallyPoints.points\[0\]: rally point: nan"):
        read_qgc_plan(text.replace("47.0,\n                8.5,", "null, 8.5,"), "x.plan")


numbers = st.floats(allow_nan=False, allow_infinity=False)
settable = numbers | st.just(math.nan)
latitudes, longitudes = st.floats(-90, 90), st.floats(-180, 180)
places = st.tuples(latitudes, longitudes)
points = st.builds(RallyPoint, latitudes, longitudes, numbers)


@st.composite
def items(draw: st.DrawFn) -> MissionItem:
    frame = draw(st.integers(0, 255))
    x, y = (numbers, numbers) if frame == 2 else (latitudes, longitudes)
    command = draw(st.integers(0, 65_535).filter(lambda number: number != 177))
    return MissionItem(
        command,
        frame,
        draw(st.tuples(settable, settable, settable, settable)),
        draw(x | st.just(math.nan)),
        draw(y | st.just(math.nan)),
        draw(settable),
        draw(st.booleans()),
    )


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    flown: list[MissionItem] = draw(st.lists(items(), max_size=5))
    with_jump: bool = draw(st.booleans())
    if flown and with_jump:
        target: int = draw(st.integers(1, len(flown) + 1))
        flown.append(MissionItem(177, 2, (float(target), draw(numbers), 0.0, math.nan)))
    circle = st.builds(Circle, places, st.floats(1e-3, 1e6), st.booleans())
    polygon = st.builds(Polygon, st.lists(places, min_size=3, max_size=5).map(tuple), st.booleans())
    fence = Fence(
        tuple(draw(st.lists(polygon, max_size=2))),
        tuple(draw(st.lists(circle, max_size=2))),
        draw(st.none() | points),
    )
    home = st.builds(Home, latitudes, longitudes, st.floats(1, 9000))
    rally = tuple(draw(st.lists(points, max_size=2)))
    return Mission(tuple(flown), draw(st.none() | home), fence, rally)


@STEADY
@given(missions(), st.sampled_from([PX4, None, PlanTarget(12, 1)]))
def test_what_is_written_is_read_back_bit_for_bit(
    mission: Mission, target: PlanTarget | None
) -> None:
    read = read_qgc_plan(write_qgc_plan(mission, target), "x")
    # repr tells NaN and the sign of zero, which == does not.
    assert repr(read.mission) == repr(mission)
    numbers = (target.firmware, target.vehicle_type) if target else (0, 0)
    assert (read.firmware, read.vehicle_type) == numbers


@STEADY
@given(missions())
def test_ardupilot_gets_0_for_what_is_not_set(mission: Mission) -> None:
    text = write_qgc_plan(mission, ARDUPILOT)
    read = read_qgc_plan(text, "x")
    assert (read.firmware, read.vehicle_type) == (3, 2)
    for item, original in zip(read.mission.items, mission.items, strict=True):
        for got, given_ in zip(
            (*item.params, item.x, item.y, item.z),
            (*original.params, original.x, original.y, original.z),
            strict=True,
        ):
            assert got == (0 if math.isnan(given_) else given_)
    unset = any(math.isnan(v) for i in mission.items for v in (*i.params, i.x, i.y, i.z))
    assert unset == any("not set" in line for line in losses_in(mission, "x.plan", ARDUPILOT))


@STEADY
@given(missions())
def test_the_form_that_qgroundcontrol_asks_for(mission: Mission) -> None:
    plan = json.loads(write_qgc_plan(mission, PX4))
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    assert (plan["geoFence"]["version"], plan["rallyPoints"]["version"]) == (2, 2)
    part = plan["mission"]
    assert (part["version"], part["firmwareType"], part["vehicleType"]) == (2, 12, 2)
    assert len(part["plannedHomePosition"]) == 3
    assert part["cruiseSpeed"] > 0
    assert part["hoverSpeed"] > 0
    assert [item["doJumpId"] for item in part["items"]] == list(range(1, len(part["items"]) + 1))
    altitude_modes = {3: 1, 6: 1, 0: 2, 5: 2, 10: 4, 11: 4}
    for item in part["items"]:
        assert len(item["params"]) == 7
        assert item.get("AltitudeMode") == altitude_modes.get(item["frame"])
        if "AltitudeMode" in item:
            assert item["Altitude"] == item["params"][6]
            assert item["AMSLAltAboveTerrain"] is None


def test_speeds_and_altitude_mode_are_those_of_the_mission() -> None:
    mission = mission_of(*dash_hover_dash(), plan_with(max_speed=8.0))
    part = json.loads(write_qgc_plan(mission, PX4))["mission"]
    assert (part["cruiseSpeed"], part["hoverSpeed"], part["globalPlanAltitudeMode"]) == (8, 8, 1)
    part = json.loads(write_qgc_plan(Mission(()), PX4))["mission"]
    assert (part["cruiseSpeed"], part["hoverSpeed"], part["globalPlanAltitudeMode"]) == (15, 5, 0)


@pytest.mark.parametrize("target", [0.0, 3.0, 1.5, math.nan, -1.0])
def test_a_jump_to_no_item_is_not_written(target: float) -> None:
    mission = Mission((MissionItem(16, 3), MissionItem(177, 2, (target, 1.0, 0.0, 0.0))))
    with pytest.raises(MissionFileError, match=r"x\.plan: item 2: DO_JUMP to .*, 1 to 2"):
        render_mission(mission, "x.plan")


def test_losses_of_a_plan_are_few() -> None:
    mission = Mission((MissionItem(16, 3),), Home(1.0, 2.0, 3.0))
    assert losses_in(mission, "x.plan", PX4) == []
    assert losses_in(Mission(mission.items), "x.plan", PX4) == [
        "no home is known: the file says 0, 0, 0, which means none"
    ]
    assert losses_in(mission, "x.plan") == ["no autopilot is known: the plan is for a generic one"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "x: line 1, column 1: not JSON"),
        ("[" * 100_000, "x: nested too deep for a plan"),
        ('{"a": ' * 100_000, "x: nested too deep for a plan"),
        ("9" * 5000, "x: a number of thousands of digits"),
        ('{"fileType": 1}', "x: fileType: 1; expected 'Plan'"),
        ('{"fileType": "Plan", "version": true}', "x: version: 'true'; expected 1: open"),
        ('{"fileType": "Plan", "version": 1.5}', "x: version: 1.5; expected 1: open"),
        ('{"fileType": "Plan", "version": 1e400}', "x: version: inf; expected 1: open"),
        ('{"fileType": "Plan", "version": Infinity}', "x: version: Infinity; expected a finite"),
        ('{"a": {"b": [0, {"c": 1, "c": 2}]}}', "x: a.b[1].c: is there twice"),
        ('{"a": 1, "a": 2, "a": NaN}', "x: a: is there twice"),
        ('{"a": [0, -Infinity]}', "x: a[1]: -Infinity; expected a finite number or null"),
        ("NaN", "x: NaN; expected a finite"),
        ("[]", "x: nothing; expected an object"),
    ],
)
def test_texts_that_are_no_plan(text: str, message: str) -> None:
    with pytest.raises(MissionFileError, match=f"^{message.replace('[1]', '.1.')}"):
        read_qgc_plan(text, "x")


def test_a_long_key_over_many_numbers_takes_little_memory_and_time() -> None:
    key, numbers = "k" * 200_000, ",".join(["1"] * 70_000)
    for text in (
        GOOD.replace('"fileType"', f'"{key}": [{numbers}], "fileType"'),
        GOOD.replace('"items": [', f'"items": [{numbers}, '),
        GOOD.replace('"items": [', f'"items": [{{"{key}": [{numbers}]}}, '),
    ):
        tracemalloc.start()
        began = time.process_time()
        try:
            read_qgc_plan(text, "x")
        except MissionFileError as error:
            assert len(str(error)) < 200
        took, (_, peak) = time.process_time() - began, tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert took < 5
        assert peak < 50e6


def test_whole_numbers_may_have_a_point() -> None:
    text = write_qgc_plan(Mission((MissionItem(16, 3),)), PX4)
    text = text.replace('"command": 16', '"command": 16.0')
    assert read_qgc_plan(text, "x").mission.items[0].command == 16


CORNERS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
WAYPOINT = MissionItem(16, 3, (0.0, 0.0, 0.0, math.nan), 1.0, 2.0, 3.0)
GOOD = write_qgc_plan(
    Mission(
        (WAYPOINT, MissionItem(177, 2, (1.0, 2.0, 0.0, 0.0))),
        Home(1.0, 2.0, 3.0),
        Fence((Polygon(CORNERS, True),), (Circle((0.0, 0.0), 1.0, False),)),
        (RallyPoint(0.0, 0.0, 1.0),),
    ),
    PX4,
)
PATCHES = ["null", "true", "1e999", "-1", "[]", "{}", '""', "0.5", "1e9", "[[]]", '{"a": 0}', "NaN"]


@STEADY
@given(st.data())
def test_a_mutated_plan_is_read_or_refused(data: st.DataObject) -> None:
    """Every value in turn becomes another, or goes missing."""
    plan = json.loads(GOOD)
    for _ in range(data.draw(st.integers(1, 2))):
        node, key = plan, None
        while isinstance(node, dict | list) and node and data.draw(st.integers(0, 4)):
            parent = node
            keys = sorted(node) if isinstance(node, dict) else range(len(node))
            key = data.draw(st.sampled_from(keys))
            node = parent[key]
        if key is None:
            continue
        if data.draw(st.booleans()):
            del parent[key]
        else:
            parent[key] = json.loads(data.draw(st.sampled_from(PATCHES)))
    try:
        mission = read_qgc_plan(json.dumps(plan), "x").mission
    except MissionFileError as error:
        assert str(error).startswith("x: ")
        return
    assert repr(read_qgc_plan(write_qgc_plan(mission, PX4), "x").mission) == repr(mission)


leaves = st.none() | st.booleans() | numbers | st.text()
trees = st.recursive(leaves, lambda part: st.lists(part) | st.dictionaries(st.text(), part))


@STEADY
@given(st.text() | trees.map(json.dumps))
def test_any_text_is_refused(text: str) -> None:
    with pytest.raises(MissionFileError):
        read_qgc_plan(text, "x")
