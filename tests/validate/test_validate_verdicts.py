"""The rules, held to what ArduCopter, ArduPlane and PX4 made of missions (tests/data/verdicts).

The verdicts are recorded by `tests/real_autopilots/record_verdicts.py`, which says what each means.
"""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from judged import HOME

from faao_mav.autopilot import Vehicle
from faao_mav.mission.fence import Fence, Polygon
from faao_mav.mission.item import Mission, MissionItem
from faao_mav.validate import Finding, Level, validate

FOLDER = Path(__file__).parents[1] / "data" / "verdicts"
VEHICLES = {
    "arducopter": ("ardupilot", "copter"),
    "arduplane": ("ardupilot", "plane"),
    "px4": ("px4", "copter"),
}
RECORDED: dict[str, dict[str, Any]] = {
    f"{vehicle}/{name}": mission
    for vehicle in VEHICLES
    for name, mission in json.loads((FOLDER / f"{vehicle}.json").read_text()).items()
}
NOT_FLOWN = {"refused", "rejected", "not armed", "not started", "on the ground", "crashed"}
CUT_SHORT = {"stuck", "ended early"}

STRICTER = {"px4/home-outside-fence": "PX4 says so and flies: nothing keeps it within the fence"}
"""Missions that were flown in the simulator and are errors here, and why."""

MILDER = {
    "arducopter/700-items": "a warning: boards differ in how many they store",
    "arducopter/nan-hold": "a warning: for what is not set our own upload sends 0",
    "arducopter/script-time": "builds with scripting take it",
}
"""Missions that were not flown as they are written, with less than is asked here, and why."""


def findings(name: str) -> tuple[Finding, ...]:
    recorded = RECORDED[name]
    items = []
    for times, command, frame, *values, autocontinue in recorded["items"]:
        p1, p2, p3, p4, x, y, z = (math.nan if v is None else v for v in values)
        item = MissionItem(command, frame, (p1, p2, p3, p4), x, y, z, bool(autocontinue))
        items += [item] * times
    corners = tuple((latitude, longitude) for latitude, longitude in recorded.get("fence", ()))
    fence = Fence((Polygon(corners, inclusion=True),)) if corners else Fence()
    vehicle = Vehicle(*VEHICLES[name.split("/")[0]], recorded["parameters"])
    return validate(Mission(tuple(items), HOME, fence), vehicle)


@pytest.mark.parametrize("name", RECORDED)
def test_the_worst_finding_is_as_bad_as_the_verdict(name: str) -> None:
    verdict, found = RECORDED[name]["verdict"], findings(name)
    errors = [finding for finding in found if finding.level is Level.ERROR]
    warned = errors or [finding for finding in found if finding.level is Level.WARNING]
    if verdict in NOT_FLOWN:
        assert bool(errors) is (name not in MILDER)
    elif verdict in CUT_SHORT:
        assert bool(warned) is (name not in MILDER)
    else:
        assert verdict == "flown"
        assert bool(errors) is (name in STRICTER), errors


@pytest.mark.parametrize("name", [n for n, mission in RECORDED.items() if "item" in mission])
def test_the_item_that_is_refused_is_named(name: str) -> None:
    if name not in MILDER:
        refused = RECORDED[name]["item"]
        assert refused in {f.item for f in findings(name) if f.level is Level.ERROR}


def test_there_are_verdicts_of_all_kinds_and_all_vehicles() -> None:
    assert {name.split("/")[0] for name in RECORDED} == set(VEHICLES)
    assert {mission["verdict"] for mission in RECORDED.values()} == NOT_FLOWN | CUT_SHORT | {
        "flown"
    }
    assert set(STRICTER) | set(MILDER) <= set(RECORDED)
