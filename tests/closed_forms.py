"""Closed forms that the tests hold the package to."""

import numpy as np

from faao_mav.arrays import Real, RealOrComplex
from faao_mav.radio.constellation import DifferenceClasses, difference_classes
from faao_mav.radio.rate import exponents


def bpsk_two_antennas_rate(H: RealOrComplex, power: float, noise: float) -> Real:
    """Return the highest cutoff rate of BPSK on two antennas, bit/s/Hz, (...) for H (..., N_r, 2).

    R_0 = 2 (1 - log2(1 + e^-x)), x = W lambda_1^2 / (2 sigma^2).
    """
    largest = np.linalg.svd(np.asarray(H, dtype=np.complex128), compute_uv=False)[..., 0]
    x = power * largest**2 / (2.0 * noise)
    # 1 + e^-x = 2 (1 + (e^-x - 1) / 2): as accurate where the rate is next to nothing.
    return np.asarray(-2.0 * np.log1p(0.5 * np.expm1(-x)) / np.log(2.0))[()]


def log_nonzero_sum(D: Real, classes: DifferenceClasses) -> Real:
    """Return s = ln of the sum of multiplicity e^-D / rho^N: N log2(rho) - R_0 = log2(1 + e^s).

    It is finite at any SNR, even where R_0 no longer tells two precoders apart. D is (..., k).
    """
    nearest = np.min(D, axis=-1)
    total = np.exp(nearest[..., None] - D) @ (classes.multiplicity / classes.symbols)
    return np.asarray(np.log(total) - nearest)[()]


def log_sum(H: RealOrComplex, P: RealOrComplex, modulation: str, noise: float = 1.0) -> Real:
    """Return ``log_nonzero_sum`` of channels H and precoders P."""
    classes = difference_classes(modulation, P.shape[-1])
    return log_nonzero_sum(exponents(H, P, classes.vectors, noise), classes)
