"""Whatever a file holds or the wire brings, it is read or refused.

`FAAO_CASES=50000 pytest -n 3 tests/fuzz` tries as many cases of each; `-k` chooses some.
"""

import gc
import os
from collections.abc import Iterator

import pytest
from harness import Target, fuzz, outcome
from targets import targets
from wire_targets import datagrams, wire_targets

FILES = ("plan", "fenced_plan", "gain", "rates", "kml", "geojson", "wpl", "qgc_plan", "parameters",
         "map", "map_table", "npz", "rows", "bin", "tlog", "ulg", "vary")  # fmt: skip
TAPES = {"client": 10, "mock_ardupilot": 6, "mock_px4": 4}
SLOW = dict.fromkeys(("bin", "tlog", "ulg", "npz", "gain", "rates", "vary"), 30)
CASES = dict.fromkeys(FILES, 60) | SLOW | TAPES
"""Cases of each target in the suite; chosen: an eighth of a second."""

# pymavlink leaves a log open that it does not understand
pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Target]]:
    yield targets(tmp_path_factory.mktemp("fuzz")) | wire_targets()
    gc.collect()


def test_what_is_sound_is_read_to_the_end(found: dict[str, Target]) -> None:
    assert found.keys() == CASES.keys()
    for target in found.values():
        assert [outcome(target, seed) for seed in target.seeds] == [""] * len(target.seeds)
    for name in TAPES:
        assert all(len(list(datagrams(seed))) >= 20 for seed in found[name].seeds)
    for seed in found["client"].seeds:
        assert found["client"].run(seed) == ["verified"] * 5  # three uploaded, two cleared


@pytest.mark.parametrize("name", CASES)
def test_what_is_mutated_is_read_or_refused(found: dict[str, Target], name: str) -> None:
    for content in found[name].corpus:  # what once was a finding
        outcome(found[name], content)
    cases = int(os.environ.get("FAAO_CASES", CASES[name]))
    counts = fuzz(found[name], cases)
    assert counts["read"] > (cases / 10 if name in TAPES else 0)
    assert counts["refused"] or name in TAPES
