"""What holds for every PX4 flight, and the parts of its model."""

from dataclasses import replace

import numpy as np
import pytest
from flight_paths import bends, line, path_of, roughness, wandering
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.autopilot.flight_path import FlightPath
from faao_mav.autopilot.px4 import Px4
from faao_mav.autopilot.px4.flight_model import SWITCH_DELAY
from faao_mav.autopilot.px4.guidance import Axis, follow, headed, legs

SUITED = Px4(acceleration=5, jerk=20, error_limit=10, height_radius=3)

models = st.sampled_from([Px4(), SUITED])


@settings(max_examples=15)
@given(wandering(climbs=True), models)
def test_motion_is_continuous_and_within_limits(path: FlightPath, model: Px4) -> None:
    flown = model.fly(path, 0.05)
    speed = np.linalg.norm(flown.velocity[:, :2], axis=1)
    assert speed.max() <= 1.25 * path.speeds.max() + 0.5
    assert -1.6 * model.descent_speed <= flown.velocity[:, 2].min()
    assert flown.velocity[:, 2].max() <= 1.3 * model.climb_speed
    mean = (flown.velocity[1:] + flown.velocity[:-1]) / 2
    np.testing.assert_allclose(np.diff(flown.position, axis=0), mean * 0.05, atol=0.02)
    # Each axis has its own limit, and the controller adds to what the trajectory asks for.
    change = np.abs(np.diff(flown.velocity[:, :2], axis=0)) / 0.05
    assert change.max() <= 1.5 * model.acceleration + 0.5
    assert flown.arrivals[0] == 0
    waits = path.holds + SWITCH_DELAY * ((path.holds > 0) | (np.arange(len(path.holds)) > 0))
    np.testing.assert_allclose(flown.departures - flown.arrivals, waits, atol=1e-9)
    assert (flown.arrivals[1:] >= flown.departures[:-1]).all()
    assert flown.t[-1] >= flown.departures[-1] > flown.t[-1] - 0.05 - 1e-9
    for point, arrival in zip(path.points, flown.arrivals, strict=True):
        place = [np.interp(arrival, flown.t, x) for x in flown.position.T]
        assert np.hypot(*(place - point)[:2]) <= model.acceptance_radius + 0.05
        assert abs(place[2] - point[2]) <= model.height_radius + 0.05


@settings(max_examples=10)
@given(
    st.lists(st.floats(4, 80), min_size=2, max_size=8),
    st.data(),
    models,
)
def test_a_faster_leg_is_never_later_by_more_than_a_switch(
    lengths: list[float], data: st.DataObject, model: Px4
) -> None:
    path = path_of([0, *np.cumsum(lengths)], 5.0)
    leg = data.draw(st.integers(0, len(lengths) - 1))
    speeds = np.tile(path.speeds, (12, 1))
    speeds[:, leg] = np.linspace(2, 9, 12)
    # on legs that end while it still speeds up, the switch to the next one may cost 0.03 s
    ends = [model.fly(replace(path, speeds=tried)).arrivals[-1] for tried in speeds]
    assert (np.diff(ends) <= 0.05).all()


def test_arrivals_are_smooth_in_speeds() -> None:
    for model in (Px4(), SUITED):
        for leg in (3, 6, 9):
            path = bends(leg)
            path.radii[:] = 3
            assert roughness(model, path, leg) < 4e-3  # a detour of a few steps may begin or end


def test_a_radius_as_long_as_its_leg_counts_at_once() -> None:
    path = path_of([0, 60, 70, 120])
    path.radii[2] = 15
    flown = Px4().fly(path)
    assert flown.arrivals[2] == pytest.approx(flown.departures[1])


def test_no_speed_means_cruise_speed_and_the_limit_holds() -> None:
    path = line(200, 1, 0.0)
    assert Px4().fly(path).velocity[:, 0].max() == pytest.approx(5, abs=0.3)
    assert Px4(cruise_speed=3).fly(path).velocity[:, 0].max() == pytest.approx(3, abs=0.3)
    fast = Px4(max_speed=6).fly(line(200, 1, 9.0))
    assert fast.velocity[:, 0].max() == pytest.approx(6, abs=0.3)


def test_climbs_at_its_own_speed() -> None:
    up = Px4().fly(path_of([0, 40], 8, heights=[30, 90]))
    down = Px4().fly(path_of([0, 40], 8, heights=[90, 30]))
    assert up.departures[-1] == pytest.approx(60 / 3, abs=4)
    assert down.departures[-1] == pytest.approx(60 / 1.5, abs=5)
    # On the straight line between the two points.
    middle = up.position[len(up.t) // 2]
    assert (middle[2] - 30) / 60 == pytest.approx(middle[0] / 40, abs=0.05)


def test_one_point_is_only_held() -> None:
    flown = Px4().fly(path_of([3 + 4j], holds={0: 2.5}))
    assert flown.departures[0] == pytest.approx(2.5 + SWITCH_DELAY)
    np.testing.assert_array_equal(flown.position, np.tile([3, 4, 30], (len(flown.t), 1)))


SUITED = Px4(acceleration=5, jerk=20, error_limit=10, height_radius=3)


def test_what_it_heads_for() -> None:
    points = np.array([[0.0, 0, 30], [50, 0, 30], [50, 60, 30]])
    leg = legs(SUITED, points, np.full(3, 2.0), np.full(2, 8.0), [0.0, 0.0, 0.0])[0]
    for place, target, along, onward in (
        (20 + 1j, 50, 1, 1j),
        (-1.5 + 1j, 50, 1, 1j),  # within the radius of its beginning
        (-3 + 0j, 0, 1, 1),
        (-3 + 4j, 0, (3 - 4j) / 5, 1),
        (20 - 3j, 20, 1j, 1),  # onto the leg
        (51 + 0j, 50, -1, 1j),
        (53 + 4j, 50, -(3 + 4j) / 5, 1j),
    ):
        found = headed(SUITED, leg, place)
        assert found.target == target
        assert found.along == pytest.approx(along)
        assert found.onward == pytest.approx(onward)


def slowest_near(radii: list[float], corner: int) -> float:
    path = path_of([0, 50, 50 + 50 * np.exp(0.26j), 200])
    path.radii[:] = radii
    flown = SUITED.fly(path)
    about = abs(flown.t - flown.arrivals[corner]) < 2.5
    return float(np.linalg.norm(flown.velocity[about], axis=1).min())


def test_a_wide_radius_before_a_small_one_costs_speed() -> None:
    # Flown by PX4 at 8 m/s round 15 degrees: 5.6 m/s with 9.9 m before 1.5 m.
    assert slowest_near([2, 9.9, 1.5, 2], 1) == pytest.approx(5.6, abs=0.5)
    assert slowest_near([2, 9.9, 9.9, 2], 1) > 7.5


def test_radii_are_a_metre_at_least_and_none_narrows_in_a_corner() -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        room, turn = rng.uniform(1, 100, 12), rng.uniform(0, 3, 12) * (rng.uniform(size=12) < 0.7)
        stops = rng.uniform(size=12) < 0.2
        stops[[0, -1]] = True
        radii = SUITED.radii(room, turn, stops)
        assert radii.min() >= 1.0
        corners = np.flatnonzero(((turn > 0.1) & ~stops)[:-1])
        assert (radii[corners] <= radii[corners + 1] + 1e-9).all()


AXES = st.lists(
    st.tuples(st.builds(Axis, st.just(0.0), st.floats(-9, 9), st.floats(-3, 3)), st.floats(-9, 9)),
    min_size=1,
    max_size=3,
)


@given(AXES, st.floats(0.01, 0.1))
def test_ramps_stay_within_limits_and_end_together_at_what_was_asked_for(
    axes: list[tuple[Axis, float]], dt: float
) -> None:
    states, wanted, limits = [a for a, _ in axes], [s for _, s in axes], [3.0] * len(axes)
    for axis, after in zip(states, follow(states, wanted, limits, 4.0, dt), strict=True):
        change = after.acceleration - axis.acceleration
        assert abs(after.acceleration) <= 3 + 1e-9
        assert abs(change) <= 4 * dt + 1e-9
        gained = (axis.acceleration + change / 2) * dt
        assert after.velocity - axis.velocity == pytest.approx(gained, abs=1e-9)
        moved = (axis.velocity + axis.acceleration * dt / 2 + change * dt / 6) * dt
        assert after.position == pytest.approx(moved, abs=1e-9)
    for _ in range(200):
        states = follow(states, wanted, limits, 4.0, 0.1)
    np.testing.assert_allclose([axis.velocity for axis in states], wanted, atol=1e-6)
    np.testing.assert_allclose([axis.acceleration for axis in states], 0, atol=1e-6)


def test_one_axis_takes_the_shortest_time_and_others_as_long() -> None:
    # From rest to 4 m/s: 0.75 s of rising, 0.583 s at the limit, 0.75 s of falling acceleration.
    whole, steps = 2 * 3 / 4 + (4 - 3 * 3 / 4) / 3, 400
    states = [Axis(0.0), Axis(0.0)]
    for _ in range(steps - 4):
        states = follow(states, [4.0, 1.0], [3.0, 3.0], 4.0, whole / steps)
    assert 0 < 4 - states[0].velocity < 0.05
    assert 0 < 1 - states[1].velocity < 0.05
