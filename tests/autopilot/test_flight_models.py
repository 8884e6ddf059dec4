"""What holds for every flight of every model, and what was measured beside recorded flights."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.autopilot import FlightPath, Model, Vehicle
from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.autopilot.ardupilot.legs import StraightLegs
from faao_mav.autopilot.ardupilot.plane import ArduPlane
from faao_mav.autopilot.ardupilot.target import Target
from faao_mav.autopilot.body import CopterBody, PlaneBody
from faao_mav.autopilot.px4 import Px4
from faao_mav.errors import InputError
from faao_mav.plan import Wind
from faao_mav.power import GRAVITY

QUICK = ArduCopter(acceleration=4, jerk=10)
SUITED = Px4(acceleration=5, jerk=20, error_limit=10, height_radius=3)
PLANE = ArduPlane()
COPTERS = [ArduCopter(), QUICK, ArduCopter(acceleration=1), Px4(), SUITED]


def path_of(
    places: Sequence[complex],
    speed: float | Sequence[float] = 8.0,
    *,
    holds: dict[int, float] | None = None,
    heights: Sequence[float] | float = 30.0,
) -> FlightPath:
    """Return the path through `places`, east + i north."""
    where, count = np.array(places, dtype=complex), len(places)
    points = np.stack([where.real, where.imag, np.broadcast_to(heights, count)], axis=-1)
    waits = np.array([(holds or {}).get(k, 0.0) for k in range(count)])
    speeds = np.full(count - 1, speed, dtype=float)
    return FlightPath(points, speeds, waits, np.zeros(count, dtype=bool), np.zeros(count))


def line(spacing: float, legs: int, speed: float) -> FlightPath:
    return path_of([complex(spacing * k) for k in range(legs + 1)], speed)


@st.composite
def wandering(draw: st.DrawFn, *, shortest: float = 5.0) -> FlightPath:
    """Paths of a few legs with any turns, climbs, speeds and holds."""
    legs = draw(st.integers(1, 5))

    def some(least: float, most: float, count: int = legs) -> list[float]:
        return draw(st.lists(st.floats(least, most), min_size=count, max_size=count))

    steps = np.array(some(shortest, 120)) * np.exp(1j * np.cumsum(some(-3.1, 3.1)))
    holds = draw(st.dictionaries(st.integers(0, legs), st.floats(0.5, 20), max_size=2))
    places, heights = [0j, *np.cumsum(steps)], some(20, 60, legs + 1)
    return path_of(places, some(1, 12), holds=holds, heights=heights)


@settings(max_examples=24)
@given(wandering(), st.sampled_from(COPTERS), st.booleans())
def test_a_copters_motion_is_continuous_and_within_limits(
    path: FlightPath, model: ArduCopter | Px4, curved: bool
) -> None:
    curved = curved and isinstance(model, ArduCopter)
    flown = model.fly(replace(path, splines=(np.arange(len(path.points)) > 0) & curved), 0.05)
    np.testing.assert_allclose(np.diff(flown.t), 0.05)
    assert flown.t[0] == flown.arrivals[0] == 0
    assert flown.t[-1] >= flown.departures[-1] - 1e-9
    ground = np.hypot(*flown.velocity[:, :2].T)
    assert ground.max() <= 1.25 * path.speeds.max() + 0.5
    # Where two legs overlap both may climb.
    assert flown.velocity[:, 2].max() <= 2 * model.climb_speed + 1e-9
    assert flown.velocity[:, 2].min() >= -2 * model.descent_speed - 1e-9
    middle = (flown.velocity[1:] + flown.velocity[:-1]) / 2
    assert np.diff(flown.position, axis=0) / 0.05 == pytest.approx(middle, abs=0.4)
    change = np.linalg.norm(np.diff(flown.velocity[:, :2], axis=0), axis=1) / 0.05
    drag = model.body.linear_drag * ground + model.body.quadratic_drag * ground**2
    most = 1.5 * math.sqrt(2) * model.acceleration + 0.5
    if isinstance(model, ArduCopter):
        most = GRAVITY * math.tan(model.lean_angle) + drag[1:] + 0.2
        np.testing.assert_allclose(flown.departures - flown.arrivals, path.holds, atol=1e-9)
    assert (change <= most).all()
    # PX4 leaves from within its radius, and some steps late; a long hold is spent at the place.
    assert (flown.departures - flown.arrivals >= path.holds - 1e-9).all()
    assert (flown.arrivals[1:] >= flown.departures[:-1]).all()
    near = 2.0 if isinstance(model, ArduCopter) else model.acceptance_radius + 0.05
    for point, when, wait in zip(path.points, flown.departures, path.holds, strict=True):
        there = [np.interp(when, flown.t, x) for x in flown.position.T]
        assert wait < 1 or np.hypot(*(there - point)[:2]) <= near
        closest = np.linalg.norm(flown.position - point, axis=1).min()
        assert not curved or closest < 3.0


@settings(max_examples=20)
@given(wandering(shortest=0.0))
def test_a_planes_motion_is_an_aeroplanes(path: FlightPath) -> None:
    flown = PLANE.fly(path)
    speed = np.linalg.norm(flown.velocity, axis=1)
    assert 0.5 * PLANE.min_speed <= speed.min() <= speed.max() <= PLANE.max_speed
    assert abs(flown.velocity[:, 2]).max() <= 2 * PLANE.climb_speed
    moved = np.linalg.norm(np.diff(flown.position, axis=0), axis=1) / 0.1
    assert moved.max(initial=0) <= speed.max() + 0.1
    heading = np.unwrap(np.arctan2(flown.velocity[:, 1], flown.velocity[:, 0]))
    turning = abs(np.diff(heading)) / 0.1
    assert turning.max(initial=0) <= 2 * 9.81 * math.tan(PLANE.roll_limit) / speed.min()
    assert (flown.arrivals[1:] >= flown.departures[:-1] - 1e-9).all()


@pytest.mark.parametrize("model", [ArduCopter(), Px4(), PLANE])
def test_one_point_is_only_held(model: Model) -> None:
    flown = model.fly(path_of([3 + 4j], holds={0: 2.5}))
    held = {ArduCopter: 2.5, Px4: 2.5, ArduPlane: 0.0}[type(model)]
    assert flown.departures[0] == pytest.approx(held, abs=0.1)
    np.testing.assert_allclose(flown.position, np.tile([3, 4, 30], (len(flown.t), 1)))


def test_the_lean_angle_and_the_body_bound_its_speed() -> None:
    for vehicle, top in (
        (Vehicle(parameters={"ANGLE_MAX": 3000}), 10.3),  # measured
        (Vehicle(parameters={"ANGLE_MAX": 4500}), 15.2),
        (Vehicle(body=CopterBody(linear_drag=0.7)), None),
    ):
        flown = vehicle.flight_model().fly(line(1500, 1, 20.0))
        fastest = np.hypot(*flown.velocity[:, :2].T).max()
        assert fastest == pytest.approx(top or vehicle.top_airspeed, rel=0.05)
    for speed in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="speeds"):
            ArduCopter().fly(path_of([0, 9], speed))


def test_a_corner_with_little_acceleration_takes_longer() -> None:
    """WPNAV_ACCEL_C; of its own it is twice WPNAV_ACCEL, where the radius bounds the corner."""
    corner = path_of([0j, 100 + 0j, 100 + 100j])
    own, wide, tight = (
        ArduCopter(corner_acceleration=limit).fly(corner).departures[-1] for limit in (0, 50, 0.5)
    )
    assert own == pytest.approx(wide, abs=0.01)
    assert own + 0.5 < tight


def test_legs_take_as_long_as_the_target_takes() -> None:
    rng, worst = np.random.default_rng(1), []
    for _ in range(100):
        count = int(rng.integers(2, 7))
        lengths, stops = rng.uniform(8, 120, count), np.ones(count + 1, dtype=bool)
        stops[1:-1] = rng.random(count - 1) < 0.2
        speeds = rng.uniform(1.5, 10, count)
        limits = ArduCopter(acceleration=rng.uniform(1.5, 5), jerk=rng.uniform(5, 20))
        points = np.zeros((count + 1, 3))
        points[1:, 0] = np.cumsum(lengths)
        legs = StraightLegs(lengths, ~stops[:-1], limits)
        target = Target(points, speeds, np.zeros(count + 1, dtype=bool), stops, limits)
        worst.append(np.abs(legs.flown(speeds)[1] - np.diff(target.passed)).max())
        most = np.minimum(speeds, legs.most)  # what is commanded above makes no difference
        np.testing.assert_allclose(legs.flown(most)[1], legs.flown(speeds)[1])
    assert np.median(worst) < 0.05
    assert np.quantile(worst, 0.9) < 0.3


def test_a_wide_radius_before_a_small_one_costs_speed() -> None:
    """Flown by PX4 at 8 m/s round 15 degrees: 5.6 m/s with 9.9 m before 1.5 m."""
    for radii, slowest in (([2, 9.9, 1.5, 2], 5.6), ([2, 9.9, 9.9, 2], 7.8)):
        path = path_of([0, 50, 50 + 50 * np.exp(0.26j), 200])
        path.radii[:] = radii
        flown = SUITED.fly(path)
        about = abs(flown.t - flown.arrivals[1]) < 2.5
        speed = np.linalg.norm(flown.velocity[about], axis=1).min()
        assert speed == pytest.approx(slowest, abs=0.5)
    assert SUITED.radii(np.ones(2), np.zeros(2), np.ones(2, dtype=bool)).min() >= 1  # a metre
    ways = np.array([99.0, 99.0, 4.0]), np.array([0.0, 0.3, 0.0]), np.array([True, False, True])
    _, corner, after = SUITED.radii(*ways)
    assert corner <= after  # PX4 would first fly back


@settings(max_examples=8)
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
    with pytest.raises(InputError, match="perhaps for the wind"):
        PLANE.fly(replace(line(500, 1, 15.0), wind=(-20.0 - speed, 0.0), longest=600.0))


def test_airspeed_is_held_within_its_limits_and_higher_in_thin_air() -> None:
    """Standard atmosphere, 684 m: the density is 0.9359 of that at sea level."""
    for command, held in ((3, 9), (40, 22), (0, 12), (15, 15)):
        for exponent, ratio in ((0.5, 1.0337), (1.0, 1.0337**2)):
            plane = ArduPlane(body=PlaneBody(airspeed_exponent=exponent))
            track = plane.fly(replace(line(1500, 1, float(command)), elevation=654.0))
            speed = np.linalg.norm(track.velocity, axis=1)[-1]
            assert speed == pytest.approx(held * ratio, rel=2e-3)
    climb = PLANE.fly(path_of([0, 100, 1500], 15.0, heights=[50, 200, 200])).velocity[:, 2]
    assert np.median(climb[climb > 1]) == pytest.approx(5, abs=0.5)  # as fast as it may
    rates = ArduPlane(cruise_speed=22.0).speed_rates  # of the demand, as its log shows
    assert (rates.fall, rates.power / 17.7) == pytest.approx((0.80, 1.38), abs=0.01)
    rates = ArduPlane(cruise_speed=16.0, descent_speed=3.0).speed_rates
    assert rates.fall == pytest.approx(1.65, abs=0.01)
