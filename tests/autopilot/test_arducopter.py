"""What holds for every ArduCopter flight, and what was measured."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flight_paths import bends, line, path_of, roughness, wandering
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.autopilot.flight_path import FlightPath
from faao_mav.errors import InputError

QUICK = ArduCopter(acceleration=4, jerk=10)

models = st.sampled_from([ArduCopter(), QUICK, ArduCopter(acceleration=1)])


def test_measured_mean_speeds_by_spacing() -> None:
    for model, speeds in (
        (ArduCopter(), {2: 0.9, 5: 1.7, 10: 2.7, 20: 4.4, 40: 7.0}),
        (ArduCopter(acceleration=5, jerk=5), {2: 1.4, 5: 2.7, 10: 4.5, 20: 7.2, 40: 8.0}),
    ):
        for spacing, speed in speeds.items():
            legs = max(12, 240 // spacing)
            arrivals = model.fly(line(spacing, legs)).arrivals
            first, last = legs // 3, 2 * legs // 3
            mean = spacing * (last - first) / (arrivals[last] - arrivals[first])
            assert mean == pytest.approx(speed, abs=0.1), spacing


def test_measured_top_speed_by_lean_angle() -> None:
    for degrees, top in ((30, 10.3), (45, 15.2)):
        flown = ArduCopter(lean_angle=math.radians(degrees)).fly(line(1500, 1, 20.0))
        assert np.hypot(*flown.velocity[:, :2].T).max() == pytest.approx(top, rel=0.05)


@settings(max_examples=40)
@given(wandering(climbs=True), models)
def test_motion_is_continuous_and_within_limits(path: FlightPath, model: ArduCopter) -> None:
    path = replace(path, holds=np.append(path.holds[:-1], 15.0))
    flown = model.fly(path, 0.05)
    np.testing.assert_allclose(np.diff(flown.t), 0.05)
    assert flown.t[0] == flown.arrivals[0] == 0
    assert flown.t[-1] >= flown.departures[-1] - 1e-9
    assert np.linalg.norm(flown.position[-1] - path.points[-1]) < 0.3
    assert np.linalg.norm(flown.velocity[-1]) < 0.2
    middle = (flown.velocity[1:] + flown.velocity[:-1]) / 2
    assert np.diff(flown.position, axis=0) / 0.05 == pytest.approx(middle, abs=0.25)
    ground = np.hypot(*flown.velocity[:, :2].T)
    drag = model.body.linear_drag * ground + model.body.quadratic_drag * ground**2
    acceleration = np.linalg.norm(np.diff(flown.velocity[:, :2], axis=0), axis=1) / 0.05
    assert np.all(acceleration <= 9.81 * math.tan(model.lean_angle) + drag[1:] + 0.2)
    # Where two legs overlap both move the target: their climbs never add up to more than both.
    assert flown.velocity[:, 2].max() <= 2 * model.climb_speed + 1e-9
    assert flown.velocity[:, 2].min() >= -2 * model.descent_speed - 1e-9
    waits = np.floor(path.holds)
    np.testing.assert_allclose(flown.departures - flown.arrivals, waits, atol=1e-9)
    assert (flown.arrivals[1:] > flown.departures[:-1]).all()
    for point, leaves, wait in zip(path.points, flown.departures, waits, strict=True):
        if wait >= 10:
            place = [np.interp(leaves, flown.t, x) for x in flown.position.T]
            np.testing.assert_allclose(place, point, atol=0.5)


def test_a_leg_to_where_it_is_takes_no_time() -> None:
    flown = ArduCopter().fly(path_of([0, 0, 60], 6))
    alone = ArduCopter().fly(path_of([0, 60], 6))
    assert flown.arrivals == pytest.approx([0, 0, alone.arrivals[-1]])


def test_useless_speeds_are_refused() -> None:
    for speed in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="speeds"):
            ArduCopter().fly(path_of([0, 9], speed))


def test_splines_pass_straight_legs_without_a_stop() -> None:
    points = [0, 80, 140 + 40j, 200 + 80j, 300 + 80j]
    splines = np.array([False, False, True, True, False])
    flown = ArduCopter().fly(replace(path_of(points, 6), splines=splines))
    between = (flown.t > flown.arrivals[1] - 5) & (flown.t < flown.arrivals[3] + 3)
    assert np.linalg.norm(flown.velocity[between], axis=1).min() > 2.5
    for point, arrival in zip(points[1:4], flown.arrivals[1:4], strict=True):
        place = flown.position[round(arrival / 0.1), :2]
        assert abs(complex(*place) - point) < 3


def test_holds_lose_their_fractions_and_delays_keep_them() -> None:
    path = path_of([0, 100, 100 + 100j], holds={1: 5.7})
    held = ArduCopter().fly(path)
    assert held.departures[1] - held.arrivals[1] == pytest.approx(5)
    delays = np.array([0.0, 0.7, 0.0])
    both = ArduCopter().fly(replace(path, delays=delays))
    assert both.departures[1] - both.arrivals[1] == pytest.approx(5.7)
    only = ArduCopter().fly(replace(path, holds=np.zeros(3), delays=delays))
    assert only.departures[1] - only.arrivals[1] == pytest.approx(0.7)


def test_arrivals_are_smooth_in_speeds() -> None:
    for model in (ArduCopter(), QUICK):
        for leg in (0, 3, 6, 9):
            path = bends(leg)
            assert roughness(model, path, leg) < 5e-3


def test_a_leg_that_climbs_is_as_slow_as_the_climb() -> None:
    model = ArduCopter(climb_speed=2.0, descent_speed=1.0)
    up = model.fly(path_of([0, 40], heights=[30, 90]))
    down = model.fly(path_of([0, 40], heights=[90, 30]))
    assert up.velocity[:, 2].max() == pytest.approx(2.0, abs=1e-6)
    assert down.velocity[:, 2].min() == pytest.approx(-1.0, abs=1e-6)
    assert up.departures[-1] == pytest.approx(60 / 2 + 2.0 + 1.3, abs=1.5)
    assert down.departures[-1] == pytest.approx(60 / 1 + 2.3, abs=1.5)
    middle = up.position[len(up.t) // 2]
    assert (middle[2] - 30) / 60 == pytest.approx(middle[0] / 40, abs=1e-4)


def test_one_point_is_only_held() -> None:
    flown = ArduCopter().fly(path_of([3 + 4j], holds={0: 2.5}))
    assert flown.departures[0] == pytest.approx(2)
    np.testing.assert_array_equal(flown.position, np.tile([3, 4, 30], (len(flown.t), 1)))


@settings(max_examples=30)
@given(wandering(shortest=12.0), models)
def test_splines_pass_their_points(path: FlightPath, model: ArduCopter) -> None:
    splines = np.arange(len(path.points)) > 0
    flown = model.fly(replace(path, splines=splines), 0.05)
    assert (np.diff(flown.arrivals) > 0).all()
    waits = np.floor(path.holds)
    np.testing.assert_allclose(flown.departures - flown.arrivals, waits, atol=1e-9)
    for point in path.points[:-1]:
        assert np.linalg.norm(flown.position - point, axis=1).min() < 3.0


def test_it_counts_metres_as_if_the_earth_were_a_sphere() -> None:
    # A degree of latitude has 110,574 m at the equator and 111,694 m at the poles.
    vehicle = Vehicle()
    equator, pole = (ArduCopter.from_vehicle(vehicle, latitude) for latitude in (0.0, 90.0))
    assert equator.north_metre == pytest.approx(111_318.845 / 110_574.3, rel=1e-5)
    assert pole.north_metre == pytest.approx(111_318.845 / 111_693.9, rel=1e-5)
    north = path_of([0, 2000j], 8)
    late = [model.fly(north).arrivals[-1] for model in (equator, pole)]
    assert late[0] - late[1] == pytest.approx(2000 / 8 * 0.01008, abs=0.05)
    np.testing.assert_allclose(equator.fly(north).position[-1], [0, 2000, 30], atol=1.0)
