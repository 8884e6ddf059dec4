"""The table of polynomials against FITPACK's bicubic spline."""

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from faao_mav.optimizer.rates.bicubic import Bicubic


def test_it_is_the_bicubic_spline_with_all_its_derivatives() -> None:
    rng = np.random.default_rng(0)
    x, y = np.linspace(-3, 5, 14), np.linspace(0, 1, 9)
    values = rng.standard_normal((14, 9))
    own, peer = Bicubic.through(x, y, values), RectBivariateSpline(x, y, values)
    at_x, at_y = rng.uniform(-4, 6, (2, 60)), rng.uniform(-0.2, 1.2, (2, 60))
    inside_x, inside_y = np.clip(at_x, x[0], x[-1]), np.clip(at_y, y[0], y[-1])
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    expected = [peer(inside_x, inside_y, dx=i, dy=j, grid=False) for i, j in orders]
    rows = own.rows(at_y)
    for found, wanted in zip(own.by_both(at_x, rows), expected, strict=True):
        assert found == pytest.approx(wanted, abs=1e-9 * (1 + np.abs(wanted).max()))
    assert own.value(at_x, rows) == pytest.approx(expected[0], abs=1e-9)
    for found, order in zip(own.by_x(at_x, rows), (0, 1, 3), strict=True):
        assert found == pytest.approx(expected[order], abs=1e-8)
    assert own.value(x[:, None], own.rows(y[None])) == pytest.approx(values)


def test_it_joins_smoothly_from_cell_to_cell() -> None:
    x = np.linspace(0, 1, 6)
    own = Bicubic.through(x, x, np.sin(3 * np.add.outer(x, 2 * x)))
    rows = own.rows(np.full(4, 0.37))
    for below, above in zip(
        own.by_x(x[1:-1] - 1e-12, rows), own.by_x(x[1:-1] + 1e-12, rows), strict=True
    ):
        assert below == pytest.approx(above, abs=1e-8)
