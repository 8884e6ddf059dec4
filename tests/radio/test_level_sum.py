"""Sums of Gaussians over evenly spaced levels, beside their terms one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.radio.level_sum import level_sum


@given(
    half=st.integers(1, 8),
    odd=st.booleans(),
    spacing=st.floats(0.01, 10.0),
    strength=st.floats(0.0, 1500.0),  # E m²: sums are formed in another way above 600
    places=st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=6),
    triangular=st.booleans(),
)
def test_the_sum_is_that_of_its_terms(
    half: int, odd: bool, spacing: float, strength: float, places: list[float], triangular: bool
) -> None:
    number = 2 * half + odd
    levels = np.asarray(spacing * (np.arange(number) - (number - 1) / 2), dtype=np.float64)
    counts = np.ones(number)
    if triangular:  # as differences have them
        counts = np.minimum(1.0 + np.arange(number), number - np.arange(number))
    t = levels[-1] * np.array(places)
    energy = np.array([strength / levels[-1] ** 2])
    terms = counts * np.exp(-energy * (t[:, None] - levels) ** 2)
    np.testing.assert_allclose(
        level_sum(t, levels, counts, energy), terms.sum(axis=1), rtol=1e-10, atol=1e-250
    )


def test_rows_have_their_own_energies() -> None:
    t, energy = np.array([[0.3, -2.0], [0.3, 5.0]]), np.array([[2.0], [0.0]])
    found = level_sum(t, np.array([-1.0, 0.0, 1.0]), np.array([1.0, 2.0, 1.0]), energy)
    assert found[1].tolist() == [4.0, 4.0]
    one, none, other = (np.exp(-2.0 * (t[0] - level) ** 2) for level in (-1.0, 0.0, 1.0))
    assert found[0] == pytest.approx(one + 2.0 * none + other)
