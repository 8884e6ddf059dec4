"""The splines on even grids are those of scipy: CubicSpline and FITPACK's bicubic spline."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import interpolate

from faao_mav.radio.spline import Spline

VALUES = st.lists(st.floats(-100, 100), min_size=4, max_size=30)
NOWHERE = np.zeros(1)


@given(VALUES, st.floats(-50, 50), st.floats(0.01, 10))
def test_a_curve_is_the_cubic_spline_with_its_derivatives(
    values: list[float], first: float, step: float
) -> None:
    x = np.asarray(first + step * np.arange(len(values)), dtype=float)
    y = np.array(values)[:, None]
    own, peer = Spline.through(x, NOWHERE, y), interpolate.CubicSpline(x, values)
    at = np.linspace(x[0] - step, x[-1] + step, 101)
    inside = np.clip(at, x[0], x[-1])
    for order, found in enumerate(own.by_x(at, 0 * at)):
        scale = max(np.abs(values).max(), 1e-9) / step**order
        assert found == pytest.approx(peer(inside, order), abs=1e-7 * scale)
    assert own.value(at, 0 * at) == pytest.approx(own.by_x(at, 0 * at)[0], abs=0)
    f, f_x, f_y, f_xx, f_xy, f_yy = own.by_both(at, 0 * at)
    assert np.array_equal([f, f_x, f_xx], own.by_x(at, 0 * at))
    assert not np.any([f_y, f_xy, f_yy])


def test_it_is_the_bicubic_spline_with_all_its_derivatives() -> None:
    rng = np.random.default_rng(0)
    x, y = np.linspace(-3, 5, 14), np.linspace(0, 1, 9)
    values = rng.standard_normal((14, 9))
    own, peer = Spline.through(x, y, values), interpolate.RectBivariateSpline(x, y, values)
    at_x, at_y = rng.uniform(-4, 6, (2, 60)), rng.uniform(-0.2, 1.2, (2, 60))
    inside_x, inside_y = np.clip(at_x, x[0], x[-1]), np.clip(at_y, y[0], y[-1])
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    expected = [peer(inside_x, inside_y, dx=i, dy=j, grid=False) for i, j in orders]
    for found, wanted in zip(own.by_both(at_x, at_y), expected, strict=True):
        assert found == pytest.approx(wanted, abs=1e-9 * (1 + np.abs(wanted).max()))
    assert own.value(at_x, at_y) == pytest.approx(expected[0], abs=1e-9)
    for found, order in zip(own.by_x(at_x, at_y), (0, 1, 3), strict=True):
        assert found == pytest.approx(expected[order], abs=1e-8)
    assert own.value(x[:, None], y[None]) == pytest.approx(values)
