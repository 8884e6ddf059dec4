"""The ArduCopter model against recorded flights."""

import flights
import pytest


@pytest.mark.parametrize("name", flights.NAMES)
def test_recorded_flights_are_predicted(name: str) -> None:
    found = flights.row(name)
    most = {"fitted": 0.3, "held out": 0.5, "spline": 1.0}[found.kind]
    assert found.arrivals <= most
    assert found.position <= (2.5 if found.kind == "spline" else 2.0)


def test_all_recorded_flights_are_there() -> None:
    assert len(flights.NAMES) == 18
    assert set(flights.HELD_OUT) < set(flights.NAMES)
