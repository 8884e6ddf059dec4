"""The map of what a law leaves, on fields that are known."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from faao_mav.arrays import Real
from faao_mav.radio.fit import Samples, fit_link
from faao_mav.radio.kriging import kriged
from faao_mav.radio.spline import Spline

SIDE = np.arange(-400.0, 401.0, 10.0)
STATION = (47.0, 8.0, 5.0)


def field(seed: int, spread: float) -> Spline:
    """A smooth field of shadowing over the map, correlated over some 80 m."""
    noise = np.random.default_rng(seed).standard_normal((len(SIDE), len(SIDE)))
    smooth = gaussian_filter(noise, 5.0)
    return Spline.through(SIDE, SIDE, spread * smooth / smooth.std())


def flight(shadow: Spline, noise: float) -> Samples:
    """Legs east and west, 40 m apart, 60 m above the antenna, past it and about it."""
    t = np.arange(0.0, 600.0)
    leg, along = np.divmod(10.0 * t, 600.0)
    x = np.where(leg % 2 == 0, along - 300.0, 300.0 - along)
    place = np.stack([x, 40.0 * leg - 200.0, np.full_like(t, 60.0)], axis=1)
    level = -45.0 - 20 * np.log10(np.linalg.norm(place, axis=1)) + shadow.value(x, place[:, 1])
    return Samples(t, place, level + noise * np.random.default_rng(9).standard_normal(len(t)))


def off(shadow: Spline, value: Real, x: Real, y: Real) -> float:
    return float(np.sqrt(np.mean((shadow.value(x, y) - value) ** 2)))


def test_a_field_between_the_legs_is_told_and_nothing_far_away() -> None:
    shadow = field(1, 4.0)
    fit = fit_link([flight(shadow, 1.0)], 1.0)
    found, alone, error = kriged(fit, STATION)
    assert found is not None
    assert error < 0.8 * alone
    x, y = np.meshgrid(np.linspace(-280, 280, 30), np.arange(-180.0, 180.0, 40.0))
    law = fit.gain_db(np.stack([x, y, np.full_like(x, 60.0)], axis=-1))
    true = -45.0 - 10 * np.log10(x**2 + y**2 + 60.0**2)
    assert off(shadow, found.at(60.0).value(x, y) + law - true, x, y) < 0.5 * 4.0
    far = found.at(60.0).value(np.array([2000.0]), np.array([0.0]))
    assert far == pytest.approx(0, abs=1e-9)
    assert (found.origin, found.above_law) == ((47.0, 8.0), True)
    assert found.heights[0] <= 60 <= found.heights[-1]


def test_where_what_is_left_is_seen_once_there_is_no_map() -> None:
    found, alone, error = kriged(fit_link([flight(field(4, 1e-9), 3.0)], 1.0), STATION)
    assert error > 0.97 * alone
    if found is not None:
        assert np.abs(found.db).max() < 3.0
