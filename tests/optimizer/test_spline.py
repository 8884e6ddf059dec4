"""The splines on even grids are scipy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from faao_mav.optimizer.rates.spline import Spline, pieces

VALUES = st.lists(st.floats(-100, 100), min_size=4, max_size=30)


@given(VALUES, st.floats(-50, 50), st.floats(0.01, 10), st.integers(0, 2))
def test_values_and_derivatives_are_those_of_scipy(
    values: list[float], first: float, step: float, order: int
) -> None:
    x = first + step * np.arange(len(values))
    beyond = np.linspace(x[0] - step, x[-1] + step, 101)
    expected = CubicSpline(x, values)(beyond, order)
    scale = max(np.abs(values).max(), 1e-9) / step**order
    found = Spline.through(x, np.array(values))(beyond, order)
    assert found == pytest.approx(expected, abs=1e-7 * scale)


@given(VALUES)
def test_the_values_are_met_on_the_grid(values: list[float]) -> None:
    x = np.linspace(0, 1, len(values))
    assert Spline.through(x, np.array(values))(x) == pytest.approx(values, abs=1e-9)


def test_many_splines_at_once_are_each_alone() -> None:
    y = np.random.default_rng(0).normal(size=(9, 3, 2))
    assert pieces(0.5, y) == pytest.approx(CubicSpline(0.5 * np.arange(9), y).c)
    assert pieces(0.5, y)[:, :, 1, 1] == pytest.approx(pieces(0.5, y[:, 1, 1]))
