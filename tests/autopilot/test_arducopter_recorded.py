"""The ArduCopter model against flights of a real ArduCopter in its simulator."""

import pytest
from flights_arducopter import FITTED, HELD_OUT, IN_WIND, SPLINES, row
from recorded import Row, together


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return [row(name) for name in (*FITTED, *HELD_OUT)]


def test_every_flight_over_plain_waypoints_is_compared() -> None:
    assert len(FITTED) + len(HELD_OUT) == 15


def test_every_flight_is_predicted_in_time_and_place(rows: list[Row]) -> None:
    for flight in rows:
        assert flight.arrival_rms <= 0.15, flight
        assert flight.position_rms <= 1.0, flight
        assert flight.path_error <= 0.6, flight


def test_splines_are_predicted_more_roughly() -> None:
    for name in SPLINES:
        flight = row(name)
        assert flight.arrival_rms <= 0.25, flight
        assert flight.position_rms <= 0.8, flight
        assert flight.path_error <= 0.6, flight


@pytest.mark.parametrize(
    ("wind", "number", "arrival", "position"),
    [
        ("wind3", 4, 0.2, 0.7),
        ("wind5", 1, 0.2, 0.7),
        ("wind6", 4, 0.4, 1.5),
        ("wind8", 1, 0.3, 0.8),
        ("wind9", 12, 1.2, 7.0),
    ],
)
def test_flights_in_wind_beyond_the_lean_limit_too(
    wind: str, number: int, arrival: float, position: float
) -> None:
    flights = [row(name) for name in IN_WIND if wind in name]
    assert len(flights) == number
    for flight in flights:
        assert flight.arrival_rms <= arrival, flight
        assert flight.position_rms <= position, flight
        assert flight.path_error <= 0.6, flight


@pytest.mark.parametrize("use", ["fitted", "held out"])
def test_flights_together(rows: list[Row], use: str) -> None:
    arrival, position = together(rows, use)
    assert arrival <= 0.12
    assert position <= 0.6
