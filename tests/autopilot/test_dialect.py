"""What autopilots do with items; what is refused with a rule of its own is in `limits.tsv`."""

from pathlib import Path

import pytest
from judged import given

DATA = Path(__file__).parents[1] / "data" / "validate"


def test_what_is_kept_of_items() -> None:
    for line in (DATA / "stored.tsv").read_text().splitlines()[1:]:
        case, expected = map(given, line.split("\t"))
        (sent,), (kept,), dialect = case.items, expected.items, case.vehicle.type.dialect
        assert dialect.refusal(sent) is None, line
        stored = dialect.stored(sent)
        assert (stored.command, stored.frame) == (kept.command, kept.frame), line
        assert (stored.x, stored.y) == (kept.x, kept.y), line
        assert stored.numbers == pytest.approx(kept.numbers, abs=1e-5, nan_ok=True), line


def test_what_is_refused() -> None:
    for line in (DATA / "refused.tsv").read_text().splitlines()[1:]:
        words, told = line.split("\t")
        case = given(words)
        (item,) = case.items
        assert told in (case.vehicle.type.dialect.refusal(item) or "taken"), line
