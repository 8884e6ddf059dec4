"""The ArduCopter model against flights of a real ArduCopter in its simulator."""

from flights_arducopter import FITTED, HELD_OUT, IN_WIND, SPLINES, row
from recorded import together

CALM = (*FITTED, *HELD_OUT, *SPLINES)


def test_every_flight_is_predicted_in_time_and_place() -> None:
    assert len(CALM) == 18
    rows = [row(name) for name in CALM]
    for flight in rows:
        assert flight.arrival_rms <= 0.3, flight
        assert flight.position_rms <= 1.5, flight
        assert flight.path_error <= 0.6, flight
    for use in ("fitted", "held out", "splines"):
        arrival, position = together(rows, use)
        assert arrival <= 0.2
        assert position <= 0.6


def test_flights_in_wind_beyond_the_lean_limit_too() -> None:
    for wind, number, arrival, position in (
        ("wind3", 4, 0.2, 1.0),
        ("wind5", 1, 0.2, 1.0),
        ("wind6", 4, 0.4, 1.5),
        ("wind8", 1, 0.4, 1.5),
        ("wind9", 12, 1.4, 8.0),
    ):
        flights = [row(name) for name in IN_WIND if wind in name]
        assert len(flights) == number
        for flight in flights:
            assert flight.arrival_rms <= arrival, flight
            assert flight.position_rms <= position, flight
            assert flight.path_error <= 0.6, flight
