"""How far a flight is from the plan."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from faao_mav.schedule.schedule import deviation, lateness
from faao_mav.vector import distances_to_path, distances_to_segment

COORDINATES = st.floats(-1e4, 1e4)


def test_a_late_flight_is_off_in_time_and_not_in_space() -> None:
    t = np.linspace(0, 10, 101)
    planned = np.column_stack([8 * t, 0 * t])
    longer = np.linspace(0, 12, 121)
    late = np.column_stack([8 * np.clip(longer - 0.5, 0, 10), 0 * longer])
    found = deviation(t, planned, longer, late, 2.0)
    assert found.path == pytest.approx(0, abs=1e-12)
    assert found.max == pytest.approx(4)
    assert 3.8 < found.rms < 4
    assert found.late == pytest.approx(0.5)
    assert lateness(t, planned, longer, late, 2.0) == found.late


@pytest.mark.filterwarnings("error")
def test_a_flight_that_stops_short_has_an_end() -> None:
    t = np.arange(0.0, 10.1)
    short = np.column_stack([np.minimum(8 * t, 40.0), 0 * t])
    found = deviation(t, np.column_stack([8 * t, 0 * t]), t, short, 2.0)
    assert found.max == pytest.approx(40)
    assert math.isfinite(found.late)


def test_a_detour_and_a_short_cut_both_count_as_astray() -> None:
    t = np.arange(3.0)
    straight = np.array([[0.0, 0], [50, 0], [100, 0]])
    bent = np.array([[0.0, 0], [50, 7], [100, 0]])
    assert deviation(t, straight, t, bent, 1.0).path == pytest.approx(7)
    assert deviation(t, bent, t, straight, 1.0).path == pytest.approx(7)


@pytest.mark.parametrize(("stride", "speed"), [(1, 25.0), (4, 25.0), (4, 25.5)])
def test_a_path_counts_to_its_end_at_speed(stride: int, speed: float) -> None:
    """The last sample before the end is up to 10 m before it here, or 10 m behind it if early."""
    t = np.arange(0.0, 20.2, 0.2)
    flown = np.arange(-3.05, 25.0, 0.1)
    planned, w = (
        np.column_stack([v * times, 0 * times]) for v, times in ((25.0, t), (speed, flown))
    )
    assert deviation(t, planned, flown, w, 2.0, stride=stride).path < 0.1


@given(
    arrays(float, st.tuples(st.integers(1, 20), st.just(2)), elements=COORDINATES),
    arrays(float, st.tuples(st.integers(1, 20), st.just(2)), elements=COORDINATES),
)
def test_the_distance_to_a_path_is_the_least_to_a_leg(points: np.ndarray, path: np.ndarray) -> None:
    legs = list(zip(path, [*path[1:], path[-1]], strict=True))
    expected = np.min([distances_to_segment(points, a, b) for a, b in legs], axis=0)
    assert distances_to_path(points, path) == pytest.approx(expected, abs=1e-6)
