"""Closed forms that the tests hold the package to, and channels to hold it to them."""

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex


def channel(seed: int, *shape: int) -> Complex:
    """Draws of CN(0, 1)."""
    parts = np.random.default_rng(seed).standard_normal((2, *shape))
    return np.asarray((parts[0] + 1j * parts[1]) * np.sqrt(0.5))


def power_of(P: Complex) -> Real:
    return np.asarray(np.sum(np.abs(P) ** 2, axis=(-2, -1)))


def bpsk_two_antennas_rate(H: RealOrComplex, power: float, noise: float) -> Real:
    """Return the highest cutoff rate of BPSK on two antennas, bit/s/Hz, (...) for H (..., N_r, 2).

    R_0 = 2 (1 - log2(1 + e^-x)), x = W lambda_1^2 / (2 sigma^2).
    """
    largest = np.linalg.svd(np.asarray(H, dtype=np.complex128), compute_uv=False)[..., 0]
    x = power * largest**2 / (2.0 * noise)
    # 1 + e^-x = 2 (1 + (e^-x - 1) / 2): as accurate where the rate is next to nothing.
    return np.asarray(-2.0 * np.log1p(0.5 * np.expm1(-x)) / np.log(2.0))[()]
