"""Whatever a file holds, it is read or refused: briefly here, at length by `run.py`."""

import gc
from collections.abc import Iterator

import pytest
from harness import Target, fuzz, outcome
from targets import targets

_FENCES = ("fenced_plan", "kml", "geojson")
NAMES = (
    "plan",
    *_FENCES,
    "wpl",
    "qgc_plan",
    "parameters",
    "npz",
    "rows",
    "bin",
    "tlog",
    "ulg",
    "vary",
)
CASES = 300
"""Cases of each target in the suite; chosen: half a second."""


# pymavlink leaves a log open that it does not understand
pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")


@pytest.fixture
def found(targets_of_files: dict[str, Target]) -> Iterator[dict[str, Target]]:
    yield targets_of_files
    gc.collect()


@pytest.fixture(scope="module")
def targets_of_files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Target]:
    return targets(tmp_path_factory.mktemp("fuzz"))


def test_every_reader_is_fuzzed(found: dict[str, Target]) -> None:
    assert tuple(found) == NAMES
    for target in found.values():
        assert [outcome(target, seed) for seed in target.seeds] == [""] * len(target.seeds)


@pytest.mark.parametrize("name", NAMES)
def test_mutated_files_are_read_or_refused(found: dict[str, Target], name: str) -> None:
    counts = fuzz(found[name], CASES, seed=0)
    assert min(counts["read"], counts["refused"]) > CASES / 50


@pytest.mark.parametrize("name", NAMES)
def test_what_once_was_a_finding(found: dict[str, Target], name: str) -> None:
    for content in found[name].corpus:
        outcome(found[name], content)
