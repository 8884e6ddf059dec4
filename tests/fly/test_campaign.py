"""Flights that meet trouble at random: the first of those that `benchmarks/campaign.py` flies."""

import pytest
from trials import Trial, flown

_FLIGHTS = 30
"""How many are flown here; chosen: half a minute."""
_QUICK = 10
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
    incidents = {name for trial in trials for name in trial.incidents}
    assert {"pilot", "home", "reboot", "companion", "station", "glitch", "stuck"} <= incidents
    assert any(trial.moved for trial in trials)
    assert any(trial.faults.outages for trial in trials)
    assert {(trial.kind, trial.streams) for trial in trials} == {
        (kind, streams) for kind in ("ardupilot", "px4") for streams in (True, False)
    }
