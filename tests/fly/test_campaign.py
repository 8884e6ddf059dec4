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


def test_the_trouble_is_of_all_kinds() -> None:
    trials = [Trial.of(seed) for seed in range(_FLIGHTS)]
    told = {*" ".join(map(str, trials)).replace(";", "").split()}
    assert {"loiter", "mission", "reboot", "companion", "station", "interrupt"} <= told
    assert {"silence", "jump", "stuck", "higher", "fenced", "low"} <= told
    assert any(not trial.may_start for trial in trials)
    assert {trial.kind for trial in trials} == {"ardupilot", "px4"}
