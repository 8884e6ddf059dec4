"""The recorded exchanges that the mocks are held to are still those of the real autopilots."""

import sys
from pathlib import Path

import pytest
from simulators import KINDS

sys.path.insert(0, str(Path(__file__).parent.parent / "wire"))
from exchanges import recorded, renewed


@pytest.mark.parametrize("kind", KINDS)
def test_the_real_one_answers_as_recorded(kind: str, autopilots: Path, tmp_path: Path) -> None:
    for attempt in range(3):  # one that is starved of the processor repeats itself at other times
        (where := tmp_path / str(attempt)).mkdir()
        found = renewed(kind, autopilots, where)
        if found == recorded(kind).rstrip():
            break
    assert found == recorded(kind).rstrip()
