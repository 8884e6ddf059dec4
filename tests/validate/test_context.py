"""Where the items lie and how they are joined."""

import math

import pytest
from judged import PX4, given, latlon

from faao_mav.geodesy import LocalFrame
from faao_mav.validate.context import HOME as AT_HOME
from faao_mav.validate.context import ValidationContext


def test_places_count_from_home_in_every_frame() -> None:
    items = "waypoint:0,9,30 waypoint:0,9,614/0 waypoint:0,9,614/5 waypoint:0,9,30/6"
    for home, expected in (("", [30, 30, 30, 30]), ("homeless", [30, None, None, 30])):
        ups = [place.up for place in given(f"{home} {items}").places]
        assert [None if math.isnan(up) else up for up in ups] == expected
    assert math.isnan(given("waypoint:0,9,30/10").places[0].up)
    case = given("waypoint:10,20,30 waypoint@0,0,15")  # here for ArduPilot, and Africa for PX4
    assert case.places[1].place == pytest.approx(10 + 20j, abs=1e-6)
    assert case.places[1].up == 15
    assert len(ValidationContext(case.mission, PX4).places) == 1
    assert given("homeless delay=1 waypoint:5,5,9").frame == LocalFrame(*latlon(5, 5))
    assert given("homeless delay=1").frame is None


def test_legs_follow_items_jumps_circles_and_the_way_home() -> None:
    legs = given("takeoff waypoint:0,100,30 waypoint:100,100,30 jump=2,1 return").legs
    assert [(leg.index, leg.start.index, leg.end.index, leg.jump) for leg in legs] == [
        (0, AT_HOME, 0, False),
        (1, 0, 1, False),
        (2, 1, 2, False),
        (3, 2, 1, True),
        (4, 2, AT_HOME, False),
    ]
    assert [round(leg.length) for leg in legs] == [0, 100, 100, 100, 141]
    assert legs[0].rise == 30
    to, away = given("takeoff loiter_turns:0,200,30,1,0,50 waypoint:200,200,30").legs[1:]
    assert to.end.place == pytest.approx(150j, abs=0.1)
    assert away.start.place == pytest.approx(50 + 200j, abs=0.1)


def test_a_return_goes_where_the_vehicle_chooses() -> None:
    for words, expected in (
        ("rally:0,250,50", (0, 250)),  # of rally points and home the nearest
        ("rally:0,250,50 rally:0,190,50", (0, 190)),
        ("rally:0,450,50", (0, 0)),
        ("rally:0,510,50", (0, 0)),  # beyond RALLY_LIMIT_KM, 0.3
        ("RALLY_LIMIT_KM=0 RALLY_INCL_HOME=0 rally:0,1500,50", (0, 1500)),
        ("RALLY_INCL_HOME=0 rally:0,480,50", (0, 480)),
        ("plane rally:0,900,50", (0, 900)),  # home is not among a plane's by default
        ("px4 rally:0,250,50", (0, 250)),
        ("px4 RTL_TYPE=1 rally:0,900,50", (0, 900)),
        ("px4 RTL_TYPE=2 rally:0,250,50", (0, 0)),
    ):
        back = given(f"{words} takeoff waypoint:0,200,30 return").legs[-1].end
        assert back.place == pytest.approx(complex(*expected), abs=0.1)


def test_speeds_hold_from_change_to_change() -> None:
    for words, expected in (
        ("change_speed=1,8", [8, 8]),
        ("change_speed=1,8 change_speed=2,3 change_speed=1,0", [8, 8, 8, 8]),
        ("WPNAV_SPEED=700", [7]),
        ("WPNAV_SPEED=700 WP_SPD=6", [6]),
        ("WPNAV_SPEED=0", [10]),
        ("px4 change_speed=1,8 change_speed=2,3 change_speed=1,-1", [8, 3, 5, 5]),
        ("plane change_speed=0,15 change_speed=1,18 change_speed=0,-2", [15, 15, 12, 12]),
    ):
        assert given(f"{words} waypoint:0,9,9").speeds == tuple(expected)
