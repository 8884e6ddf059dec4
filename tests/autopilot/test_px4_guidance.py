"""The parts of the PX4 model: where it heads for on a leg, and ramps within limits."""

import numpy as np
import pytest
from flight_paths import path_of
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.autopilot.px4 import Px4
from faao_mav.autopilot.px4.guidance import Axis, follow, headed, legs

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
