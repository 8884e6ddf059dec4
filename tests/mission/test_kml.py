"""KML for Google Earth, read back as XML."""

import math
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence
from faao_mav.mission.formats import read_mission, render_files
from faao_mav.mission.formats.kml import write_kml

NAMES = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
HOME = Home(47.0, 8.0, 400.0)
TAKEOFF = MissionItem(22, 3, (0.0,) * 4, 0.0, 0.0, 30.0)
SPEED = MissionItem(178, 2, (1.0, 5.0, -1.0, 0.0))
WAYPOINT = MissionItem(16, 3, (12.5, 0.0, 0.0, 0.0), 47.001, 8.002, 50.0)
ABSOLUTE = MissionItem(82, 0, (0.0,) * 4, 47.002, 8.003, 460.0)
RTL = MissionItem(20, 2)
MISSION = Mission((TAKEOFF, SPEED, WAYPOINT, ABSOLUTE, RTL), HOME)


def parsed(*arguments: Any, **options: Any) -> Xml.Element:
    return Xml.fromstring(write_kml(*arguments, **options).encode())


def one(root: Xml.Element, path: str) -> Xml.Element:
    found = root.find(path, NAMES)
    assert found is not None
    return found


def numbers(text: str | None, separator: str | None) -> tuple[float, ...]:
    return tuple(map(float, (text or "").split(separator)))


def route(root: Xml.Element) -> tuple[str | None, list[tuple[float, ...]]]:
    line = one(root, ".//k:LineString")
    spots = (one(line, "k:coordinates").text or "").split()
    return one(line, "k:altitudeMode").text, [numbers(spot, ",") for spot in spots]


def names(root: Xml.Element) -> list[str | None]:
    return [node.text for node in root.findall(".//k:Placemark/k:name", NAMES)]


def test_the_route_goes_through_numbered_places_above_the_sea() -> None:
    root = parsed(MISSION, name="valley & hill")
    mode, spots = route(root)
    assert mode == "absolute"
    # A take-off at 0, 0 is where home is.
    assert spots == [(8.0, 47.0, 430.0), (8.002, 47.001, 450.0), (8.003, 47.002, 460.0)]
    assert names(root) == ["Route", "1", "3", "4"]
    assert one(root, "k:Document/k:name").text == "valley & hill"
    described = [node.text for node in root.findall(".//k:description", NAMES)]
    assert described == ["takeoff", "waypoint, hold 12.5 s", "spline waypoint"]
    assert names(parsed(Mission((SPEED, RTL), HOME))) == []


def test_without_the_height_of_home_heights_are_above_the_ground() -> None:
    for home in (None, Home(47.0, 8.0, math.nan)):
        mission = Mission(MISSION.items[2:3] * 2, home)
        assert route(parsed(mission)) == ("relativeToGround", [(8.002, 47.001, 50.0)] * 2)
        assert any("drawn above the ground" in line for line in render_files(mission, "x.kml").lost)


def test_stations_and_a_flight_along_the_time_slider() -> None:
    start = datetime(2026, 5, 1, 12, 0, tzinfo=timezone(timedelta(hours=2)))
    flight = [
        (start, (47.0, 8.0, 430.0)),
        (start + timedelta(seconds=61.5), (47.001, 8.002, 450.25)),
    ]
    root = parsed(MISSION, stations={"base <1>": (47.1, 8.1, 402.0)}, flight=flight)
    assert names(root)[-2:] == ["base <1>", "Flight"]
    track = one(root, ".//gx:Track")
    assert [node.text for node in track.findall("k:when", NAMES)] == [
        "2026-05-01T10:00:00.000Z",
        "2026-05-01T10:01:01.500Z",
    ]
    assert [numbers(node.text, None) for node in track.findall("gx:coord", NAMES)] == [
        (8.0, 47.0, 430.0),
        (8.002, 47.001, 450.25),
    ]


def test_a_fence_is_drawn_with_its_holes_and_circles() -> None:
    circles = Circle((47.0, 8.0), 300.0, True), Circle((47.0, 8.0), 20.0, False)
    root = parsed(Mission((), HOME, Fence(circles=circles)))
    assert names(root) == ["inclusion circle", "exclusion circle"]
    styles = [node.text for node in root.findall(".//k:styleUrl", NAMES)]
    assert styles == ["#inclusion", "#exclusion"]
    for node in root.findall(".//k:outerBoundaryIs/k:LinearRing/k:coordinates", NAMES):
        ring = [numbers(spot, ",") for spot in (node.text or "").split()]
        assert ring[0] == ring[-1]
        assert max(abs(y - 47) for _, y, _ in ring) == pytest.approx(
            max(abs(x - 8) for x, _, _ in ring) * math.cos(math.radians(47)), rel=0.01
        )


@given(st.text())
def test_any_name_gives_xml(name: str) -> None:
    assert parsed(MISSION, name=name).find("k:Document/k:name", NAMES) is not None


def test_what_kml_cannot_hold_is_told() -> None:
    nan = MissionItem(16, 10, (0.0, 0.0, 0.0, math.nan), 1.0, 2.0, 3.0)
    mission = Mission((nan, ABSOLUTE), HOME, Fence(circles=(Circle((0.0, 0.0), 1.0, True),)))
    assert render_files(mission, "x.kml").lost == (
        "KML holds route and fence alone: no commands, speeds or holds, and cannot be read back",
        "heights above terrain are drawn above Google Earth's own",
        "spline waypoints are joined by straight lines",
    )


def test_kml_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(MissionFileError, match=r"x\.kml: KML is written for drawing and lacks"):
        read_mission(tmp_path / "x.kml")
