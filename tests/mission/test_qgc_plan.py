"""QGroundControl's plans: the form that QGroundControl asks for, and what is refused."""

import json
import math
import re
from dataclasses import astuple

import pytest

from faao_mav.errors import InputError, MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Fence, RallyPoint
from faao_mav.mission.formats import PlanTarget, render_files, render_mission, write_qgc_plan
from faao_mav.mission.formats.qgc_plan import read_qgc_plan

PX4 = PlanTarget(12, 2)
WAYPOINT = MissionItem(16, 3, (0.0, 0.0, 0.0, 1.5), 1.0, 2.0, 3.0)
SOUND = Mission((WAYPOINT,), Home(1.0, 2.0, 3.0))
GOOD = write_qgc_plan(SOUND, PX4)


def test_a_height_that_is_null_is_not_known() -> None:
    low = RallyPoint(47.0, 8.5, math.nan)
    mission = Mission((), Home(47.0, 8.0, math.nan), Fence(breach_return=low), (low,))
    text = write_qgc_plan(mission)
    assert json.loads(text)["mission"]["plannedHomePosition"] == [47.0, 8.0, None]
    assert repr(astuple(read_qgc_plan(text).mission)) == repr(astuple(mission))
    with pytest.raises(InputError, match=r"rallyPoints.points\[0\]: rally point: nan"):
        read_qgc_plan(text.replace("47.0,\n                8.5,", "null, 8.5,"))


def test_the_form_that_qgroundcontrol_asks_for() -> None:
    frames = [0, 2, 3, 5, 6, 10, 11]
    mission = Mission(tuple(MissionItem(16, frame, z=7.0) for frame in frames))
    plan = json.loads(write_qgc_plan(mission, PX4))
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    assert (plan["geoFence"]["version"], plan["rallyPoints"]["version"]) == (2, 2)
    part = plan["mission"]
    assert (part["version"], part["firmwareType"], part["vehicleType"]) == (2, 12, 2)
    assert part["plannedHomePosition"] == [0, 0, 0]
    assert [item["doJumpId"] for item in part["items"]] == list(range(1, len(frames) + 1))
    modes = [item.get("AltitudeMode") for item in part["items"]]
    assert modes == [2, None, 1, 2, 1, 4, 4]
    shown = part["items"][0]
    assert (shown["Altitude"], shown["AMSLAltAboveTerrain"]) == (7.0, None)
    keys = ("cruiseSpeed", "hoverSpeed", "globalPlanAltitudeMode")
    assert [part[key] for key in keys] == [15, 5, 0]
    for target in (0.0, 3.0, 1.5, math.nan, -1.0):
        jump = MissionItem(177, 2, (target, 1.0, 0.0, 0.0))
        with pytest.raises(MissionFileError, match=r"x\.plan: item 2: DO_JUMP to .*, 1 to 2"):
            render_mission(Mission((WAYPOINT, jump)), "x.plan")


def test_losses_of_a_plan_are_few() -> None:
    assert render_files(SOUND, "x.plan", PX4).lost == ()
    assert render_files(SOUND, "x.plan").lost == (
        "no autopilot is known: the plan is for a generic one",
    )
    nowhere = Mission(SOUND.items, unread=("fence",))
    assert render_files(nowhere, "x.plan", PX4).lost == (
        "without the fence that the vehicle may hold: not read from it; QGroundControl clears it "
        "there when it uploads this plan",
        "no home is known: the file says 0, 0, 0, which means none",
    )
    assert read_qgc_plan(write_qgc_plan(nowhere)).mission.unread == ("fence",)


def test_texts_that_are_no_plan() -> None:
    whole = GOOD.replace('"command": 16', '"command": 16.0')
    assert read_qgc_plan(whole).mission.items == (WAYPOINT,)
    for text, told in (
        ("", "line 1, column 1: not JSON"),
        ("9" * 5000, "a number of thousands of digits"),
        ('{"fileType": "Plan", "version": true}', "version: true; expected 1: open"),
        ('{"fileType": "Plan", "version": 1e400}', "version: inf; expected 1: open"),
        ('{"a": {"b": [0, {"c": 1, "c": 2}]}}', "key 'c': is there twice in one object"),
        ("[]", "nothing; expected an object"),
        (GOOD.replace("16", "9" * 400), "items[0].command: 9999"),
        (GOOD.replace("16", "true"), "items[0].command: true; expected a whole number from 0 to"),
    ):
        with pytest.raises(MissionFileError, match=re.escape(told)) as caught:
            read_qgc_plan(text)
        assert len(str(caught.value)) < 200
