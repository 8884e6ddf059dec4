"""Whole missions, from take-off to their end."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.predict import predict
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Frame, Home, Mission, MissionItem
from faao_mav.mission.fence import RallyPoint
from faao_mav.mission.item import JUMPS

HOME = Home(47.4, 8.5, 400.0)
FRAME = LocalFrame(47.4, 8.5)
ARRIVED = 1.0
"""Metres: a copter is still braking when its waypoint counts as reached."""

COPTER = Vehicle()
PX4 = Vehicle("px4")
PLANE = Vehicle("ardupilot", "plane")
VEHICLES = [COPTER, PX4, PLANE]


def four(*params: float) -> tuple[float, float, float, float]:
    one, two, three, last = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return one, two, three, last


def at(
    command: int,
    east: float = 0.0,
    north: float = 0.0,
    up: float = 30.0,
    *params: float,
    frame: int = Frame.GLOBAL_RELATIVE_ALT,
) -> MissionItem:
    latitude, longitude = FRAME.to_geodetic([east, north])
    return MissionItem(command, frame, four(*params), float(latitude), float(longitude), up)


def do(command: int, *params: float) -> MissionItem:
    return MissionItem(command, Frame.MISSION, four(*params))


def waypoint(east: float, north: float, hold: float = 0.0, up: float = 30.0) -> MissionItem:
    return at(Command.NAV_WAYPOINT, east, north, up, hold)


TAKEOFF = at(Command.NAV_TAKEOFF)
RTL = do(Command.NAV_RETURN_TO_LAUNCH)


def flown(*items: MissionItem, vehicle: Vehicle = COPTER, home: Home | None = HOME) -> Track:
    mission = Mission(items, home)
    track = predict(mission, vehicle, FRAME)
    check(mission, track)
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


def when(track: Track, index: int) -> float:
    return float(track.reached[index])


def place(track: Track, t: float) -> list[float]:
    return [float(np.interp(t, track.t, x)) for x in track.position.T]


def test_take_offs() -> None:
    assert when(flown(at(Command.NAV_TAKEOFF, up=100.0)), 0) == pytest.approx(46, abs=2)
    elsewhere = flown(at(Command.NAV_TAKEOFF, 40, 0, 20))  # it climbs first
    assert abs(elsewhere.position[elsewhere.position[:, 2] < 19.9, 0]).max() < 0.1
    assert elsewhere.position[-1] == pytest.approx([40, 0, 20], abs=ARRIVED)
    here = MissionItem(Command.NAV_TAKEOFF, Frame.GLOBAL_RELATIVE_ALT, z=20.0)
    track = flown(here, waypoint(50, 0))
    assert place(track, when(track, 0)) == pytest.approx([0, 0, 20], abs=0.1)
    ways = TAKEOFF, waypoint(50, 0), replace(waypoint(0, 0), x=0.0, y=0.0)
    assert predict(Mission(ways, HOME), COPTER).position[-1] == pytest.approx([50, 0, 30], abs=1)
    unset = replace(here, x=math.nan, y=math.nan)
    assert flown(unset, vehicle=PX4).position[-1] == pytest.approx([0, 0, 20], abs=0.1)
    with pytest.raises(InputError, match=r"more than 1\.5 h"):  # PX4 sets out for 0, 0
        flown(here, vehicle=PX4)


def test_the_return_ends_at_home_on_the_ground() -> None:
    track = flown(TAKEOFF, waypoint(100, 50), RTL)
    assert track.position[-1] == pytest.approx([0, 0, 0], abs=0.1)
    assert when(track, 2) == pytest.approx(track.t[-1])
    level = math.hypot(100, 50) / 10 + 10 / 2.5 + 2.5 + 0.3  # the way and a ramp
    down = 10 / 0.5 + 20 / 1.5 + 1.5
    assert when(track, 2) - when(track, 1) == pytest.approx(level + down, abs=2)


def test_a_return_climbs_to_its_height_first() -> None:
    for vehicle, height in (
        (COPTER, 15),
        (Vehicle(parameters={"RTL_ALT": 4000}), 40),
        (Vehicle(parameters={"RTL_ALT_M": 25}), 25),
        (PX4, 60),
        (Vehicle("px4", parameters={"RTL_RETURN_ALT": 20}), 20),
    ):
        track = flown(at(Command.NAV_TAKEOFF, up=5), waypoint(100, 0, up=5), RTL, vehicle=vehicle)
        assert track.position[:, 2].max() == pytest.approx(height, abs=0.5)
        up = track.position[:, 2] > height - 0.5
        assert track.position[up][0, 0] == pytest.approx(100, abs=2.5)
        assert track.position[-1, 2] == pytest.approx(0, abs=1e-6)


def test_what_comes_after_the_end_is_not_flown() -> None:
    for end in (RTL, at(Command.NAV_LAND, 60, 0, 0), at(Command.NAV_LOITER_UNLIM, 60, 0)):
        track = flown(TAKEOFF, end, waypoint(500, 0))
        assert track.position[:, 0].max() < 65
        assert math.isnan(when(track, 2))


def test_where_a_mission_ends() -> None:
    track = flown(TAKEOFF, waypoint(60, 0), at(Command.NAV_LAND, 80, 20, 0))
    assert track.position[-1] == pytest.approx([80, 20, 0], abs=0.1)
    high = track.position[np.hypot(*(track.position[:, :2] - [80, 20]).T) > 3]
    assert high[high[:, 0] > 10, 2].min() > 29
    here = flown(TAKEOFF, waypoint(60, 0), MissionItem(Command.NAV_LAND, 3))
    assert here.position[-1] == pytest.approx([60, 0, 0], abs=0.1)
    for last in (at(Command.NAV_LOITER_UNLIM, 60, 40), waypoint(60, 40)):
        track = flown(TAKEOFF, waypoint(60, 0), last)
        assert track.position[-1] == pytest.approx([60, 40, 30], abs=ARRIVED)
        assert track.t[-1] == pytest.approx(when(track, 2), abs=0.2)


def turns(number: float, radius: float, **changes: Any) -> MissionItem:
    item = at(Command.NAV_LOITER_TURNS, 0, 200)
    return replace(item, params=(number, 0.0, radius, 0.0), **changes)


def test_circles_of_a_copter_are_flown_as_fast_as_its_rate_and_acceleration_allow() -> None:
    one, five = (flown(TAKEOFF, turns(number, 10)) for number in (1, 5))
    around = 2 * math.pi / min(math.radians(20), math.sqrt(2.5 / 20))
    assert five.t[-1] - one.t[-1] == pytest.approx(4 * around, rel=1e-3)
    circling = five.position[five.item == 1][-200:]
    assert np.hypot(circling[:, 0], circling[:, 1] - 200) == pytest.approx(10, abs=0.1)
    for vehicle in (COPTER, PLANE):
        for radius, sense in ((40, -1), (-40, 1), (0, -1)):  # positive ones turn right
            track = flown(TAKEOFF, turns(1, radius), vehicle=vehicle)
            x, y, _ = track.position[track.item == 1].T
            angle = np.unwrap(np.arctan2(y - 200, x))[-100:]
            assert np.sign(angle[-1] - angle[0]) == sense


def test_circles_of_a_plane() -> None:
    plane = PLANE
    one, three = (flown(TAKEOFF, turns(number, 150), RTL, vehicle=plane) for number in (1, 3))
    assert when(three, 1) - when(one, 1) == pytest.approx(2 * 2 * math.pi * 150 / 12, rel=0.01)
    waiting = replace(at(Command.NAV_LOITER_TIME, 0, 500), params=(60.0, 0.0, 0.0, 0.0))
    track = flown(TAKEOFF, waiting, vehicle=plane)
    far = np.hypot(track.position[:, 0], track.position[:, 1] - 500)
    assert far[-300:] == pytest.approx(60, abs=0.5)
    climbing = replace(at(Command.NAV_LOITER_TO_ALT, 0, 500), z=230.0)
    up = flown(TAKEOFF, climbing, vehicle=plane)
    assert up.position[-1, 2] == pytest.approx(230)
    assert up.t[-1] > 200 / 5


def test_a_return_ends_at_the_nearest_rally_point() -> None:
    place = FRAME.to_geodetic([250.0, 0.0])
    rally = (RallyPoint(float(place[0]), float(place[1]), 25.0),)
    mission = Mission((TAKEOFF, waypoint(200, 0), RTL), HOME, rally=rally)
    assert predict(mission, COPTER).position[-1] == pytest.approx([250, 0, 0], abs=0.1)
    near_home = replace(mission, items=(TAKEOFF, waypoint(20, 0), RTL))
    assert predict(near_home, COPTER).position[-1] == pytest.approx([0, 0, 0], abs=0.1)


def visits(track: Track, east: float, north: float) -> int:
    """How often the track comes within 5 m."""
    near = np.hypot(*(track.position[:, :2] - [east, north]).T) < 5
    return int(np.count_nonzero(np.diff(near.astype(int)) == 1))


def test_jumps_are_followed() -> None:
    for repeats, expected in ((0, 1), (1, 2), (3, 4), (-1, 21)):
        back = do(Command.DO_JUMP, 2, repeats)
        track = flown(TAKEOFF, waypoint(60, 0), waypoint(60, 60), back, RTL)
        assert visits(track, 60, 60) == expected
        assert track.position[-1] == pytest.approx([0, 0, 0], abs=0.1)
        tag, back = do(Command.JUMP_TAG, 7), do(Command.DO_JUMP_TAG, 7, repeats)
        track = flown(TAKEOFF, tag, waypoint(60, 0), waypoint(0, 0), back)
        assert visits(track, 60, 0) == expected
    for nowhere in (*(do(Command.DO_JUMP, k, 2) for k in (0, 9, -3)), do(Command.DO_JUMP_TAG, 9)):
        track = flown(TAKEOFF, waypoint(60, 0), nowhere, waypoint(60, 60))
        assert visits(track, 60, 0) == 1
        assert track.position[-1] == pytest.approx([60, 60, 30], abs=ARRIVED)
    endless = [do(Command.DO_JUMP, 1, -1)] * 4
    assert flown(waypoint(20, 0), waypoint(0, 0), *endless).t[-1] < 86_400


def test_waits() -> None:
    def end(*items: MissionItem, vehicle: Vehicle = COPTER) -> float:
        return float(flown(TAKEOFF, *items, waypoint(200, 0), vehicle=vehicle).t[-1])

    delay = do(Command.NAV_DELAY, 7.6, -1, -1, -1)
    held = end(waypoint(100, 0, hold=7))
    assert end(waypoint(100, 0), delay) - held == pytest.approx(0.6, abs=0.05)
    assert end(waypoint(100, 0, hold=7.6)) == held  # ArduCopter keeps whole seconds
    kept = [end(waypoint(100, 0, hold), vehicle=PX4) for hold in (5.0, 7.6)]
    assert kept[1] - kept[0] == pytest.approx(2.6, abs=0.1)
    track = flown(TAKEOFF, at(Command.NAV_LOITER_TIME, 0, 0, 30, 9))
    assert when(track, 1) - when(track, 0) == pytest.approx(9, abs=0.2)
    waits = waypoint(500, 0, hold=60), do(Command.NAV_DELAY, 60, -1, -1, -1)
    plain = flown(TAKEOFF, waypoint(500, 0), waypoint(900, 0), vehicle=PLANE)
    assert flown(TAKEOFF, *waits, waypoint(900, 0), vehicle=PLANE).t[-1] == plain.t[-1]


def top_speed(vehicle: Vehicle, *changes: MissionItem) -> float:
    track = flown(TAKEOFF, *changes, waypoint(300, 0), vehicle=vehicle)
    return float(track.velocity[:, 0].max())


def speed(kind: float, value: float) -> MissionItem:
    return do(Command.DO_CHANGE_SPEED, kind, value, -1)


def test_speed_changes() -> None:
    for vehicle, changes, fastest in (
        (COPTER, (), 10),
        (Vehicle(parameters={"WPNAV_SPEED": 700}), (), 7),
        (COPTER, (speed(0, 6),), 6),
        (COPTER, (speed(1, 6),), 6),
        (COPTER, (speed(2, 6),), 10),
        (COPTER, (speed(1, math.nan),), 10),
        (PX4, (speed(3, 3),), 3),
        (PX4, (speed(1, 3), speed(1, -1)), 5),
    ):
        assert top_speed(vehicle, *changes) == pytest.approx(fastest, abs=0.4)
    track = flown(TAKEOFF, waypoint(150, 0), speed(1, 4), waypoint(300, 0))
    assert track.velocity[track.item == 1, 0].max() == pytest.approx(10, abs=0.1)
    assert when(track, 3) - when(track, 1) == pytest.approx(150 / 4, abs=5)


def test_climb_and_descent_speeds() -> None:
    for changes, up, down in (
        ((), 22.5, 36),
        ((speed(2, 5),), 14, 36),
        ((speed(3, 0.5),), 22.5, 100),
    ):
        track = flown(TAKEOFF, *changes, waypoint(0, 0, up=80), waypoint(0, 0, up=30))
        first, second = (when(track, len(changes) + k) for k in (1, 2))
        assert first - when(track, 0) == pytest.approx(up, abs=2)
        assert second - first == pytest.approx(down, abs=2)
    steep = (at(Command.NAV_TAKEOFF), at(Command.NAV_WAYPOINT, 0, 20, 30), waypoint(0, 40, up=90))
    for most, climb in ((2.0, 2.0), (6.0, 3.0)):  # PX4's own in missions is 3 m/s
        track = flown(*steep, vehicle=replace(PX4, parameters={"MPC_Z_VEL_MAX_UP": most}))
        assert track.velocity[:, 2].max() == pytest.approx(climb, abs=0.5)


def test_heights_above_the_sea() -> None:
    high = at(Command.NAV_WAYPOINT, 50, 0, 430, frame=Frame.GLOBAL)
    track = flown(TAKEOFF, high)
    assert track.position[-1] == pytest.approx([50, 0, 30], abs=ARRIVED)
    with pytest.raises(InputError, match=r"mission item 2: an altitude above sea level needs"):
        flown(TAKEOFF, high, home=None)


def test_what_is_no_place_or_parameter_is_refused() -> None:
    for item, part in (
        (replace(waypoint(50, 0), x=math.nan), "mission item 2: nan, .* is no place to fly to"),
        (replace(waypoint(50, 0), x=91.0), "mission item 2: 91.0"),
        (replace(waypoint(50, 0), z=math.nan), "mission item 2: altitude nan; expected metres"),
        (do(Command.DO_JUMP, math.nan, 2), "mission item 2: DO_JUMP to nan"),
    ):
        with pytest.raises(InputError, match=part):
            flown(TAKEOFF, item)
    vehicle = Vehicle(parameters={"LAND_SPEED": 0.0}, source="quad.param")
    with pytest.raises(InputError, match=r"quad\.param: LAND_SPEED: 0"):
        flown(TAKEOFF, RTL, vehicle=vehicle)


def test_without_a_home_the_flight_begins_below_its_first_place() -> None:
    mission = Mission((waypoint(0, 0), waypoint(70, 0)))
    track = predict(mission, COPTER)
    assert track.position[0] == pytest.approx([0, 0, 0], abs=1e-6)
    assert (track.frame.latitude, track.frame.longitude) == pytest.approx((47.4, 8.5))
    assert track.position[-1] == pytest.approx([70, 0, 30], abs=ARRIVED)


def test_a_mission_without_places_has_no_track() -> None:
    for items in ((), (speed(1, 5), do(Command.DO_JUMP, 1, -1))):
        track = predict(Mission(items, HOME), COPTER)
        assert len(track.t) == len(track.position) == len(track.item) == 0
        assert np.isnan(track.reached).all()
        assert len(track.reached) == len(items)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_flights_without_end_are_refused(vehicle: Vehicle) -> None:
    waits = (waypoint(100, 0, hold=1e9), do(Command.NAV_DELAY, 1e9, -1, -1, -1))
    for long in (
        waypoint(5_000_000, 0),
        waypoint(100, 0, up=1e7),
        *(waits if vehicle.type.hovers else ()),
    ):
        hours = "1.5" if vehicle.type.hovers else "6"
        with pytest.raises(InputError, match=f"more than {hours} h"):
            flown(TAKEOFF, waypoint(50, 0), long, waypoint(60, 0), vehicle=vehicle)


def test_a_flight_that_circles_for_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Legs of 12 m take 3 s, but PX4 circles for ten times that round ends with tiny radii."""
    monkeypatch.setattr("faao_mav.autopilot.predict.LONGEST_COPTER", 120.0)
    ends = [waypoint(10 * (k % 2), 10 * (k % 3)) for k in range(9)]
    assert flown(*ends, vehicle=PX4).t[-1] < 120
    ways = [replace(end, params=(0.0, 0.05, 0.0, 0.0)) for end in ends]
    with pytest.raises(InputError, match="more than 120 s"):
        flown(*ways, vehicle=PX4)


metres = st.floats(-300, 300)
numbers = st.one_of(st.floats(-5, 60), st.sampled_from([math.nan, 0.0, -1.0, 1e9]))


@st.composite
def any_items(draw: st.DrawFn) -> MissionItem:
    """Items at valid places, with any parameters."""
    params = draw(st.tuples(*[numbers] * 4))
    if draw(st.booleans()):
        commands = [Command.NAV_WAYPOINT] * 3 + list(Command)
        frame = draw(st.sampled_from([Frame.GLOBAL_RELATIVE_ALT] * 4 + [Frame.GLOBAL, 10, 6]))
        height = draw(st.floats(0, 60)) + (400 if frame == Frame.GLOBAL else 0)
        command = draw(st.sampled_from(commands))
        return at(command, draw(metres), draw(metres), height, *params, frame=frame)
    command = draw(st.sampled_from([*Command, 183, 206]))
    return do(command, *params)


@settings(max_examples=60)
@given(
    st.lists(any_items(), max_size=8),
    st.sampled_from([None, HOME]),
    st.sampled_from([COPTER, COPTER, Vehicle("ardupilot", "plane")]),
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


def test_px4_planes_are_not_predicted_as_copters() -> None:
    vehicle = Vehicle("px4", "plane")
    assert vehicle.type.flight_model is None
    with pytest.raises(InputError, match="no model of how PX4 flies planes"):
        predict(Mission((at(Command.NAV_WAYPOINT, 100),)), vehicle)
    assert all(vehicle.type.flight_model for vehicle in VEHICLES)


def test_a_plane_returns_at_its_own_height_and_stays_up() -> None:
    out = at(Command.NAV_TAKEOFF, up=50.0, north=300.0), at(Command.NAV_WAYPOINT, 0, 3000, 50)
    for parameters, height in (
        ({}, 100),
        ({"ALT_HOLD_RTL": 15_000}, 150),
        ({"RTL_ALTITUDE": 30}, 30),
        ({"RTL_ALTITUDE": -1}, 50),
    ):
        track = flown(*out, RTL, vehicle=replace(PLANE, parameters=parameters))
        assert track.position[-1, 2] == pytest.approx(height, abs=3)
        assert np.hypot(*track.position[-1, :2]) < 150
