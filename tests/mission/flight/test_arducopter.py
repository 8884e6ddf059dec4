"""What holds for every ArduCopter flight."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import line, path_of, wandering

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.mission.flight.arducopter import ArduCopter
from faao_mav.mission.flight.arducopter.leg import Leg, changed_leg, plain_leg
from faao_mav.mission.flight.arducopter.ramp import JERK_LAG, Ramp, top_speed
from faao_mav.mission.flight.path import FlightPath
from faao_mav.mission.vehicle import Vehicle

QUICK = ArduCopter(acceleration=4, jerk=10)

models = st.sampled_from([ArduCopter(), QUICK, ArduCopter(acceleration=1)])
speeds = st.floats(0.1, 20)
accelerations = st.floats(0.5, 10)
jerks = st.floats(0.3, 20)
lengths = st.floats(0.5, 400)


def one(value: float) -> Real:
    return np.array([value])


@given(st.floats(0, 20), st.floats(0, 20), accelerations, jerks)
def test_a_ramp_keeps_its_limits(v0: float, v1: float, acceleration: float, jerk: float) -> None:
    ramp = Ramp.between(one(v0), one(v1), acceleration, jerk)
    if abs(v1 - v0) <= 1e-12:
        assert ramp.duration[0] == ramp.length[0] == 0
        return
    t = np.linspace(0, float(ramp.duration[0]), 2001)
    way, speed = (x[0] for x in ramp.at(t[None]))
    assert speed[0] == pytest.approx(v0, abs=1e-9)
    assert speed[-1] == pytest.approx(v1, abs=1e-9)
    assert way[-1] == pytest.approx(ramp.length[0], abs=1e-9)
    assert min(v0, v1) - 1e-9 <= speed.min()
    assert speed.max() <= max(v0, v1) + 1e-9
    changing = np.diff(speed) / t[1]
    assert abs(changing).max() <= acceleration + 1e-6
    assert np.abs(np.diff(changing)).max() / t[1] <= jerk + 1e-3
    middle = (speed[1:] + speed[:-1]) / 2
    np.testing.assert_allclose(np.diff(way), middle * t[1], atol=jerk * t[1] ** 3 / 10 + 1e-9)


@given(accelerations, jerks, st.floats(0.01, 20))
def test_how_long_a_ramp_takes(acceleration: float, jerk: float, change: float) -> None:
    """D = dv / A + A / J + t_j where A is reached; twice its rise where it is not."""
    ramp = Ramp.between(one(3.0), one(3.0 + change), acceleration, jerk)
    rise = acceleration / jerk + JERK_LAG
    if change >= acceleration * rise:
        assert ramp.duration[0] == pytest.approx(change / acceleration + rise)
    else:
        peak = ramp.a[0]
        assert peak <= acceleration
        assert peak**2 / jerk + peak * JERK_LAG == pytest.approx(change)
        assert ramp.duration[0] == pytest.approx(2 * (peak / jerk + JERK_LAG))
    before = Ramp.between(one(3.0), one(3.0 + 0.99 * change), acceleration, jerk)
    assert before.duration[0] < ramp.duration[0]


@given(accelerations, jerks, st.floats(0.01, 20), st.floats(0, 1))
def test_when_a_ramp_from_rest_has_come_some_way(
    acceleration: float, jerk: float, speed: float, share: float
) -> None:
    ramp = Ramp.between(one(0.0), one(speed), acceleration, jerk)
    half = ramp.at(ramp.duration[:, None] / 2)[0][0, 0]
    t = ramp.time_to(one(share * half))
    assert ramp.at(t[:, None])[0][0, 0] == pytest.approx(share * half, abs=1e-6)
    assert ramp.time_to(one(1e9))[0] == ramp.duration[0] / 2


@given(lengths, speeds, accelerations, jerks)
def test_the_top_speed_is_the_highest_whose_ramps_the_leg_holds(
    length: float, speed: float, acceleration: float, jerk: float
) -> None:
    top = top_speed(one(length), one(speed), acceleration, jerk)
    ramps = 2 * Ramp.between(one(0.0), top, acceleration, jerk).length[0]
    assert 0 < top[0] <= speed
    assert ramps <= length * (1 + 1e-6)
    if top[0] < speed:
        assert ramps == pytest.approx(length, rel=1e-5)


def check_leg(leg: Leg, length: float, acceleration: float, jerk: float) -> None:
    end = float(leg.duration[0])
    t = np.linspace(0, end, 4001)
    way, speed = (x[0] for x in leg.at(t[None]))
    assert (way[0], speed[0]) == (0, 0)
    assert way[-1] == pytest.approx(length, rel=1e-5)
    assert speed[-1] == pytest.approx(0, abs=1e-9)
    assert np.diff(way).min() >= -1e-12
    assert abs(np.diff(speed)).max() / t[1] <= acceleration * (1 + 1e-6)
    mean = (speed[1:] + speed[:-1]) / 2
    np.testing.assert_allclose(
        np.diff(way), mean * t[1], atol=jerk * t[1] ** 3 / 10 + 1e-5 * length
    )


@given(lengths, speeds, accelerations, jerks)
def test_a_leg_covers_exactly_its_length(
    length: float, speed: float, acceleration: float, jerk: float
) -> None:
    leg = plain_leg(length, one(speed), acceleration, jerk)
    check_leg(leg, length, acceleration, jerk)
    assert leg.duration[0] >= length / speed * (1 - 1e-9)


@given(lengths, speeds, speeds, st.floats(0, 5), accelerations, jerks)
def test_a_leg_whose_speed_changes_does_too(
    length: float, old: float, new: float, elapsed: float, acceleration: float, jerk: float
) -> None:
    leg = changed_leg(length, one(old), one(new), one(elapsed), acceleration, jerk)
    check_leg(leg, length, acceleration, jerk)
    assert leg.duration[0] >= length / max(old, new) * (1 - 1e-9)


@given(lengths, speeds, accelerations, jerks, st.floats(0, 5))
def test_a_change_to_the_same_speed_is_none(
    length: float, speed: float, acceleration: float, jerk: float, elapsed: float
) -> None:
    changed = changed_leg(length, one(speed), one(speed), one(elapsed), acceleration, jerk)
    plain = plain_leg(length, one(speed), acceleration, jerk)
    assert changed.duration[0] == pytest.approx(plain.duration[0], rel=1e-6)


@settings(max_examples=60)
@given(wandering(climbs=True), models)
def test_motion_is_continuous_and_within_limits(path: FlightPath, model: ArduCopter) -> None:
    flown = model.fly(path, 0.05)
    np.testing.assert_allclose(np.diff(flown.t), 0.05)
    assert flown.t[0] == 0
    assert flown.t[-1] >= flown.departures[-1]
    moved = np.diff(flown.position, axis=0)
    mean = (flown.velocity[1:] + flown.velocity[:-1]) / 2
    np.testing.assert_allclose(moved, mean * 0.05, atol=0.01)
    # Where two legs overlap both move the aircraft: their speeds never add up to more than both.
    up = flown.velocity[:, 2]
    assert up.max() <= 2 * model.climb_speed + 1e-9
    assert up.min() >= -2 * model.descent_speed - 1e-9
    change = np.linalg.norm(np.diff(flown.velocity, axis=0), axis=1) / 0.05
    assert change.max() <= 2 * np.hypot(model.acceleration, model.climb_acceleration) + 1e-6


@settings(max_examples=60)
@given(wandering(climbs=True), models)
def test_arrivals_are_in_order_and_stops_are_at_their_points(
    path: FlightPath, model: ArduCopter
) -> None:
    flown = model.fly(path, 0.05)
    waits = np.floor(path.holds)
    assert flown.arrivals[0] == 0
    np.testing.assert_allclose(flown.departures - flown.arrivals, waits, atol=1e-9)
    assert (flown.arrivals[1:] > flown.departures[:-1]).all()
    stops = waits > 0
    stops[[0, -1]] = True
    for point, leaves, stop in zip(path.points, flown.departures, stops, strict=True):
        place = [np.interp(leaves, flown.t, x) for x in flown.position.T]
        if stop:
            np.testing.assert_allclose(place, point, atol=1e-6)
    np.testing.assert_allclose(flown.position[-1], path.points[-1], atol=1e-6)
    np.testing.assert_allclose(flown.velocity[-1], 0, atol=1e-9)


@settings(max_examples=60)
@given(wandering(climbs=True), st.integers(0, 2**32 - 1), models)
def test_variants_side_by_side_fly_as_they_do_alone(
    path: FlightPath, seed: int, model: ArduCopter
) -> None:
    rng = np.random.default_rng(seed)
    tried = path.speeds * rng.uniform(0.6, 1.4, (3, len(path.speeds)))
    waits = path.holds * rng.uniform(0.5, 2, (3, len(path.holds)))
    many = model.fly_many(path, tried, waits)
    for k, found in enumerate(many):
        alone = replace(path, speeds=tried[k], holds=np.floor(waits[k]), delays=waits[k] % 1)
        flown = model.fly(alone)
        np.testing.assert_allclose(found.arrivals, flown.arrivals, atol=1e-9)
        np.testing.assert_allclose(found.departures, flown.departures, atol=1e-9)
        shared = len(flown.t)
        np.testing.assert_allclose(found.position[:shared], flown.position, atol=1e-9)
        np.testing.assert_allclose(found.velocity[:shared], flown.velocity, atol=1e-9)


def test_holds_lose_their_fractions_and_delays_keep_them() -> None:
    path = path_of([0, 100, 100 + 100j], holds={1: 5.7})
    held = ArduCopter().fly(path)
    assert held.departures[1] - held.arrivals[1] == pytest.approx(5)
    delays = np.array([0.0, 0.7, 0.0])
    both = ArduCopter().fly(replace(path, delays=delays))
    assert both.departures[1] - both.arrivals[1] == pytest.approx(5.7)
    only = ArduCopter().fly(replace(path, holds=np.zeros(3), delays=delays))
    assert only.departures[1] - only.arrivals[1] == pytest.approx(0.7)


def test_a_hold_of_less_than_a_second_is_none() -> None:
    passing = ArduCopter().fly(line(60, 2))
    holding = ArduCopter().fly(path_of([0, 60, 120], holds={1: 0.9}))
    np.testing.assert_allclose(holding.arrivals, passing.arrivals)


@pytest.mark.parametrize("model", [ArduCopter(), QUICK])
@pytest.mark.parametrize("leg", [0, 3, 6, 9])
def test_arrivals_are_smooth_in_speeds(model: ArduCopter, leg: int) -> None:
    rng = np.random.default_rng(leg)
    turns, spacing = rng.uniform(-0.25, 0.25, 14), rng.uniform(12, 30, 14)
    path = path_of(
        [0j, *np.cumsum(spacing * np.exp(1j * np.cumsum(turns)))],
        list(rng.uniform(3, 8, 14)),
        holds={7: 6.0},
    )
    tried = np.tile(path.speeds, (41, 1))
    change = np.linspace(-0.02, 0.02, 41)
    tried[:, leg] += change
    many = model.fly_many(path, tried, np.tile(path.holds, (41, 1)))
    arrivals = np.array([flown.arrivals[-1] for flown in many])
    noise = arrivals - np.polyval(np.polyfit(change, arrivals, 3), change)
    assert abs(noise).max() < 1e-3


def test_a_commanded_speed_is_flown_on_legs_with_room_for_it() -> None:
    flown = ArduCopter().fly(line(150, 3, [6.0, 3.0, 8.0]))
    ends = [0, *flown.arrivals[1:]]
    for k, speed in enumerate([6.0, 3.0, 8.0]):
        middle = (ends[k] + ends[k + 1]) / 2
        assert np.interp(middle, flown.t, flown.velocity[:, 0]) == pytest.approx(speed, abs=0.01)


def test_a_leg_that_climbs_is_as_slow_as_the_climb() -> None:
    model = ArduCopter(climb_speed=2.0, descent_speed=1.0)
    up = model.fly(path_of([0, 40], heights=[30, 90]))
    down = model.fly(path_of([0, 40], heights=[90, 30]))
    assert up.velocity[:, 2].max() == pytest.approx(2.0, abs=1e-6)
    assert down.velocity[:, 2].min() == pytest.approx(-1.0, abs=1e-6)
    assert up.departures[-1] == pytest.approx(60 / 2 + 2.0 + 1.3, abs=1.5)
    assert down.departures[-1] == pytest.approx(60 / 1 + 2.3, abs=1.5)
    middle = up.position[len(up.t) // 2]
    assert (middle[2] - 30) / 60 == pytest.approx(middle[0] / 40, abs=1e-9)


def test_a_vertical_leg_and_a_leg_of_no_length() -> None:
    flown = ArduCopter().fly(path_of([0, 0, 50, 50, 100], heights=[10, 40, 40, 40, 40]))
    assert flown.arrivals[1] == pytest.approx(30 / 2.5, abs=5)
    assert abs(flown.position[flown.t < flown.arrivals[1] - 3, 0]).max() == 0
    np.testing.assert_allclose(flown.position[-1], [100, 0, 40], atol=1e-9)
    assert np.isfinite(flown.position).all()


def test_one_point_is_only_held() -> None:
    flown = ArduCopter().fly(path_of([3 + 4j], holds={0: 2.5}))
    assert flown.departures[0] == pytest.approx(2)
    np.testing.assert_array_equal(flown.position, np.tile([3, 4, 30], (len(flown.t), 1)))


def test_a_sharper_turn_takes_longer() -> None:
    ends = [
        ArduCopter().fly(path_of([0, 100, 100 + 100 * np.exp(1j * np.radians(turn))])).arrivals[2]
        for turn in (0, 45, 90, 135, 180)
    ]
    assert ends == sorted(ends)
    assert ends[-1] > ends[0] + 2


def test_a_wider_radius_cuts_the_corner() -> None:
    nearest = []
    for radius in (1.0, 2.0, 5.0):
        flown = ArduCopter(radius=radius).fly(path_of([0, 100, 100 + 100j]))
        nearest.append(np.hypot(flown.position[:, 0] - 100, flown.position[:, 1]).min())
    assert nearest == sorted(nearest)
    assert nearest[1] == pytest.approx(2.0, abs=0.1)


@settings(max_examples=30)
@given(wandering(shortest=12.0), models)
def test_splines_pass_their_points_and_stop_at_the_last(
    path: FlightPath, model: ArduCopter
) -> None:
    splines = np.arange(len(path.points)) > 0
    flown = model.fly(replace(path, splines=splines), 0.05)
    assert (np.diff(flown.arrivals) > 0).all()
    waits = np.floor(path.holds)
    np.testing.assert_allclose(flown.departures - flown.arrivals, waits, atol=1e-9)
    np.testing.assert_allclose(flown.position[-1], path.points[-1], atol=1e-6)
    for point in path.points:
        assert np.linalg.norm(flown.position - point, axis=1).min() < 1.0
    moved = np.linalg.norm(np.diff(flown.position, axis=0), axis=1) / 0.05
    assert moved.max() <= path.speeds.max() + 0.01


def test_limits_come_from_parameters_of_either_generation() -> None:
    older = {"WPNAV_ACCEL": 400, "WPNAV_JERK": 10, "WPNAV_SPEED_UP": 300, "WPNAV_SPEED": 700}
    newer = {"WP_ACC": 4, "WP_JERK": 10, "WP_SPD_UP": 3, "WP_SPD": 7}
    expected = replace(QUICK, climb_speed=3, cruise_speed=7)
    for parameters in (older, newer, {"WPNAV_ACCEL": 999, "WPNAV_SPEED": 1} | older | newer):
        assert ArduCopter.from_vehicle(Vehicle(parameters=parameters)) == expected


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_useless_parameter_is_named(value: float) -> None:
    vehicle = Vehicle("ardupilot", "copter", {"WPNAV_JERK": value}, "quad.param")
    with pytest.raises(InputError, match=r"quad\.param: WPNAV_JERK: .*at least 0\.1"):
        ArduCopter.from_vehicle(vehicle)


def test_calibrated() -> None:
    assert ArduCopter.calibrated
