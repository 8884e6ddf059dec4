"""The ArduPlane model against flights of a real ArduPlane in its simulator."""

import pytest
from flights_arduplane import FITTED, HELD_OUT, row
from recorded import Row, together


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return [row(name) for name in (*FITTED, *HELD_OUT)]


def test_every_flight_is_predicted_in_time_and_place(rows: list[Row]) -> None:
    assert len(rows) >= 24
    assert len(HELD_OUT) >= len(rows) / 3
    for flight in rows:
        assert flight.arrival_rms <= 1.0, flight
        assert flight.position_rms <= 12, flight
        assert flight.path_error <= 10, flight


@pytest.mark.parametrize(
    ("use", "seconds", "metres"),
    [
        ("fitted", 0.45, 6),
        ("held out, sea", 0.4, 6),
        ("held out, high", 0.5, 6.5),
        ("in 3 m/s", 0.5, 6.5),
        ("in 6 m/s", 0.4, 6),
    ],
)
def test_flights_together(rows: list[Row], use: str, seconds: float, metres: float) -> None:
    arrival, position = together(rows, use)
    assert arrival <= seconds
    assert position <= metres
