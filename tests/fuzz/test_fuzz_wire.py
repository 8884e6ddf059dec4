"""Whatever comes over the wire, both ends go on: briefly here, at length by `run.py`."""

import pytest
from harness import Target, fuzz, outcome
from tapes import datagrams
from wire_targets import wire_targets

CASES = {"client": 50, "mock_ardupilot": 20, "mock_px4": 10, "mock_px4_legacy_first": 5,
         "signed": 150}  # fmt: skip
"""Cases of each target in the suite; chosen: PX4's predicted flights take a second each."""


@pytest.fixture(scope="module")
def found() -> dict[str, Target]:
    return wire_targets()


def test_sound_tapes_are_heard_to_the_end(found: dict[str, Target]) -> None:
    assert found.keys() == CASES.keys()
    for target in found.values():
        assert [outcome(target, seed) for seed in target.seeds] == [""] * len(target.seeds)
        assert all(len(list(datagrams(seed))) >= 20 for seed in target.seeds)
    for seed in found["client"].seeds:
        assert found["client"].run(seed) == ["verified"] * 6  # three uploaded, three cleared


@pytest.mark.parametrize("name", CASES)
def test_mutated_tapes_end_nothing(found: dict[str, Target], name: str) -> None:
    counts = fuzz(found[name], CASES[name], seed=0)
    assert counts["read"] > CASES[name] / 10


@pytest.mark.parametrize("name", CASES)
def test_what_once_was_a_finding(found: dict[str, Target], name: str) -> None:
    for content in found[name].corpus:
        outcome(found[name], content)
