import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.radio.channel import (
    balanced_rayleigh,
    line_of_sight_ula,
    rayleigh,
    rician,
)

ANGLES = st.floats(-1e3, 1e3).filter(lambda x: abs(x) > 1.0)


def displacement(w: Real, p: Real, altitude: float) -> Real:
    """The vector from a station at p to the UAV at w, (3,) m east, north, up."""
    return np.array([*(w - p), altitude])


@settings(deadline=None, derandomize=True)
@given(ANGLES, ANGLES)
def test_ula_links_are_reciprocal(x: float, y: float) -> None:
    up = displacement(np.array([x, y]), np.zeros(2), 100.0)
    np.testing.assert_allclose(
        line_of_sight_ula(-up, 2, 3), line_of_sight_ula(up, 3, 2).T, rtol=1e-12
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("horizontal", [(120.0, -40.0), (-70.0, 200.0)])
def test_ula_agrees_with_the_positions_of_the_elements(
    sign: float, horizontal: tuple[float, float]
) -> None:
    wavelength = 1e-4
    path = sign * displacement(np.array(horizontal), np.zeros(2), 100.0)
    east = np.array([0.5 * wavelength, 0.0, 0.0])
    transmitters = np.arange(2)[:, None] * east
    receivers = path + np.arange(3)[:, None] * east
    way = np.linalg.norm(receivers[:, None] - transmitters, axis=-1)
    expected = np.exp(-2j * np.pi * (way - way[0, 0]) / wavelength)
    H = line_of_sight_ula(path, 3, 2)
    np.testing.assert_allclose(H, expected, atol=1e-4)
    assert np.abs(H - expected.conj()).max() > 0.5  # the other sign would not pass


def test_rayleigh_has_unit_power_and_repeats() -> None:
    H = rayleigh(np.random.default_rng(3), 5000, 2, 3)
    assert H.shape == (5000, 2, 3)
    assert np.mean(np.abs(H) ** 2) == pytest.approx(1.0, abs=0.02)
    assert abs(np.mean(H**2)) < 0.02  # circular
    np.testing.assert_array_equal(H, rayleigh(np.random.default_rng(3), 5000, 2, 3))
    few = balanced_rayleigh(np.random.default_rng(3), 4, 2, 3)
    assert np.abs(few.mean(axis=0)).max() < 1e-12
    assert np.mean(np.abs(few) ** 2) == pytest.approx(1.0)


def test_rician_limits() -> None:
    nlos = rayleigh(np.random.default_rng(5), 4, 2, 2)
    los = np.ones((2, 2))
    np.testing.assert_array_equal(rician(los, nlos, np.inf), np.broadcast_to(los, nlos.shape))
    np.testing.assert_array_equal(rician(los, nlos, 0.0), nlos)
    for wrong in (-1.0, np.nan):
        with pytest.raises(InputError, match="Rician"):
            rician(los, nlos, wrong)
