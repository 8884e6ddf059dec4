"""The flight models against flights of the real autopilots in their simulators."""

import flights_arducopter as arducopter
import flights_arduplane as arduplane
import numpy as np
import pytest
from flight_paths import line, path_of
from flights_px4 import rows as px4_rows
from record_px4 import CONVERTED
from recorded import Row, together

from faao_mav.autopilot.px4 import Px4

Limits = tuple[float, float]
"""The greatest error of arrivals, s, and of positions, m, both rms."""


def check(flights: list[Row], each: Limits, path: float, uses: dict[str, Limits]) -> None:
    """Check the errors of every flight, the greatest of its path, m, and of all of a use."""
    for flight in flights:
        assert flight.arrival_rms <= each[0], flight
        assert flight.position_rms <= each[1], flight
        assert flight.path_error <= path, flight
    for use, most in uses.items():
        arrival, position = together(flights, use)
        assert arrival <= most[0], use
        assert position <= most[1], use


def test_arducopter() -> None:
    calm = (*arducopter.FITTED, *arducopter.HELD_OUT, *arducopter.SPLINES)
    assert len(calm) == 18
    flights = [arducopter.row(name) for name in calm]
    check(flights, (0.3, 1.5), 0.6, dict.fromkeys(("fitted", "held out", "splines"), (0.2, 0.6)))
    for wind, number, limits in (
        ("wind3", 4, (0.2, 1.0)),
        ("wind5", 1, (0.2, 1.0)),
        ("wind6", 4, (0.4, 1.5)),  # beyond the lean limit too
        ("wind8", 1, (0.4, 1.5)),
        ("wind9", 12, (1.4, 8.0)),
    ):
        flights = [arducopter.row(name) for name in arducopter.IN_WIND if wind in name]
        assert len(flights) == number
        check(flights, limits, 0.6, {})


def test_arduplane() -> None:
    flights = [arduplane.row(name) for name in (*arduplane.FITTED, *arduplane.HELD_OUT)]
    assert len(flights) >= 24
    assert len(arduplane.HELD_OUT) >= len(flights) / 3
    uses = ("fitted", "held out, sea", "held out, high", "in 3 m/s", "in 6 m/s")
    check(flights, (1.0, 12), 10, dict.fromkeys(uses, (0.5, 6.5)))


def test_px4() -> None:
    """Wind changes nothing within the lean limit."""
    flights = px4_rows()
    assert sum(flight.use == "in wind" for flight in flights) == 12
    calm = {"fitted": (0.5, 2.5), "held out": (0.5, 2.5)}
    kept = [flight for flight in flights if flight.use != "slow"]
    check(kept, (1.3, 7), 1.5, {**calm, "in wind": (0.55, 3.4)})
    assert all(flight.path_error <= 1.5 for flight in flights)
    made = [flight for flight in flights if flight.name in CONVERTED]
    assert np.sqrt(np.mean([flight.arrival_rms**2 for flight in made])) <= 0.3
    assert np.sqrt(np.mean([flight.position_rms**2 for flight in made])) <= 1.6


# What PX4 flew in other missions, none of them used for fitting: mean speeds on straight lines
# and circles at 8 m/s, slowest speeds at corners.


def test_mean_speeds_by_spacing() -> None:
    for spacing, measured in ((2, 1.5), (3, 1.9), (5, 2.9), (10, 4.8), (20, 7.5), (80, 7.7)):
        legs = 8 + round(200 / spacing)
        arrivals = Px4().fly(line(spacing, legs)).arrivals
        speed = spacing / np.diff(arrivals[legs // 4 : 3 * legs // 4 + 1]).mean()
        assert speed == pytest.approx(measured, rel=0.04)
    for spacing, measured in ((5, 2.8), (10, 4.5), (20, 4.9)):
        legs = round(2 * np.pi * 60 / spacing)
        path = path_of(list(60 * np.exp(2j * np.pi * np.arange(legs + 1) / legs)))
        arrivals = Px4().fly(path).arrivals
        speed = spacing / np.diff(arrivals[legs // 4 : 3 * legs // 4 + 1]).mean()
        assert speed == pytest.approx(measured, rel=0.08)


def test_slowest_speed_at_a_corner() -> None:
    """Rough: the model is slower at the slowest point, by 0.1 to 0.6 m/s."""
    for degrees, measured in ((30, 3.6), (60, 2.1), (90, 1.8), (135, 0.9), (180, 0.15)):
        flown = Px4().fly(path_of([0, 100, 100 + 100 * np.exp(1j * np.radians(degrees))]))
        about = abs(flown.t - flown.arrivals[1]) < 5
        slowest = np.linalg.norm(flown.velocity[about], axis=1).min()
        assert slowest == pytest.approx(measured, abs=0.7)
