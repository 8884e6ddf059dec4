"""What holds for every PX4 flight."""

from dataclasses import replace

import numpy as np
import pytest
from flight_paths import bends, line, path_of, roughness, wandering
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.autopilot.flight_path import FlightPath
from faao_mav.autopilot.px4 import Px4
from faao_mav.autopilot.px4.flight_model import SWITCH_DELAY

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
