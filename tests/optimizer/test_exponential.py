"""Merging and shrinking of exponential terms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.optimizer.algorithm1.exponential import CAP, merge_equal, shrink

ROWS = st.lists(st.sampled_from([0.0, 1.0, 1.5, 40.0]), min_size=4, max_size=4)


@given(st.lists(ROWS, min_size=1))
def test_merged_terms_have_the_same_sum(rows: list[list[float]]) -> None:
    c, multiplicity = np.array(rows), np.array([1.0, 2.0, 4.0, 8.0])
    slot, merged, weight = merge_equal(c, multiplicity)
    total = np.bincount(slot, weights=weight * np.exp(-merged), minlength=len(c))
    assert total == pytest.approx(np.exp(-c) @ multiplicity)
    assert len(merged) == sum(len(set(row)) for row in rows)


@given(st.floats(0, 1e6), st.floats(-3, 5))
def test_a_shrunk_term_stays_an_upper_bound(c: float, relative: float) -> None:
    """For an exponent worth c at the point of expansion and `relative` c elsewhere."""
    factor = float(shrink(np.array(c)))
    true = min(1.0, np.exp(-max(0.0, relative * c)))
    assert np.exp(-relative * c * factor) >= true * (1 - 1e-12)
    assert np.exp(-c * factor) - np.exp(-c) <= np.exp(-CAP)
