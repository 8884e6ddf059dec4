"""How far a flight is from the plan."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from faao_mav.schedule.prediction import deviation, lateness
from faao_mav.vector import distances_to_path, distances_to_segment

COORDINATES = st.floats(-1e4, 1e4)


@pytest.mark.filterwarnings("error")
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
    short = np.column_stack([np.minimum(8 * t, 40.0), 0 * t])
    found = deviation(t, planned, t, short, 2.0)
    assert found.max == pytest.approx(40)
    assert math.isfinite(found.late)


def test_the_path_counts_both_ways_and_to_its_end_at_speed() -> None:
    t = np.arange(3.0)
    straight, bent = (np.array([[0.0, 0], [50, far], [100, 0]]) for far in (0, 7))
    assert deviation(t, straight, t, bent, 1.0).path == pytest.approx(7)
    assert deviation(t, bent, t, straight, 1.0).path == pytest.approx(7)
    t, flown = np.arange(0.0, 20.2, 0.2), np.arange(-3.05, 25.0, 0.1)
    for speed in (25.0, 25.5):  # the last sample is 2.5 m before the end, or behind it
        planned, w = (
            np.column_stack([v * times, 0 * times]) for v, times in ((25.0, t), (speed, flown))
        )
        assert deviation(t, planned, flown, w, 2.0).path < 0.1


@given(st.floats(0.3, 30.0))
def test_a_flight_is_not_over_where_it_passes_its_end_on_the_way(slowness: float) -> None:
    """There and back through the end, and round after round: at any speed it is the same way."""
    t = np.linspace(0.0, 240.0, 241)
    there_and_back = np.interp(t, [0, 160, 240], [-500.0, 700.0, 0.0])
    angle = 2 * np.pi * 3 * t / 240
    for w in (
        np.column_stack([there_and_back, 0 * t]),
        50 * np.column_stack([np.cos(angle), np.sin(angle)]),
    ):
        late = lateness(t, w, slowness * t, w, 2.0)
        assert late == pytest.approx((slowness - 1) * 240, rel=0.02, abs=0.5)


@given(
    arrays(float, st.tuples(st.integers(1, 20), st.just(2)), elements=COORDINATES),
    arrays(float, st.tuples(st.integers(1, 20), st.just(2)), elements=COORDINATES),
)
def test_the_distance_to_a_path_is_the_least_to_a_leg(points: np.ndarray, path: np.ndarray) -> None:
    legs = list(zip(path, [*path[1:], path[-1]], strict=True))
    expected = np.min([distances_to_segment(points, a, b) for a, b in legs], axis=0)
    assert distances_to_path(points, path) == pytest.approx(expected, abs=1e-6)
