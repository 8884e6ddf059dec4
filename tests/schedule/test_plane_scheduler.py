"""Missions for aeroplanes: curves that they fly although they aim far ahead."""

import numpy as np
import pytest
from relay_flights import Trajectory, converted, plan_with

from faao_mav.arrays import Real
from faao_mav.autopilot.body import density_ratio
from faao_mav.autopilot.predict import predict
from faao_mav.errors import InputError
from faao_mav.mission import Command
from faao_mav.plan import Plan
from faao_mav.schedule import Conversion
from faao_mav.schedule.conversion import check_vehicle

STEP = 0.2
RATIO = density_ratio(684.0) ** -0.5
"""True over commanded airspeed."""


def plane_plan(**changes: float) -> Plan:
    return plan_with(
        type="plane", min_speed=12.0, max_speed=16.0, parameters=changes, path_tolerance=5.0
    )


def along(path: Real) -> Trajectory:
    """A flight along the corners `path`, m, at 14 m/s."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    t = np.arange(0.0, way[-1] / 14, STEP)
    return t, np.stack([np.interp(14 * t, way, axis) for axis in path.T], axis=-1)


def circle() -> Trajectory:
    """A way in, one and a half circles of 90 m radius, a way out, at 14 m/s."""
    angle = np.arange(0.0, 3 * np.pi, 1 / 90)
    round_it = 90 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=-1)
    return along(np.vstack([[[-300.0, 0.0]], round_it, round_it[-1:] - [[300.0, 0.0]]]))


def steps() -> Trajectory:
    """A straight way at 16, 12 and 16 m/s, with changes of 3 m/s² that no plane makes."""
    t = np.arange(0.0, 100.0, STEP)
    speed = 12 + np.clip(3 * (np.abs(t - 50) - 16), 0, 4)
    east = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * STEP)])
    return t, np.stack([east, 0 * east], axis=-1)


@pytest.fixture(scope="module")
def flight() -> Conversion:
    return converted(*circle(), plane_plan())


def test_the_path_is_kept_where_plain_waypoints_would_lose_it(flight: Conversion) -> None:
    found = flight.schedule.deviation
    assert found.path < 7.0  # 10 m with waypoints on the path
    assert found.rms < 5
    assert abs(found.late) < 0.5


def test_a_change_of_speed_begins_before_the_plans() -> None:
    """The aircraft loses 0.8 m/s in a second at most: with one speed for all it is 25 m rms off."""
    t, w = steps()
    plan = plane_plan(AIRSPEED_CRUISE=22.0)
    schedule = converted(t, w, plan).schedule
    found, flown = schedule.deviation, schedule.track()
    slower = np.flatnonzero(np.hypot(*flown["predicted_v"].T) < 15)
    assert flown["predicted_t"][slower[0]] < 50 - 16 - 1 / 3
    assert found.rms < 5
    assert found.max < 12
    assert abs(found.late) < 0.2


def test_the_whole_mission_flies_like_its_schedule(flight: Conversion) -> None:
    """Take-off and the way to the run-in are over before w_I: the run-in is long enough.

    What the turn into the run-in changes is made up for there but for 0.1 m, and in the integrals
    of total energy control: 2.3 m, or 0.16 s, at the end.
    """
    track = predict(flight.mission, flight.vehicle, plane_plan().origin.frame)
    schedule, t = flight.schedule, flight.schedule.t
    items = enumerate(flight.mission.items)
    waypoints = [k for k, item in items if item.command == Command.NAV_WAYPOINT]
    passed = track.reached[waypoints[schedule.route.first]]
    start = passed + schedule.start - schedule.flown.arrivals[schedule.route.first]
    at = np.stack([np.interp(t + start, track.t, x) for x in track.position.T[:2]], axis=-1)
    assert np.hypot(*(at - schedule.positions(t)).T).max() < 3


def test_items_are_an_aeroplanes(flight: Conversion) -> None:
    items = flight.mission.items
    assert (items[0].command, items[0].params[0]) == (Command.NAV_TAKEOFF, 15)
    assert items[-1].command == Command.NAV_RETURN_TO_LAUNCH
    for item in items[1:-1]:
        if item.command == Command.DO_CHANGE_SPEED:
            assert item.params[0] == 0
            assert 12 <= RATIO * item.params[1] + 0.001 <= 16.002
        else:
            assert (item.command, item.params) == (Command.NAV_WAYPOINT, (0, 0, 0, 0))
    assert flight.parameters == {}


def test_a_plane_that_cannot_fly_the_plans_speeds_is_refused() -> None:
    for parameters, told in (
        ({"AIRSPEED_MIN": 12.5}, r"min_speed: 12 m/s; the plane flies 12.92 to 22.74 m/s"),
        ({"AIRSPEED_MAX": 14.5}, r"max_speed: 16 m/s; the plane flies 9.303 to 14.99 m/s"),
        ({"NAVL1_PERIOD": 0.0}, "NAVL1_PERIOD: 0"),
    ):
        with pytest.raises(InputError, match=told):
            check_vehicle(plane_plan(**parameters))
    limits = {"AIRSPEED_MIN": 12 / RATIO, "AIRSPEED_MAX": 16 / RATIO * (1 + 1e-12)}
    check_vehicle(plane_plan(**limits))
