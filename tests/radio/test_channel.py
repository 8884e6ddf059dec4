import numpy as np
import pytest

from faao_mav.errors import InputError
from faao_mav.radio.channel import balanced_rayleigh, line_of_sight_ula, rayleigh, rician


def test_ula_agrees_with_the_positions_of_the_elements() -> None:
    wavelength = 1e-4
    east = np.array([0.5 * wavelength, 0.0, 0.0])
    transmitters = np.arange(2)[:, None] * east
    for path in np.array([[120.0, -40.0, 100.0], [70.0, -200.0, -100.0]]):
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
