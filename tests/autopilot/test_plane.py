"""What holds for every flight of an ArduPlane."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flight_paths import line, path_of, wandering
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.autopilot.ardupilot.plane.flight_model import ArduPlane
from faao_mav.autopilot.body import PlaneBody
from faao_mav.autopilot.flight_path import FlightPath
from faao_mav.errors import InputError
from faao_mav.plan import Wind

PLANE = ArduPlane()


@settings(max_examples=50)
@given(wandering(shortest=0.0, climbs=True))
def test_motion_is_an_aeroplanes(path: FlightPath) -> None:
    flown = PLANE.fly(path)
    speed = np.linalg.norm(flown.velocity, axis=1)
    assert speed.min() >= 0.5 * PLANE.min_speed
    assert speed.max() <= PLANE.max_speed
    assert abs(flown.velocity[:, 2]).max() <= 2 * PLANE.climb_speed
    moved = np.linalg.norm(np.diff(flown.position, axis=0), axis=1) / 0.1
    assert moved.max(initial=0) <= speed.max() + 0.1
    heading = np.unwrap(np.arctan2(flown.velocity[:, 1], flown.velocity[:, 0]))
    turning = abs(np.diff(heading)) / 0.1
    assert turning.max(initial=0) <= 2 * 9.81 * math.tan(PLANE.roll_limit) / speed.min()
    assert (flown.departures >= flown.arrivals - 1e-9).all()
    assert (flown.arrivals[1:] >= flown.departures[:-1] - 1e-9).all()
    assert flown.t[-1] >= flown.departures[-1] - 1e-9


def test_the_demanded_airspeed_falls_as_total_energy_control_lets_it() -> None:
    """The autopilot's log shows 0.80 m/s², and 1.65 m/s² with TECS_SINK_MIN 3 and cruise 16."""
    rates = ArduPlane(cruise_speed=22.0).speed_rates
    assert rates.fall == pytest.approx(0.80, abs=0.01)
    assert rates.power / 17.7 == pytest.approx(1.38, abs=0.01)
    rates = ArduPlane(cruise_speed=16.0, descent_speed=3.0).speed_rates
    assert rates.fall == pytest.approx(1.65, abs=0.01)


@given(speed=st.floats(0, 8), degrees=st.floats(0, 360))
def test_a_wind_shifts_the_velocity_and_the_track_is_kept(speed: float, degrees: float) -> None:
    """The airspeed V leads along the track at sqrt(V^2 - across^2) + along."""
    wind = Wind(speed=speed, from_degrees=degrees).velocity
    flown = PLANE.fly(replace(line(500, 2, 15.0), wind=wind))
    np.testing.assert_allclose(flown.position[:, 1], 0, atol=0.05)
    ground = math.sqrt(15**2 - wind[1] ** 2) + wind[0]
    assert flown.arrivals[1] == pytest.approx(500 / ground, abs=0.25)
    entered = replace(line(1000, 2, 15.0), wind=wind, entry=np.array([0.0, 14.0, 0.0]))
    settled = PLANE.fly(entered)
    np.testing.assert_allclose(settled.velocity[0, :2], [0, 14], atol=1e-9)
    np.testing.assert_allclose(settled.velocity[-1, :2], [ground, 0], atol=0.2)
    assert abs(settled.position[-1, 1]) < 1


def test_a_wind_that_carries_it_away_is_told() -> None:
    with pytest.raises(InputError, match="perhaps for the wind"):
        PLANE.fly(replace(line(500, 1, 15.0), wind=(-20.0, 0.0), longest=600.0))


def test_airspeed_is_held_within_its_limits_and_higher_in_thin_air() -> None:
    """Standard atmosphere, 684 m: the density is 0.9359 of that at sea level."""
    for command, held in ((3, 9), (40, 22), (0, 12), (15, 15)):
        for exponent, ratio in ((0.5, 1.0337), (1.0, 1.0337**2)):
            plane = ArduPlane(body=PlaneBody(airspeed_exponent=exponent))
            track = plane.fly(replace(line(1500, 1, float(command)), elevation=654.0))
            speed = np.linalg.norm(track.velocity, axis=1)[-1]
            assert speed == pytest.approx(held * ratio, rel=2e-3)


def test_goes_on_at_the_velocity_of_a_take_off() -> None:
    climbing = replace(path_of([0, 800], 14.0), entry=np.array([26.0, 0.0, 6.0]))
    flown = PLANE.fly(climbing)
    np.testing.assert_allclose(flown.velocity[0], [26, 0, 6])
    assert flown.position[:, 2].max() > 33
    assert np.hypot(*flown.velocity[-1, :2]) == pytest.approx(14, abs=0.3)


def test_a_small_radius_is_passed_at_the_perpendicular() -> None:
    flown = PLANE.fly(path_of([0, 60, 60 + 15j, 200 + 15j], 15.0, radius=1))
    assert np.isfinite(flown.arrivals).all()
    assert np.hypot(*(flown.position[-1, :2] - [200, 15])) < 40


def test_climbs_along_the_leg_as_fast_as_it_may() -> None:
    flown = PLANE.fly(path_of([0, 1000, 1500], 15.0, heights=[50, 100, 100]))
    middle = int(flown.arrivals[1] / 0.1 / 2)
    assert flown.position[middle, 2] == pytest.approx(75, abs=3)
    steep = PLANE.fly(path_of([0, 100, 1500], 15.0, heights=[50, 200, 200]))
    climb = steep.velocity[:, 2]
    assert np.median(climb[climb > 1]) == pytest.approx(5, abs=0.5)


def test_one_point_is_where_it_is() -> None:
    flown = PLANE.fly(path_of([3 + 4j]))
    assert flown.departures[0] == 0
    np.testing.assert_allclose(flown.position, [[3, 4, 30]])
