"""What holds for every ArduCopter flight, its legs and corners, and what was measured."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flight_paths import bends, line, path_of, roughness, wandering
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.autopilot.ardupilot.copter.legs import StraightLegs, ramp
from faao_mav.autopilot.ardupilot.copter.target import Target
from faao_mav.autopilot.flight_path import FlightPath
from faao_mav.autopilot.stepper import STEP
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
    # A degree of latitude has 110,574 m at the equator and 111,412 m at 60 degrees.
    equator, north = (ArduCopter.from_vehicle(Vehicle(), latitude) for latitude in (0.0, 60.0))
    assert equator.north_metre == pytest.approx(111_318.845 / 110_574.3, rel=1e-5)
    assert north.north_metre == pytest.approx(111_318.845 / 111_412.2, rel=1e-5)
    assert equator.east_metre == pytest.approx(111_318.845 / 111_319.5, rel=1e-5)
    path = path_of([0, 2000j], 8)
    np.testing.assert_allclose(equator.fly(path).position[-1], [0, 2000, 30], atol=1.0)


MODELS = st.builds(ArduCopter, acceleration=st.floats(0.5, 8), jerk=st.floats(0.5, 20))


def ends_at_rest(points: int) -> Flags:
    stops = np.zeros(points, dtype=bool)
    stops[[0, -1]] = True
    return stops


def target_of(points: Real, speeds: Real, stops: Flags, limits: ArduCopter) -> Target:
    return Target(points, speeds, np.zeros(len(points), dtype=bool), stops, limits)


@given(MODELS, st.floats(0.01, 15))
def test_a_ramp_keeps_its_limits_and_adds_up(limits: ArduCopter, change: float) -> None:
    one = ramp(limits, np.array([change]), limits.acceleration)
    t = np.linspace(0, float(one.duration[0]), 2001)
    s, v, a = change * one[np.zeros(2001, dtype=int)].at(t)
    h = t[1]
    assert (s[0], v[0]) == (0, 0)
    assert v[-1] == pytest.approx(change)
    assert s[-1] == pytest.approx(change * t[-1] / 2)  # it is symmetric about its middle
    assert abs(a).max() <= limits.acceleration * (1 + 1e-9)
    assert np.abs(np.diff(a)).max() / h <= limits.jerk * (1 + 1e-6)
    assert np.diff(v) / h == pytest.approx((a[1:] + a[:-1]) / 2, abs=2 * limits.jerk * h)
    assert np.diff(s) / h == pytest.approx((v[1:] + v[:-1]) / 2, abs=limits.jerk * h**2)


@given(MODELS, st.floats(0.3, 12), st.floats(1, 400), st.floats(0, 50))
def test_the_target_reaches_what_a_leg_has_room_for_and_ends_at_rest(
    limits: ArduCopter, speed: float, length: float, rise: float
) -> None:
    points = np.array([[0.0, 0.0, 30.0], [0.0, length, 30.0 + rise]])
    target = target_of(points, np.array([speed]), ends_at_rest(2), limits)
    level = np.abs(target.motion[:, 4])
    assert target.motion[-1, :3] == pytest.approx(points[1])
    assert np.abs(target.motion[-1, 3:]).max() < 1e-9
    assert level.max() <= speed + 1e-6
    assert target.motion[:, 5].max() <= limits.climb_speed + 1e-6
    moved = np.diff(target.motion[:, 1]) / STEP
    assert moved == pytest.approx((level[1:] + level[:-1]) / 2, abs=limits.jerk * STEP**2)


def test_a_long_leg_has_two_full_ramps_and_a_cruise() -> None:
    # D = v/A + A/J + t_j, T = 2 D + (L - v D)/v
    duration = 8 / 2.5 + 2.5 / 1 + 0.3
    legs = StraightLegs(np.array([200.0]), np.array([False]), ArduCopter())
    assert legs.flown(np.array([8.0]))[1] == pytest.approx(duration + 200 / 8)


def test_measured_speeds_after_a_change_on_a_short_leg() -> None:
    """As ArduCopter's log has them: legs of a mission with WPNAV_ACCEL 400 and WPNAV_JERK 20."""
    lengths, before, told = np.array(
        [[11.3, 24.6, 44.8], [1.992, 3.764, 7.71], [3.764, 8.202, 8.81]]
    )
    legs = StraightLegs(lengths, np.full(3, True), ArduCopter(acceleration=4.0, jerk=20.0))
    assert legs.speeds(before, told)[2] == pytest.approx([2.32, 4.79, 7.71], abs=0.04)


def test_the_jerk_rises_no_faster_than_the_aircraft_leans() -> None:
    """Half of what leaning at 1100 degrees/s² gives is slower than ATC_INPUT_TC from 18 m/s³ on."""
    assert ArduCopter(jerk=17).rise == pytest.approx(0.3)
    half = 9.80665 * math.radians(1100) / 2
    assert ArduCopter(jerk=20).rise == pytest.approx(math.pi * 20 / (2 * half))
    assert ArduCopter(jerk=20, roll_acceleration=0, pitch_acceleration=0).rise == 0.3


@pytest.mark.parametrize("degrees", [5, 90, 150])
def test_corners_are_as_early_as_their_limits_allow(degrees: float) -> None:
    turn = 100 * np.exp(1j * np.radians(degrees))
    points = np.array([[0.0, 0, 30], [100, 0, 30], [100 + turn.real, turn.imag, 30]])

    def nearest(radius: float) -> tuple[float, Real]:
        limits = ArduCopter(radius=radius, corner_acceleration=5.0)
        target = target_of(points, np.array([8.0, 8.0]), ends_at_rest(3), limits)
        k = target.passed[1] / STEP
        place = [np.interp(k, np.arange(len(target.motion)), x) for x in target.motion.T]
        assert np.hypot(*target.motion[:, 3:5].T).max() <= 8 + 1e-3
        return float(np.hypot(place[0] - 100, place[1])), target.passed

    apart, passed = nearest(2.0)
    tight, later = nearest(0.5)
    assert tight <= 0.51
    assert apart <= 2.01
    assert tight < apart or apart < 0.51
    assert later[2] >= passed[2] - 1e-9


def test_legs_take_as_long_as_the_target_takes() -> None:
    rng, worst = np.random.default_rng(1), []
    for _ in range(300):
        count = int(rng.integers(2, 7))
        lengths, stops = rng.uniform(8, 120, count), ends_at_rest(count + 1)
        stops[1:-1] = rng.random(count - 1) < 0.2
        speeds = rng.uniform(1.5, 10, count)
        limits = ArduCopter(acceleration=rng.uniform(1.5, 5), jerk=rng.uniform(5, 20))
        points = np.zeros((count + 1, 3))
        points[1:, 0] = np.cumsum(lengths)
        joined = ~stops[:-1]
        told = StraightLegs(lengths, joined, limits).flown(speeds)[1]
        moved = np.diff(target_of(points, speeds, stops, limits).passed)
        worst.append(np.abs(told - moved).max())
    assert np.median(worst) < 0.05
    assert np.quantile(worst, 0.9) < 0.3


def test_a_command_counts_up_to_what_a_leg_or_the_next_comes_to() -> None:
    limits, lengths = ArduCopter(acceleration=4.0, jerk=10.0), np.array([12.0, 40.0, 6.0])
    alone, joined = (
        StraightLegs(lengths, np.array([False, follows, follows]), limits)
        for follows in (False, True)
    )
    speeds = np.array([20.0, 20.0, 20.0])
    assert alone.most == pytest.approx(alone.flown(speeds)[0])
    assert joined.most == pytest.approx(alone.most[[1, 1, 2]])
    assert joined.flown(speeds)[1] == pytest.approx(joined.flown(joined.most)[1])
    many = np.random.default_rng(0).uniform(1, 9, (2, 4, 3))
    one = [[joined.flown(each)[1] for each in row] for row in many]
    assert joined.flown(many)[1] == pytest.approx(np.array(one))
    nowhere = replace(joined, lengths=np.zeros(3)).flown(speeds)
    assert np.isfinite(nowhere).all()


def test_measured_lengths_of_legs() -> None:
    """Measured at 8 m/s: 49 m with default parameters, 22 m with ACCEL 400 and JERK 10."""
    for limits, length in (((2.5, 1.0), 49), ((4.0, 10.0), 22)):
        legs = ArduCopter(acceleration=limits[0], jerk=limits[1])
        assert legs.shortest_leg(np.array(8.0)) == pytest.approx(length, abs=1)
