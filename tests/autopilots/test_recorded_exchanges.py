"""The recorded exchanges that the mocks are held to are still those of the real autopilots."""

import sys
from pathlib import Path

import pytest
from simulators import KINDS

sys.path.insert(0, str(Path(__file__).parent.parent / "mavlink"))
from exchanges import recorded, renewed


@pytest.mark.parametrize("kind", KINDS)
def test_the_real_one_answers_as_recorded(kind: str, autopilots: Path, tmp_path: Path) -> None:
    assert renewed(kind, autopilots, tmp_path) == recorded(kind).rstrip()
