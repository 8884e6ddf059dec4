"""The splines on even grids are those of scipy: CubicSpline and FITPACK's bicubic spline."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import interpolate

from faao_mav.optimizer.rates.spline import BicubicSpline, CubicSpline, cubic_pieces

VALUES = st.lists(st.floats(-100, 100), min_size=4, max_size=30)


@given(VALUES, st.floats(-50, 50), st.floats(0.01, 10))
def test_values_and_derivatives_are_those_of_scipy(
    values: list[float], first: float, step: float
) -> None:
    x = np.asarray(first + step * np.arange(len(values)), dtype=float)
    beyond = np.linspace(x[0] - step, x[-1] + step, 101)
    peer, own = interpolate.CubicSpline(x, values), CubicSpline.through(x, np.array(values))
    for order, found in enumerate(own.partials(beyond)):
        scale = max(np.abs(values).max(), 1e-9) / step**order
        assert found == pytest.approx(peer(beyond, order), abs=1e-7 * scale)
    assert own(beyond) == pytest.approx(own.partials(beyond)[0], abs=0)


@given(VALUES)
def test_the_values_are_met_on_the_grid(values: list[float]) -> None:
    x = np.linspace(0, 1, len(values))
    assert CubicSpline.through(x, np.array(values))(x) == pytest.approx(values, abs=1e-9)


def test_many_splines_at_once_are_each_alone() -> None:
    y = np.random.default_rng(0).normal(size=(9, 3, 2))
    assert cubic_pieces(0.5, y) == pytest.approx(interpolate.CubicSpline(0.5 * np.arange(9), y).c)
    assert cubic_pieces(0.5, y)[:, :, 1, 1] == pytest.approx(cubic_pieces(0.5, y[:, 1, 1]))


def test_it_is_the_bicubic_spline_with_all_its_derivatives() -> None:
    rng = np.random.default_rng(0)
    x, y = np.linspace(-3, 5, 14), np.linspace(0, 1, 9)
    values = rng.standard_normal((14, 9))
    own, peer = BicubicSpline.through(x, y, values), interpolate.RectBivariateSpline(x, y, values)
    at_x, at_y = rng.uniform(-4, 6, (2, 60)), rng.uniform(-0.2, 1.2, (2, 60))
    inside_x, inside_y = np.clip(at_x, x[0], x[-1]), np.clip(at_y, y[0], y[-1])
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    expected = [peer(inside_x, inside_y, dx=i, dy=j, grid=False) for i, j in orders]
    located = own.locate(at_y)
    for found, wanted in zip(own.by_both(at_x, located), expected, strict=True):
        assert found == pytest.approx(wanted, abs=1e-9 * (1 + np.abs(wanted).max()))
    assert own.value(at_x, located) == pytest.approx(expected[0], abs=1e-9)
    for found, order in zip(own.by_x(at_x, located), (0, 1, 3), strict=True):
        assert found == pytest.approx(expected[order], abs=1e-8)
    assert own.value(x[:, None], own.locate(y[None])) == pytest.approx(values)


def test_it_joins_smoothly_from_cell_to_cell() -> None:
    x = np.linspace(0, 1, 6)
    own = BicubicSpline.through(x, x, np.sin(3 * np.add.outer(x, 2 * x)))
    located = own.locate(np.full(4, 0.37))
    for below, above in zip(
        own.by_x(x[1:-1] - 1e-12, located), own.by_x(x[1:-1] + 1e-12, located), strict=True
    ):
        assert below == pytest.approx(above, abs=1e-8)
