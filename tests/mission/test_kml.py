"""KML for Google Earth, read back as XML."""

import math
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
from hypothesis import given
from hypothesis import strategies as st
from relay_flights import dash_hover_dash, mission_of, plan_with

from faao_mav.errors import InputError, MissionFileError
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence
from faao_mav.mission.formats import losses_in, read_mission
from faao_mav.mission.formats.kml import Station, TimedTrack, write_kml

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


def words(node: Xml.Element) -> list[str]:
    return (node.text or "").split()


def route(root: Xml.Element) -> tuple[str | None, list[tuple[float, ...]]]:
    line = one(root, ".//k:LineString")
    spots = [tuple(map(float, spot.split(","))) for spot in words(one(line, "k:coordinates"))]
    return one(line, "k:altitudeMode").text, spots


def names(root: Xml.Element) -> list[str | None]:
    return [node.text for node in root.findall(".//k:Placemark/k:name", NAMES)]


def test_the_route_goes_through_the_places_above_the_sea() -> None:
    mode, spots = route(parsed(MISSION))
    assert mode == "absolute"
    # A take-off at 0, 0 is where home is.
    assert spots == [(8.0, 47.0, 430.0), (8.002, 47.001, 450.0), (8.003, 47.002, 460.0)]


def test_waypoints_have_the_numbers_of_their_items() -> None:
    root = parsed(MISSION, name="valley & hill")
    assert names(root) == ["Route", "1", "3", "4"]
    assert one(root, "k:Document/k:name").text == "valley & hill"
    described = [node.text for node in root.findall(".//k:description", NAMES)]
    assert described == ["takeoff", "waypoint, hold 12.5 s", "spline waypoint"]


def test_without_home_heights_are_above_the_ground() -> None:
    mission = Mission(MISSION.items[2:3] * 2)
    assert route(parsed(mission)) == ("relativeToGround", [(8.002, 47.001, 50.0)] * 2)
    assert any("drawn above the ground" in line for line in losses_in(mission, "x.kml"))


def test_a_mission_that_flies_nowhere_is_an_empty_document() -> None:
    root = parsed(Mission((SPEED, RTL), HOME))
    assert names(root) == []


def test_stations_and_a_flight_along_the_time_slider() -> None:
    start = datetime(2026, 5, 1, 12, 0, tzinfo=timezone(timedelta(hours=2)))
    spots = [(47.0, 8.0, 430.0), (47.001, 8.002, 450.25)]
    root = parsed(
        MISSION,
        stations=[Station("base <1>", 47.1, 8.1, 402.0)],
        track=TimedTrack(start, [0.0, 61.5], spots),
    )
    assert names(root)[-2:] == ["base <1>", "Flight"]
    track = one(root, ".//gx:Track")
    assert [node.text for node in track.findall("k:when", NAMES)] == [
        "2026-05-01T10:00:00.000Z",
        "2026-05-01T10:01:01.500Z",
    ]
    assert [tuple(map(float, words(node))) for node in track.findall("gx:coord", NAMES)] == [
        (8.0, 47.0, 430.0),
        (8.002, 47.001, 450.25),
    ]
    tags = [node.tag.partition("}")[2] for node in track]
    assert tags == ["altitudeMode", "when", "when", "coord", "coord"]


def test_a_track_that_makes_no_sense_is_refused() -> None:
    start = datetime(2026, 5, 1, tzinfo=UTC)
    with pytest.raises(InputError, match="2 times for 1 places"):
        TimedTrack(start, [0.0, 1.0], [(0.0, 0.0, 0.0)])
    with pytest.raises(InputError, match="expected a time zone"):
        TimedTrack(start.replace(tzinfo=None), [], [])


@given(st.text())
def test_any_name_gives_xml(name: str) -> None:
    assert parsed(MISSION, name=name).find("k:Document/k:name", NAMES) is not None


def test_a_planned_mission_is_drawn() -> None:
    mission = mission_of(*dash_hover_dash(), plan_with())
    mode, spots = route(parsed(mission))
    flown = [item for item in mission.items if item.command in (16, 22)]
    assert mode == "absolute"
    assert spots == [pytest.approx((i.y, i.x, 684.0), abs=1e-8) for i in flown]


def test_what_kml_cannot_hold_is_told() -> None:
    nan = MissionItem(16, 10, (0.0, 0.0, 0.0, math.nan), 1.0, 2.0, 3.0)
    mission = Mission((nan, ABSOLUTE), HOME, Fence(circles=(Circle((0.0, 0.0), 1.0, True),)))
    told = losses_in(mission, "x.kml")
    assert told == [
        "KML holds route and fence alone: no commands, speeds or holds, and cannot be read back",
        "heights above terrain are drawn above Google Earth's own",
        "spline waypoints are joined by straight lines",
    ]


def test_kml_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(MissionFileError, match=r"x\.kml: KML is written for drawing and lacks"):
        read_mission(tmp_path / "x.kml")
