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


def test_flights_together(rows: list[Row]) -> None:
    for use in ("fitted", "held out, sea", "held out, high", "in 3 m/s", "in 6 m/s"):
        arrival, position = together(rows, use)
        assert arrival <= 0.5
        assert position <= 6.5
