"""Channels, and the classical precoders: shapes, powers, limits and conditions of optimality."""

from itertools import product

import numpy as np
import pytest
from closed_forms import channel, power_of
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.arrays import RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio.channel import balanced_rayleigh, line_of_sight_ula, rayleigh, rician
from faao_mav.radio.precoder import SCHEMES, mmse, mrt, waterfilling, zf

SHAPES = [(1, 1), (2, 2), (3, 3), (1, 2), (2, 3), (2, 1), (4, 2), (3, 2)]


def parallel(A: RealOrComplex, B: RealOrComplex) -> None:
    """A and B are equal up to a positive factor."""
    np.testing.assert_allclose(A / np.linalg.norm(A), B / np.linalg.norm(B), atol=1e-9)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_shape_power_batches_and_singular_channels(scheme: str) -> None:
    for (receive, transmit), scale in product(SHAPES, (1e-8, 1.0, 1e5)):
        H = scale * channel(1, 3, 4, receive, transmit)
        P = SCHEMES[scheme](H, 0.1, 1e-3)
        assert P.shape == (3, 4, transmit, transmit)
        assert P.dtype == np.complex128
        np.testing.assert_allclose(power_of(P), 0.1, rtol=1e-12)
        np.testing.assert_allclose(SCHEMES[scheme](H[1, 2], 0.1, 1e-3), P[1, 2], atol=1e-12)
    H = np.array([[[1.0, 1.0], [1.0, 1.0]], [[1.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]])
    P = SCHEMES[scheme](H, 2.0, 1.0)
    assert np.all(np.isfinite(P))
    np.testing.assert_allclose(power_of(P), 2.0, rtol=1e-12)
    # nothing goes where the channel leads nowhere
    np.testing.assert_allclose(H[0] @ P[0] @ (H[0] @ P[0]).conj().T, 4.0 * np.ones((2, 2)))
    np.testing.assert_allclose(np.abs(P[2]), np.eye(2), atol=1e-12)


def test_mmse_lies_between_maximum_ratio_and_zero_forcing() -> None:
    for receive, transmit in SHAPES:
        H = channel(5, receive, transmit)
        np.testing.assert_allclose(mmse(H, 2.0, 1e-12), zf(H, 2.0, 1.0), atol=1e-8)
        np.testing.assert_allclose(mmse(H, 2.0, 1e12), mrt(H, 2.0, 1.0), atol=1e-8)
        if receive == transmit:
            inverse = np.linalg.inv(H @ H.conj().T + receive * 0.7 / 2.0 * np.eye(receive))
            parallel(mmse(H, 2.0, 0.7), H.conj().T @ inverse)
        if receive <= transmit:  # zero forcing makes the link diagonal
            link = H @ zf(H, 3.0, 1.0)
            expected = np.zeros((receive, transmit))
            np.fill_diagonal(expected, link[0, 0].real)
            np.testing.assert_allclose(link, expected, atol=1e-10)
            assert link[0, 0].real > 0.0
    # With more receiving antennas, the link is orthogonal: no stream disturbs another.
    link = (H := channel(3, 4, 2)) @ zf(H, 3.0, 1.0)
    parallel(link.conj().T @ link, np.eye(2))


def test_what_is_refused() -> None:
    for scheme in SCHEMES.values():
        with pytest.raises(InputError, match="power"):
            scheme(np.eye(2), 0.0, 1.0)
    for scheme in (mmse, waterfilling):
        with pytest.raises(InputError, match="noise"):
            scheme(np.eye(2), 1.0, 0.0)


@given(st.integers(0, 10_000), st.sampled_from(SHAPES), st.floats(-3.0, 4.0))
def test_waterfilling_meets_the_optimality_conditions(
    seed: int, shape: tuple[int, int], exponent: float
) -> None:
    H, power, noise = channel(seed, *shape), 2.0, 10.0**-exponent
    P = waterfilling(H, power, noise)
    _, s, Vh = np.linalg.svd(H)
    modes = Vh @ P
    p = np.sum(np.abs(modes) ** 2, axis=1)
    np.testing.assert_allclose(np.abs(modes), np.diag(np.sqrt(p)), atol=1e-9)
    assert p.sum() == pytest.approx(power)
    floor = noise / s**2
    used = p[: len(s)] > 1e-12
    level = (p[: len(s)] + floor)[used]
    np.testing.assert_allclose(level, level[0], rtol=1e-9)
    assert np.all(floor[~used] >= level[0] * (1 - 1e-9))


def test_arrays_agree_with_the_positions_of_their_elements() -> None:
    wavelength = 1e-4
    east = np.array([0.5 * wavelength, 0.0, 0.0])
    transmitters = np.arange(2)[:, None] * east
    for path in np.array([[120.0, -40.0, 100.0], [70.0, -200.0, -100.0]]):
        receivers = path + np.arange(3)[:, None] * east
        way = np.linalg.norm(receivers[:, None] - transmitters, axis=-1)
        expected = np.exp(-2j * np.pi * (way - way[0, 0]) / wavelength)
        H = line_of_sight_ula(path[0] / np.linalg.norm(path), 3, 2)
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
    fewer = balanced_rayleigh(np.random.default_rng(3), 3, 2, 3)  # too few for the rotations
    scaled = fewer / rayleigh(np.random.default_rng(3), 3, 2, 3)
    assert np.abs(scaled - scaled[0, 0, 0]).max() < 1e-12


def test_rician_limits() -> None:
    nlos = rayleigh(np.random.default_rng(5), 4, 2, 2)
    los = np.ones((2, 2))
    np.testing.assert_array_equal(rician(los, nlos, np.inf), np.broadcast_to(los, nlos.shape))
    np.testing.assert_array_equal(rician(los, nlos, 0.0), nlos)
    for wrong in (-1.0, np.nan):
        with pytest.raises(InputError, match="Rician"):
            rician(los, nlos, wrong)
