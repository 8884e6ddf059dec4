"""The flight models against flights of the real autopilots in their simulators."""

import flights
import numpy as np
import pytest

Limits = tuple[float, float]
"""The greatest error of arrivals, s, and of positions, m, both rms."""


@pytest.mark.parametrize(
    ("folder", "path", "each", "uses"),
    [
        (
            "arducopter",
            0.6,
            {
                **dict.fromkeys(("in 3", "in 5"), (0.2, 1.0)),
                **dict.fromkeys(("in 6", "in 8"), (0.4, 1.5)),  # beyond the lean limit too
                "in 9": (1.4, 8.0),
                "": (0.3, 1.5),
            },
            dict.fromkeys(("fitted", "held out", "splines"), (0.2, 0.6)),
        ),
        (
            "arduplane",
            10.0,
            {"": (1.0, 12.0)},
            dict.fromkeys(
                ("fitted", "held out, sea", "held out, high", "in 3 m/s", "in 6 m/s"), (0.5, 6.5)
            ),
        ),
        (
            "px4",
            1.5,
            {"slow": (np.inf, np.inf), "": (1.3, 7.0)},
            {
                **dict.fromkeys(("fitted", "held out"), (0.5, 2.5)),
                **dict.fromkeys(("in 6 m/s", "in 9 m/s"), (0.55, 3.4)),
                "in 3 m/s": (0.7, 3.7),
            },
        ),
    ],
)
def test_flights_are_foreseen(
    folder: str, path: float, each: dict[str, Limits], uses: dict[str, Limits]
) -> None:
    """Check each flight, by its use, and all of a use together; and how far the path is off, m."""
    rows = flights.rows(folder)
    assert len(rows) == {"arducopter": 40, "arduplane": 43, "px4": 59}[folder]
    for row in rows:
        arrival, position = next(most for use, most in each.items() if row.use.startswith(use))
        assert row.arrival_rms <= arrival, row
        assert row.position_rms <= position, row
        assert row.path_error <= path, row
    for use, most in uses.items():
        arrival, position = flights.together(rows, use)
        assert arrival <= most[0], use
        assert position <= most[1], use
    made = [row for row in rows if row.name in flights.MADE]
    assert len(made) == (len(flights.MADE) if folder == "px4" else 0)
    if made:
        assert np.sqrt(np.mean([row.arrival_rms**2 for row in made])) <= 0.3
        assert np.sqrt(np.mean([row.position_rms**2 for row in made])) <= 1.6
