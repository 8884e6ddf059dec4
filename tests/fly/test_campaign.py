"""Flights that meet trouble at random: the first of those that `benchmarks/campaign.py` flies."""

import pytest
from trials import Trial, flown

_FLIGHTS = 30
"""How many are flown here; chosen: half a minute."""
_QUICK = 6
"""How many of them whenever the tests are run."""


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(seed, marks=[] if seed < _QUICK else [pytest.mark.slow])
        for seed in range(_FLIGHTS)
    ],
)
def test_in_no_trouble_what_must_not_happen_does(seed: int) -> None:
    assert flown(Trial.of(seed)).wrong == []
