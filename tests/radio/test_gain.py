"""The law of the path gain, its values and derivatives; the splines of maps are those of scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import interpolate

from faao_mav.radio.gain import GainField, PathGain
from faao_mav.radio.spline import Spline

TERMS = st.lists(st.floats(-40, 40), max_size=3).map(tuple)
LAWS = st.builds(PathGain, st.just(1e-5), st.floats(0, 6), TERMS)
HEIGHTS = st.floats(-300, 300).filter(lambda H: abs(H) > 1)


@given(LAWS, HEIGHTS, st.floats(0, 1e4))
def test_decibels_are_those_of_the_formula(law: PathGain, H: float, r: float) -> None:
    d = np.hypot(r, H)
    terms = sum(c * (H / d) ** k for k, c in enumerate(law.elevation_db, 1))
    expected = -50 - 10 * law.exponent * np.log10(d) + terms
    assert law.db(np.array(r), H) == pytest.approx(expected, abs=1e-9)
    gain = GainField(law, np.zeros(2), H).gain(np.array([[r], [0.0]]))
    assert 10 * np.log10(gain) == pytest.approx(expected, abs=1e-9)


@given(LAWS, HEIGHTS, st.floats(-3, 3), st.floats(-3, 3))
def test_slopes_are_those_of_differences(law: PathGain, H: float, x: float, y: float) -> None:
    """In units of the height, on which the law changes."""
    away, h = abs(H) * np.array([x, y]), 1e-4 * abs(H)
    steps = h * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"))
    at = away[:, None, None] + steps
    field = GainField(law, np.zeros(2), H)
    f = field.log(at)
    gradient, hessian = field.slopes(at)
    scale = 1 + law.exponent + sum(map(abs, law.elevation_db))
    expected = [(f[2, 1] - f[0, 1]) / 2, (f[1, 2] - f[1, 0]) / 2]
    np.testing.assert_allclose(h * gradient[:, 1, 1], expected, atol=1e-10 * scale)
    by_x, by_y = gradient[:, 2, 1] - gradient[:, 0, 1], gradient[:, 1, 2] - gradient[:, 1, 0]
    bent = h * np.array([by_x[0], by_y[0], by_y[1]]) / 2
    np.testing.assert_allclose(h**2 * hessian[:, 1, 1], bent, atol=1e-12 * scale)


@given(LAWS, HEIGHTS, st.floats(0.1, 1e4))
def test_no_gain_is_beyond_those_at_the_turns(law: PathGain, H: float, farthest: float) -> None:
    turns = law.turns(farthest, H)
    r = np.concatenate([np.linspace(0, far, 500) for far in (farthest, min(farthest, 9 * abs(H)))])
    every, extreme = law.db(r, H), law.db(turns, H)
    assert every.max() <= extreme.max() + 1e-9
    assert every.min() >= extreme.min() - 1e-9


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
