"""The law of the path gain: its values, its derivatives by place, and its extremes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.radio.gain import PathGain

TERMS = st.lists(st.floats(-40, 40), max_size=3).map(tuple)
LAWS = st.builds(PathGain, st.just(1e-5), st.floats(0, 6), TERMS)
HEIGHTS = st.floats(-300, 300).filter(lambda H: abs(H) > 1)


@given(LAWS, HEIGHTS, st.floats(0, 1e4))
def test_decibels_are_those_of_the_formula(law: PathGain, H: float, r: float) -> None:
    d = np.hypot(r, H)
    terms = sum(c * (H / d) ** k for k, c in enumerate(law.elevation_db, 1))
    expected = -50 - 10 * law.exponent * np.log10(d) + terms
    assert law.db(np.array(r), H) == pytest.approx(expected, abs=1e-9)
    gain = law.gain(np.array(d**2), H)
    assert 10 * np.log10(gain) == pytest.approx(expected, abs=1e-9)


@given(LAWS, HEIGHTS, st.floats(-3, 3), st.floats(-3, 3))
def test_slopes_are_those_of_differences(law: PathGain, H: float, x: float, y: float) -> None:
    """In units of the height, on which the law changes."""
    away, h = abs(H) * np.array([x, y]), 1e-4 * abs(H)
    steps = h * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"))
    at = away[:, None, None] + steps
    squared = np.sum(at**2, axis=0) + H**2
    f = law.log(squared, H)
    gradient, hessian = law.slopes(at, squared, H)
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
    assert law.db(np.array(law.best_distance(farthest, H)), H) == extreme.max()
