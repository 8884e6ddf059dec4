"""KML for Google Earth, read back as XML."""

import math
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as Xml

import pytest

from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence
from faao_mav.mission.formats import render_files
from faao_mav.mission.formats.kml import write_kml

NAMES = {"k": "http://www.opengis.net/kml/2.2"}
HOME = Home(47.0, 8.0, 400.0)
TAKEOFF = MissionItem(22, 3, (0.0,) * 4, 0.0, 0.0, 30.0)
SPEED = MissionItem(178, 2, (1.0, 5.0, -1.0, 0.0))
WAYPOINT = MissionItem(16, 3, (12.5, 0.0, 0.0, 0.0), 47.001, 8.002, 50.0)
ABSOLUTE = MissionItem(82, 0, (0.0,) * 4, 47.002, 8.003, 460.0)
MISSION = Mission((TAKEOFF, SPEED, WAYPOINT, ABSOLUTE, MissionItem(20, 2)), HOME)


def parsed(*arguments: Any, **options: Any) -> Xml.Element:
    return Xml.fromstring(write_kml(*arguments, **options).encode())


def texts(root: Xml.Element, path: str) -> list[str]:
    return [node.text or "" for node in root.findall(f".//{path}", NAMES)]


def places(text: str) -> list[tuple[float, ...]]:
    return [tuple(map(float, spot.split(","))) for spot in text.split()]


def test_route_and_waypoints() -> None:
    root = parsed(MISSION, name="valley & <hill>\x00\ud800\uffff\x1b")
    assert texts(root, "k:Placemark/k:name") == ["Route", "1", "3", "4"]
    assert texts(root, "k:name")[0] == "valley & <hill>????"
    assert texts(root, "k:LineString/k:altitudeMode") == ["absolute"]
    # A take-off at 0, 0 is where home is.
    assert places(texts(root, "k:LineString/k:coordinates")[0]) == [
        (8.0, 47.0, 430.0),
        (8.002, 47.001, 450.0),
        (8.003, 47.002, 460.0),
    ]


def test_without_the_height_of_home_heights_are_above_the_ground() -> None:
    for home in (None, Home(47.0, 8.0, math.nan)):
        mission = Mission((WAYPOINT, replace(WAYPOINT, z=math.nan), WAYPOINT), home)
        assert texts(parsed(mission), "k:LineString/k:altitudeMode") == ["relativeToGround"]
        (line,) = texts(parsed(mission), "k:LineString/k:coordinates")
        assert places(line) == [(8.002, 47.001, 50.0)] * 2
    nowhere = parsed(Mission((TAKEOFF, WAYPOINT)))  # the take-off would be at home
    assert texts(nowhere, "k:Placemark/k:name") == ["2"]


def test_a_fence_is_drawn_with_its_holes_and_circles() -> None:
    circles = Circle((47.0, 8.0), 300.0, True), Circle((47.0, 8.0), 20.0, False)
    root = parsed(Mission((), HOME, Fence(circles=circles)))
    assert texts(root, "k:Placemark/k:name") == ["inclusion circle", "exclusion circle"]
    assert texts(root, "k:styleUrl") == ["#inclusion", "#exclusion"]
    for text in texts(root, "k:outerBoundaryIs/k:LinearRing/k:coordinates"):
        ring = places(text)
        assert ring[0] == ring[-1]
        assert max(abs(y - 47) for _, y, _ in ring) == pytest.approx(
            max(abs(x - 8) for x, _, _ in ring) * math.cos(math.radians(47)), rel=0.01
        )


def test_what_kml_cannot_hold_is_told() -> None:
    nan = MissionItem(16, 10, (0.0, 0.0, 0.0, math.nan), 1.0, 2.0, 3.0)
    mission = Mission((nan, *MISSION.items), HOME, Fence(circles=(Circle((0.0, 0.0), 1.0, True),)))
    assert render_files(mission, "x.kml").lost == (
        "KML holds route and fence alone: no commands, speeds or holds, and cannot be read back",
        "heights above terrain, or above a home without a height, are drawn above the ground",
        "spline waypoints are joined by straight lines",
    )
