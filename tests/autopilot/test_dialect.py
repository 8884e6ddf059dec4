"""What autopilots do with items: one test per fact, measured in simulation or read in sources."""

import math
from dataclasses import replace

import pytest
from judged import COPTER, PLANE, PX4, at, do

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.dialect import SpeedChange
from faao_mav.mission import MissionItem

NAN = math.nan


def some(command: int, *params: float) -> MissionItem:
    return at(0, 0, 3, *params, command=command)


def refusal(item: MissionItem, vehicle: Vehicle) -> str | None:
    return vehicle.type.dialect.refusal(item)


def as_stored(item: MissionItem, vehicle: Vehicle) -> MissionItem:
    assert refusal(item, vehicle) is None
    return vehicle.type.dialect.stored(item)


def test_what_is_kept_of_parameters() -> None:
    for vehicle, command, sent, kept in (
        (COPTER, 16, (2.7, 5.0, 1.0, 90.0), (2, 0, 0, 0)),
        (COPTER, 16, (1e6,), (65_535, 0, 0, 0)),
        (COPTER, 16, (1.0, 0.0, 0.0, NAN), (1, 0, 0, 0)),
        (COPTER, 82, (2.7, 5.0, 1.0, 90.0), (2, 0, 0, 0)),
        (PLANE, 16, (2.7, 50.9, 300.0, 90.0), (0, 50, 255, 0)),
        (COPTER, 18, (300.0, 0.0, -1234.0, 1.0), (255, 0, -1230, 1)),
        (COPTER, 18, (2.0, 0.0, 60.5, 0.0), (2, 0, 60, 0)),
        (COPTER, 19, (12.7, 1.0, -50.0, 1.0), (12, 0, -1, 1)),
        (COPTER, 17, (1.0, 1.0, -50.5, 1.0), (0, 0, -50, 0)),
        (COPTER, 21, (), (0, 0, 0, 1)),  # the direction of a landing's turn
        (PX4, 16, (12.5, 2.0, 3.0, -90.0), (12.5, 2, 0, 270)),
        (PX4, 16, (0.0, 0.0, 0.0, -1e-9), (0, 0, 0, 0)),
    ):
        assert as_stored(some(command, *sent), vehicle).params == kept, (vehicle.type.name, command)
    _, radius, _, yaw = as_stored(some(16, 12.5, NAN, 3.0, NAN), PX4).params
    assert math.isnan(radius)
    assert math.isnan(yaw)


def test_ardupilot_takes_nan_as_a_yaw_only() -> None:
    for command in (16, 21, 22, 84, 85):
        assert refusal(some(command, 0, 0, 0, NAN), COPTER) is None
    for command, place in ((16, 0), (16, 1), (16, 2), (17, 3), (19, 3), (82, 3), (178, 1), (85, 1)):
        params = [NAN if k == place else 0.0 for k in range(4)]
        assert f"NaN in param{place + 1}" in str(refusal(some(command, *params), COPTER))


def test_altitudes_and_degrees() -> None:
    for vehicle, up, kept in (
        (COPTER, 100.129, 100.12),
        (COPTER, -3.456, -3.45),
        (PX4, 9.129, 9.129),
    ):
        assert as_stored(at(0, 0, up), vehicle).z == pytest.approx(kept, abs=1e-5)
    assert refusal(at(0, 0, NAN), PX4) is None
    for vehicle in (COPTER, PX4):
        stored = as_stored(replace(some(16), x=12.34567894, y=-12.34567896), vehicle)
        assert (stored.x, stored.y) == (12.3456789, -12.3456790)


def test_frames() -> None:
    pairs = ((0, 0), (2, 0), (3, 3), (5, 0), (6, 3), (10, 10), (11, 10))
    for vehicle, taken in ((COPTER, pairs), (PX4, ((0, 5), (3, 6), (5, 5), (6, 6)))):
        for sent, read in taken:
            assert as_stored(at(0, 0, 9, frame=sent), vehicle).frame == read
        give = f"give one of {', '.join(str(sent) for sent, _ in taken)}"
        for frame in {1, 2, 4, 7, 8, 10, 11} - {sent for sent, _ in taken}:
            told = f"takes no NAV_WAYPOINT in frame {frame}; {give}"
            assert told in str(refusal(at(0, 0, 9, frame=frame), vehicle))


def test_items_without_a_place() -> None:
    for command, params in ((178, (1.0, 8.0, -1.0, 0.0)), (20, (0.0,) * 4)):
        for frame in (2, 3):
            item = MissionItem(command, frame, params, 1.0, 2.0, 3.0)
            assert as_stored(item, COPTER) == MissionItem(command, 0, params)
    for command in (178, 20, 93, 177, 179):
        assert refusal(MissionItem(command, 2), PX4) is None
        for frame in (0, 3, 5, 6):
            assert "give one of 2" in str(refusal(MissionItem(command, frame), PX4))


def test_what_is_refused() -> None:
    for item, part in (
        (replace(some(16), x=91.0), "latitude 91"),
        (replace(some(16), y=NAN), "longitude nan"),
        (at(0, 0, NAN), "altitude nan"),
        (at(0, 0, 83_000.0), "below 83000"),
    ):
        assert part in str(refusal(item, COPTER))
    assert refusal(some(82), COPTER) is None
    assert "does not support NAV_SPLINE_WAYPOINT" in str(refusal(some(82), PLANE))
    for command in (18, 82, 92, 115):
        for frame in (2, 3):
            assert "does not support" in str(refusal(MissionItem(command, frame), PX4))


def test_speed_changes() -> None:
    for vehicle, kind, speed, change in (
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
    ):
        assert vehicle.type.dialect.speed_change(do(178, kind, speed, -1)) == change
