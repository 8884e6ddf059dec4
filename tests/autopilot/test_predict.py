"""Whole missions, from take-off to their end, in the words of `judged.py`."""

import math

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st
from judged import COPTER, FRAME, HOME, PLANE, at, do, given

from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.predict import predict
from faao_mav.errors import InputError
from faao_mav.mission import Command, Frame, Home, Mission, MissionItem
from faao_mav.mission.item import JUMPS

ARRIVED = 1.0
"""Metres: a copter is still braking when its waypoint counts as reached."""


def flown(line: str) -> Track:
    case = given(line)
    track = predict(case.mission, case.vehicle, FRAME)
    check(case.mission, track)
    return track


def check(mission: Mission, track: Track, step: float = 0.1) -> None:
    """What holds of every track."""
    assert (np.diff(track.t) > 0).all()
    assert len(track.t) == len(track.position) == len(track.velocity) == len(track.item)
    assert np.isfinite(track.position).all()
    assert np.isfinite(track.velocity).all()
    assert len(track.reached) == len(mission.items)
    assert len(track.t) == 0 or track.t[0] >= 0
    if len(track.t):
        assert 0 <= track.item.min() <= track.item.max() < max(len(mission.items), 1)
        known = track.reached[np.isfinite(track.reached)]
        assert (known >= 0).all()
        assert (known <= track.t[-1] + 2 * step).all()
    if any(item.command in JUMPS for item in mission.items):
        return
    assert (np.diff(track.item) >= 0).all()
    assert (np.diff(track.reached[np.isfinite(track.reached)]) >= -1e-9).all()
    for index, done in enumerate(track.reached):
        during = track.t[track.item == index]
        if math.isfinite(done) and len(during):
            assert during[-1] <= done + 1e-6
            assert done - during[-1] <= 2 * step


def test_take_offs() -> None:
    assert flown("takeoff:0,0,100").reached[0] == pytest.approx(46, abs=2)
    elsewhere = flown("takeoff:40,0,20")  # it climbs first
    assert abs(elsewhere.position[elsewhere.position[:, 2] < 19.9, 0]).max() < 0.1
    assert elsewhere.position[-1] == pytest.approx([40, 0, 20], abs=ARRIVED)
    track = flown("takeoff@0,0,20 waypoint:50,0,30")
    climbed = [np.interp(track.reached[0], track.t, x) for x in track.position.T]
    assert climbed == pytest.approx([0, 0, 20], abs=0.1)
    assert flown("px4 takeoff@nan,nan,20").position[-1] == pytest.approx([0, 0, 20], abs=0.1)
    with pytest.raises(InputError, match=r"more than 1\.5 h"):  # PX4 sets out for 0, 0
        flown("px4 takeoff@0,0,20")
    stays = given("takeoff waypoint:50,0,30 waypoint@0,0,30").mission
    assert predict(stays, COPTER).position[-1] == pytest.approx([50, 0, 30], abs=ARRIVED)


def test_the_return_ends_at_home_on_the_ground() -> None:
    track = flown("takeoff waypoint:100,50,30 return")
    assert track.position[-1] == pytest.approx([0, 0, 0], abs=0.1)
    assert track.reached[2] == pytest.approx(track.t[-1])
    level = math.hypot(100, 50) / 10 + 10 / 2.5 + 2.5 + 0.3  # the way and a ramp
    down = 10 / 0.5 + 20 / 1.5 + 1.5
    assert track.reached[2] - track.reached[1] == pytest.approx(level + down, abs=2)


def test_a_return_climbs_to_its_height_first() -> None:
    for words, height in (
        ("copter", 15),
        ("RTL_ALT=4000", 40),
        ("RTL_ALT_M=25", 25),
        ("px4", 60),
        ("px4 RTL_RETURN_ALT=20", 20),
    ):
        track = flown(f"{words} takeoff:0,0,5 waypoint:100,0,5 return")
        assert track.position[:, 2].max() == pytest.approx(height, abs=0.5)
        up = track.position[:, 2] > height - 0.5
        assert track.position[up][0, 0] == pytest.approx(100, abs=2.5)
        assert track.position[-1, 2] == pytest.approx(0, abs=1e-6)


def test_a_plane_returns_at_its_own_height_and_stays_up() -> None:
    for words, height in (
        ("", 100),
        ("ALT_HOLD_RTL=15000", 150),
        ("RTL_ALTITUDE=30", 30),
        ("RTL_ALTITUDE=-1", 50),
    ):
        track = flown(f"plane {words} takeoff:0,300,50 waypoint:0,3000,50 return")
        assert track.position[-1, 2] == pytest.approx(height, abs=3)
        assert np.hypot(*track.position[-1, :2]) < 150


def test_where_a_mission_ends() -> None:
    for end in ("return", "land:60,0,0", "loiter_unlim:60,0,30"):
        track = flown(f"takeoff {end} waypoint:500,0,30")
        assert track.position[:, 0].max() < 65
        assert math.isnan(track.reached[2])
    track = flown("takeoff waypoint:60,0,30 land:80,20,0")
    assert track.position[-1] == pytest.approx([80, 20, 0], abs=0.1)
    high = track.position[np.hypot(*(track.position[:, :2] - [80, 20]).T) > 3]
    assert high[high[:, 0] > 10, 2].min() > 29
    here = flown("takeoff waypoint:60,0,30 land@0,0,0")
    assert here.position[-1] == pytest.approx([60, 0, 0], abs=0.1)
    for last in ("loiter_unlim", "waypoint"):
        track = flown(f"takeoff waypoint:60,0,30 {last}:60,40,30")
        assert track.position[-1] == pytest.approx([60, 40, 30], abs=ARRIVED)
        assert track.t[-1] == pytest.approx(track.reached[2], abs=0.2)
    rally = "rally:250,0,25 takeoff waypoint:{},0,30 return"
    assert flown(rally.format(200)).position[-1] == pytest.approx([250, 0, 0], abs=0.1)
    assert flown(rally.format(20)).position[-1] == pytest.approx([0, 0, 0], abs=0.1)


def test_circles_of_a_copter_are_flown_as_fast_as_its_rate_and_acceleration_allow() -> None:
    one, five = (flown(f"takeoff loiter_turns:0,200,30,{number},0,10") for number in (1, 5))
    around = 2 * math.pi / min(math.radians(20), math.sqrt(2.5 / 20))
    assert five.t[-1] - one.t[-1] == pytest.approx(4 * around, rel=1e-3)
    circling = five.position[five.item == 1][-200:]
    assert np.hypot(circling[:, 0], circling[:, 1] - 200) == pytest.approx(10, abs=0.1)
    for vehicle in ("copter", "plane"):
        for radius, sense in ((40, -1), (-40, 1), (0, -1)):  # positive ones turn right
            track = flown(f"{vehicle} takeoff loiter_turns:0,200,30,1,0,{radius}")
            x, y, _ = track.position[track.item == 1].T
            angle = np.unwrap(np.arctan2(y - 200, x))[-100:]
            assert np.sign(angle[-1] - angle[0]) == sense


def test_circles_of_a_plane() -> None:
    one, three = (flown(f"plane takeoff loiter_turns:0,200,30,{n},0,150 return") for n in (1, 3))
    assert three.reached[1] - one.reached[1] == pytest.approx(2 * 2 * math.pi * 150 / 12, rel=0.01)
    track = flown("plane takeoff loiter_time:0,500,30,60")
    far = np.hypot(track.position[:, 0], track.position[:, 1] - 500)
    assert far[-300:] == pytest.approx(60, abs=0.5)
    up = flown("plane takeoff loiter_to_alt:0,500,230")
    assert up.position[-1, 2] == pytest.approx(230)
    assert up.t[-1] > 200 / 5


def visits(track: Track, east: float, north: float) -> int:
    """How often the track comes within 5 m."""
    near = np.hypot(*(track.position[:, :2] - [east, north]).T) < 5
    return int(np.count_nonzero(np.diff(near.astype(int)) == 1))


def test_jumps_are_followed() -> None:
    for repeats, expected in ((0, 1), (1, 2), (3, 4), (-1, 21)):
        track = flown(f"takeoff waypoint:60,0,30 waypoint:60,60,30 jump=2,{repeats} return")
        assert visits(track, 60, 60) == expected
        assert track.position[-1] == pytest.approx([0, 0, 0], abs=0.1)
        track = flown(f"takeoff tag=7 waypoint:60,0,30 waypoint:0,0,30 jump_tag=7,{repeats}")
        assert visits(track, 60, 0) == expected
    for nowhere in ("jump=0,2", "jump=9,2", "jump=-3,2", "jump_tag=9"):
        track = flown(f"takeoff waypoint:60,0,30 {nowhere} waypoint:60,60,30")
        assert visits(track, 60, 0) == 1
        assert track.position[-1] == pytest.approx([60, 60, 30], abs=ARRIVED)
    assert flown("waypoint:20,0,30 waypoint:0,0,30 4*jump=1,-1").t[-1] < 86_400
    with pytest.raises(InputError, match="more than"):
        flown("waypoint:100,0,30 waypoint:0,0,30 jump=1,5000")


def test_waits() -> None:
    def end(words: str) -> float:
        return float(flown(f"{words} waypoint:200,0,30").t[-1])

    held = end("takeoff waypoint:100,0,30,7")
    assert end("takeoff waypoint:100,0,30 delay=7.6") - held == pytest.approx(0.6, abs=0.05)
    assert end("takeoff waypoint:100,0,30,7.6") == held  # ArduCopter keeps whole seconds
    kept = [end(f"px4 takeoff waypoint:100,0,30,{hold}") for hold in (5.0, 7.6)]
    assert kept[1] - kept[0] == pytest.approx(2.6, abs=0.1)
    track = flown("takeoff loiter_time:0,0,30,9")
    assert track.reached[1] - track.reached[0] == pytest.approx(9, abs=0.2)
    waits = end("plane takeoff waypoint:500,0,30,60 delay=60")
    assert waits == end("plane takeoff waypoint:500,0,30")


def test_speed_changes() -> None:
    for words, fastest in (
        ("copter", 10),
        ("WPNAV_SPEED=700", 7),
        ("change_speed=0,6", 6),
        ("change_speed=2,6", 10),
        ("change_speed=1,nan", 10),
        ("px4 change_speed=3,3", 3),
        ("px4 change_speed=1,3 change_speed=1,-1", 5),
        ("px4 MPC_XY_VEL_MAX=3 change_speed=1,9", 3),
    ):
        track = flown(f"{words} takeoff waypoint:300,0,30")
        assert track.velocity[:, 0].max() == pytest.approx(fastest, abs=0.4)
    track = flown("takeoff waypoint:150,0,30 change_speed=1,4 waypoint:300,0,30")
    assert track.velocity[track.item == 1, 0].max() == pytest.approx(10, abs=0.1)
    assert track.reached[3] - track.reached[1] == pytest.approx(150 / 4, abs=5)


def test_climb_and_descent_speeds() -> None:
    for change, up, down in ((0, 22.5, 36), ("2,5", 14, 36), ("3,0.5", 22.5, 100)):
        track = flown(f"takeoff change_speed={change} waypoint:0,0,80 waypoint:0,0,30")
        rose, sank = np.diff(track.reached[[0, 2, 3]])
        assert rose == pytest.approx(up, abs=2)
        assert sank == pytest.approx(down, abs=2)
    for most, climb in ((2.0, 2.0), (6.0, 3.0)):  # PX4's own in missions is 3 m/s
        steep = "takeoff waypoint:0,20,30 waypoint:0,40,90"
        track = flown(f"px4 MPC_Z_VEL_MAX_UP={most} {steep}")
        assert track.velocity[:, 2].max() == pytest.approx(climb, abs=0.5)


def test_slants_are_straight() -> None:
    for vehicle in ("copter", "px4", "plane"):
        track = flown(f"{vehicle} takeoff:0,0,30 waypoint:0,200,30 waypoint:0,800,90")
        middle = track.position[np.argmin(abs(track.position[:, 1] - 500))]
        assert middle[2] == pytest.approx(60, abs=3)


def test_heights_above_the_sea_and_flights_without_a_home() -> None:
    track = flown("takeoff waypoint:50,0,614/0")
    assert track.position[-1] == pytest.approx([50, 0, 30], abs=ARRIVED)
    with pytest.raises(InputError, match=r"altitude 614; .* altitude of home"):
        flown("homeless takeoff waypoint:50,0,614/0")
    track = predict(given("homeless waypoint:0,0,30 waypoint:70,0,30").mission, COPTER)
    assert track.position[0] == pytest.approx([0, 0, 0], abs=1e-6)  # below its first place
    place = track.frame.latitude, track.frame.longitude
    assert place == pytest.approx((HOME.latitude, HOME.longitude))
    assert track.position[-1] == pytest.approx([70, 0, 30], abs=ARRIVED)
    for nothing in ("", "change_speed=1,5 jump=1,-1"):
        assert len(flown(nothing).t) == 0


def test_what_is_no_place_or_parameter_is_refused() -> None:
    for words, part in (
        ("waypoint@nan,8,30", "mission item 2: nan, .* is no place to fly to"),
        ("waypoint@91,8,30", "mission item 2: 91.0"),
        ("waypoint:50,0,nan", "mission item 2: altitude nan; expected metres"),
    ):
        with pytest.raises(InputError, match=part):
            flown(f"takeoff {words}")
    useless = Vehicle(parameters={"LAND_SPEED": 0.0}, source="quad.param")
    with pytest.raises(InputError, match=r"quad\.param: LAND_SPEED: 0"):
        predict(given("takeoff return").mission, useless)
    with pytest.raises(InputError, match="no model of how PX4 flies planes"):
        flown("px4-plane waypoint:100,0,30")


def test_flights_without_end_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    waits = "waypoint:100,0,30,1e9", "delay=1e9"
    for vehicle, hours in (("copter", "1.5"), ("px4", "1.5"), ("plane", "6")):
        ways = "waypoint:5000000,0,30", "waypoint:100,0,1e7"
        for long in ways if vehicle == "plane" else ways + waits:
            with pytest.raises(InputError, match=f"more than {hours} h"):
                flown(f"{vehicle} takeoff waypoint:50,0,30 {long} waypoint:60,0,30")
    # Legs of 12 m take 3 s, but PX4 circles for ten times that round ends with tiny radii.
    monkeypatch.setattr("faao_mav.autopilot.predict.LONGEST_COPTER", 120.0)
    for radius in (0, 0.05):
        ends = (f"waypoint:{10 * (k % 2)},{10 * (k % 3)},30,0,{radius}" for k in range(9))
        line = " ".join(["px4", *ends])
        if radius == 0:
            assert flown(line).t[-1] < 120
        else:
            with pytest.raises(InputError, match="more than 120 s"):
                flown(line)


metres = st.floats(-300, 300)
numbers = st.one_of(st.floats(-5, 60), st.sampled_from([math.nan, 0.0, -1.0, 1e9]))


@st.composite
def any_items(draw: st.DrawFn) -> MissionItem:
    """Items at valid places, with any parameters."""
    params = draw(st.tuples(*[numbers] * 4))
    if draw(st.booleans()):
        commands = [Command.NAV_WAYPOINT] * 3 + list(Command)
        frame = draw(st.sampled_from([Frame.GLOBAL_RELATIVE_ALT] * 4 + [Frame.GLOBAL, 10, 6]))
        height = draw(st.floats(0, 60)) + (HOME.altitude if frame == Frame.GLOBAL else 0)
        command = draw(st.sampled_from(commands))
        return at(draw(metres), draw(metres), height, *params, command=command, frame=frame)
    return do(draw(st.sampled_from([*Command, 183, 206])), *params)


@settings(max_examples=30)
@drawn(
    st.lists(any_items(), max_size=8),
    st.sampled_from([None, HOME]),
    st.sampled_from([COPTER, COPTER, PLANE]),
)
def test_any_mission_is_predicted_or_refused(
    items: list[MissionItem], home: Home | None, vehicle: Vehicle
) -> None:
    mission = Mission(tuple(items), home)
    try:
        track = predict(mission, vehicle, FRAME, step=0.5)
    except InputError as refused:
        assert str(refused)
        return
    check(mission, track, step=0.5)
