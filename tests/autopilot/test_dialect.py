"""What autopilots do with items: one test per fact, measured in simulation or read in sources."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.dialect import Limit, SpeedChange
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.item import as_received, as_sent

COPTER, PLANE = Vehicle("ardupilot", "copter"), Vehicle("ardupilot", "plane")
PX4 = Vehicle("px4", "copter")
NAN = math.nan


def four(*params: float) -> tuple[float, float, float, float]:
    one, two, three, four = (*params, *(0.0,) * (4 - len(params)))
    return one, two, three, four


def waypoint(
    *params: float,
    frame: int = 3,
    x: float = -35.363262,
    y: float = 149.165237,
    z: float = 100.0,
) -> MissionItem:
    return MissionItem(16, frame, four(*params), x, y, z)


def accepts(item: MissionItem, vehicle: Vehicle) -> str | None:
    return vehicle.type.dialect.refusal(item)


def refusal(item: MissionItem, vehicle: Vehicle) -> str:
    reason = vehicle.type.dialect.refusal(item)
    assert reason is not None
    return reason


def as_stored(item: MissionItem, vehicle: Vehicle) -> MissionItem:
    return vehicle.type.dialect.stored(item)


def test_a_copter_keeps_whole_seconds_of_a_hold_and_drops_the_rest() -> None:
    stored = as_stored(waypoint(2.7, 5.0, 1.0, 90.0), COPTER)
    assert stored.params == (2, 0, 0, 0)
    assert as_stored(waypoint(1e6), COPTER).params[0] == 65_535
    spline = MissionItem(82, 3, (2.7, 5.0, 1.0, 90.0), 1.0, 2.0, 3.0)
    assert as_stored(spline, COPTER).params == (2, 0, 0, 0)


def test_a_plane_keeps_radius_and_pass_by_up_to_255_and_no_hold() -> None:
    assert as_stored(waypoint(2.7, 50.9, 300.0, 90.0), PLANE).params == (0, 50, 255, 0)


def test_ardupilot_makes_0_of_nan_where_it_takes_it() -> None:
    item = waypoint(1.0, 0.0, 0.0, NAN)
    assert accepts(item, COPTER) is None
    assert as_stored(item, COPTER).params == (1, 0, 0, 0)


@pytest.mark.parametrize(
    ("command", "place"), [(16, 0), (16, 1), (16, 2), (17, 3), (19, 3), (82, 3), (178, 1), (85, 1)]
)
def test_ardupilot_refuses_nan_elsewhere(command: int, place: int) -> None:
    params = [0.0] * 4
    params[place] = NAN
    item = MissionItem(command, 3, four(*params), 1.0, 2.0, 3.0)
    assert f"NaN in param{place + 1}" in refusal(item, COPTER)


@pytest.mark.parametrize("command", [16, 21, 22, 84, 85])
def test_ardupilot_takes_nan_as_a_yaw(command: int) -> None:
    item = MissionItem(command, 3, (0.0, 0.0, 0.0, NAN), 1.0, 2.0, 3.0)
    assert accepts(item, COPTER) is None


def test_ardupilot_keeps_altitudes_in_centimetres() -> None:
    assert as_stored(waypoint(z=100.129), COPTER).z == pytest.approx(100.12, abs=1e-5)
    assert as_stored(waypoint(z=-3.456), COPTER).z == pytest.approx(-3.45, abs=1e-5)


@pytest.mark.parametrize(
    ("sent", "read"), [(0, 0), (2, 0), (3, 3), (5, 0), (6, 3), (10, 10), (11, 10)]
)
def test_ardupilot_frames(sent: int, read: int) -> None:
    item = waypoint(frame=sent)
    assert accepts(item, COPTER) is None
    assert as_stored(item, COPTER).frame == read


@pytest.mark.parametrize("frame", [1, 4, 7, 8])
def test_ardupilot_refuses_local_frames(frame: int) -> None:
    assert f"does not support frame {frame}" in refusal(waypoint(frame=frame), COPTER)


@pytest.mark.parametrize(("command", "params"), [(178, (1, 8, -1, 0)), (20, (0,) * 4)])
def test_ardupilot_gives_items_without_a_place_back_in_frame_0(
    command: int, params: tuple[float, float, float, float]
) -> None:
    for frame in (2, 3):
        item = MissionItem(command, frame, params, 1.0, 2.0, 3.0)
        assert accepts(item, COPTER) is None
        assert as_stored(item, COPTER) == MissionItem(command, 0, params)


@pytest.mark.parametrize(
    ("item", "part"),
    [
        (waypoint(x=91.0), "latitude 91"),
        (waypoint(y=NAN), "longitude nan"),
        (waypoint(z=NAN), "altitude nan"),
        (waypoint(z=83_000.0), "below 83000"),
    ],
)
def test_ardupilot_refuses_impossible_places(item: MissionItem, part: str) -> None:
    assert part in refusal(item, COPTER)


def test_splines_are_for_copters() -> None:
    item = MissionItem(82, 3, (0.0,) * 4, 1.0, 2.0, 3.0)
    assert accepts(item, COPTER) is None
    assert "NAV_SPLINE_WAYPOINT" in refusal(item, PLANE)
    assert "NAV_SPLINE_WAYPOINT" in refusal(item, PX4)


def test_ardupilot_loiters() -> None:
    turns = MissionItem(18, 3, (300.0, 0.0, -1234.0, 1.0), 1.0, 2.0, 3.0)
    assert as_stored(turns, COPTER).params == (255, 0, -1230, 1)
    turns = MissionItem(18, 3, (2.0, 0.0, 60.5, 0.0), 1.0, 2.0, 3.0)
    assert as_stored(turns, COPTER).params == (2, 0, 60, 0)
    time = MissionItem(19, 3, (12.7, 1.0, -50.0, 1.0), 1.0, 2.0, 3.0)
    assert as_stored(time, COPTER).params == (12, 0, -1, 1)
    unlimited = MissionItem(17, 3, (1.0, 1.0, -50.5, 1.0), 1.0, 2.0, 3.0)
    assert as_stored(unlimited, COPTER).params == (0, 0, -50, 0)


def test_ardupilot_stores_the_direction_of_a_landing_turn() -> None:
    assert as_stored(MissionItem(21, 3), COPTER).params == (0, 0, 0, 1)


def test_degrees_are_multiples_of_1e_7() -> None:
    for vehicle in (COPTER, PX4):
        stored = as_stored(waypoint(x=12.34567894, y=-12.34567896), vehicle)
        assert (stored.x, stored.y) == (12.3456789, -12.3456790)


@pytest.mark.parametrize(("sent", "read"), [(0, 5), (3, 6), (5, 5), (6, 6)])
def test_px4_frames(sent: int, read: int) -> None:
    item = waypoint(frame=sent)
    assert accepts(item, PX4) is None
    assert as_stored(item, PX4).frame == read


@pytest.mark.parametrize("frame", [1, 10, 11])
def test_px4_has_no_local_and_terrain_frames(frame: int) -> None:
    assert f"does not support frame {frame}" in refusal(waypoint(frame=frame), PX4)


def test_px4_takes_waypoints_in_frames_of_places_only() -> None:
    assert "frames 0, 3, 5 and 6 only" in refusal(waypoint(frame=2), PX4)


@pytest.mark.parametrize("command", [178, 20, 93, 177, 179])
def test_px4_takes_do_items_in_frame_2_only(command: int) -> None:
    assert accepts(MissionItem(command, 2), PX4) is None
    for frame in (0, 3, 5, 6):
        assert "in frame 2 (MISSION) only" in refusal(MissionItem(command, frame), PX4)


@pytest.mark.parametrize("command", [18, 82, 92, 115])
def test_px4_refuses_commands(command: int) -> None:
    for frame in (2, 3):
        assert "does not support" in refusal(MissionItem(command, frame), PX4)


def test_px4_drops_param3_of_a_waypoint_and_keeps_fractions_and_nan() -> None:
    item = waypoint(12.5, NAN, 3.0, NAN, z=100.129)
    assert accepts(item, PX4) is None
    param1, param2, param3, param4 = as_stored(item, PX4).params
    assert (param1, param3) == (12.5, 0)
    assert math.isnan(param2)
    assert math.isnan(param4)
    assert as_stored(item, PX4).z == pytest.approx(100.129, abs=1e-5)
    assert as_stored(waypoint(0.0, 0.0, 0.0, -90.0), PX4).params[3] == 270
    assert as_stored(waypoint(0.0, 0.0, 0.0, -1e-9), PX4).params[3] == 0


def test_px4_takes_an_altitude_that_is_not_set() -> None:
    assert accepts(waypoint(z=NAN), PX4) is None


def test_limits() -> None:
    assert COPTER.type.dialect.items.most == 718
    assert PLANE.type.dialect.items.most == 724
    assert COPTER.type.dialect.items.sure == 650
    assert PX4.type.dialect.items.sure == 1000
    assert COPTER.type.dialect.jumps == Limit(15, 100)


@pytest.mark.parametrize(
    ("vehicle", "kind", "speed", "change"),
    [
        (COPTER, 0, 8.0, SpeedChange("horizontal", 8.0)),
        (COPTER, 1, 8.0, SpeedChange("horizontal", 8.0)),
        (COPTER, 2, 2.0, SpeedChange("climb", 2.0)),
        (COPTER, 3, 2.0, SpeedChange("descent", 2.0)),
        (COPTER, 1, 0.0, None),
        (COPTER, 1, -1.0, None),
        (PLANE, 0, 15.0, SpeedChange("airspeed", 15.0)),
        (PLANE, 0, -2.0, SpeedChange("airspeed", None)),
        (PLANE, 1, 15.0, SpeedChange("least ground speed", 15.0)),
        (PX4, 1, 8.0, SpeedChange("horizontal", 8.0)),
        (PX4, 2, 8.0, SpeedChange("horizontal", 8.0)),
        (PX4, 1, -1.0, SpeedChange("horizontal", None)),
        (PX4, 1, NAN, SpeedChange("horizontal", None)),
    ],
)
def test_speed_changes(
    vehicle: Vehicle, kind: float, speed: float, change: SpeedChange | None
) -> None:
    item = MissionItem(178, 2, (float(kind), speed, -1.0, 0.0))
    assert vehicle.type.dialect.speed_change(item) == change


MISSION = Mission((waypoint(), MissionItem(177, 2, (1.0, 3.0, 0.0, 0.0))), Home(1.0, 2.0, 3.0))


def test_ardupilot_is_sent_a_home_row_and_px4_none() -> None:
    assert COPTER.type.dialect.home_row
    home, first, jump = as_sent(MISSION, home_row=True)
    assert (home.command, home.frame, home.x, home.y, home.z) == (16, 0, 1, 2, 3)
    assert (first, jump) == MISSION.items

    assert not PX4.type.dialect.home_row
    rows = as_sent(MISSION, home_row=False)
    assert rows[0] == MISSION.items[0]
    assert rows[int(rows[1].params[0])] == rows[0]


@pytest.mark.parametrize("home_row", [True, False])
def test_what_is_sent_is_received(home_row: bool) -> None:
    received = as_received(as_sent(MISSION, home_row=home_row), home_row=home_row)
    assert received.items == MISSION.items
    assert received.home == (MISSION.home if home_row else None)
    assert as_received((), home_row=home_row) == Mission(())


numbers = st.floats(-1e5, 1e5)


@st.composite
def accepted(draw: st.DrawFn, vehicle: Vehicle) -> MissionItem:
    item = MissionItem(
        draw(st.sampled_from([16, 17, 18, 19, 20, 21, 22, 31, 82, 93, 115, 177, 178, 189])),
        draw(st.sampled_from([0, 2, 3, 5, 6, 10])),
        draw(st.tuples(numbers, numbers, numbers, numbers)),
        draw(st.floats(-90, 90)),
        draw(st.floats(-180, 180)),
        draw(st.floats(-1000, 10_000)),
    )
    return item if accepts(item, vehicle) is None else waypoint()


@pytest.mark.parametrize("vehicle", [COPTER, PLANE, PX4])
@given(data=st.data())
def test_what_was_read_back_can_be_sent_again_and_stays(
    vehicle: Vehicle, data: st.DataObject
) -> None:
    once = as_stored(data.draw(accepted(vehicle)), vehicle)
    if vehicle.type.dialect.home_row is False or once.frame != 0:
        assert accepts(once, vehicle) is None
    twice = as_stored(once, vehicle)
    # Altitudes in centimetres may lose one more: single precision is just below.
    assert abs(twice.z - once.z) <= 0.0101
    assert (twice.params, twice.x, twice.y) == (once.params, once.x, once.y)
