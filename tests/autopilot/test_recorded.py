"""The flight models against flights of the real autopilots in their simulators."""

import flights
import numpy as np
import pytest

ROWS = [row.split("\t") for row in (flights.FLIGHTS / "limits.tsv").read_text().splitlines()[1:]]


@pytest.mark.parametrize(
    ("folder", "count", "path"),
    [("arducopter", 40, 0.6), ("arduplane", 43, 10.0), ("px4", 59, 1.5)],
)
def test_flights_are_foreseen(folder: str, count: int, path: float) -> None:
    """Within the limits of the table, and the path off by so many metres at most."""
    rows, limits = flights.rows(folder), [row[1:] for row in ROWS if row[0] == folder]
    assert len(rows) == count
    each = [(use, float(s), float(m)) for kind, use, s, m in limits if kind == "each"]
    for row in rows:
        arrival, position = next(most for use, *most in each if row.use.startswith(use))
        assert row.arrival_rms <= arrival, row
        assert row.position_rms <= position, row
        assert row.path_error <= path, row
    for use, s, m in (rest for kind, *rest in limits if kind == "together"):
        arrival, position = flights.together(rows, use)
        assert arrival <= float(s), use
        assert position <= float(m), use
    made = [row for row in rows if row.name in flights.MADE]
    assert len(made) == (len(flights.MADE) if folder == "px4" else 0)
    if made:
        assert np.sqrt(np.mean([row.arrival_rms**2 for row in made])) <= 0.3
        assert np.sqrt(np.mean([row.position_rms**2 for row in made])) <= 1.6
