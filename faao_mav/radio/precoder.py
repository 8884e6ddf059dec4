"""Linear precoders, all of power W: tr(P^H P) = W.

The classical schemes are written for as many receiving as transmitting antennas. P stays N_t x N_t
in every case:

- N_r < N_t: columns of zeros are appended; the streams beyond N_r have nothing to be sent on.
- N_r > N_t: H is replaced by (H^H H)^{1/2}, its right polar factor. They differ by a rotation of
  what is received, which no rate notices, and no stream is lost.

Where H is zero there is no direction to prefer, and P is the scaled identity.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.errors import InputError

Scheme: TypeAlias = Callable[[RealOrComplex, float, float], Complex]

_RANK = 1e-10
"""Singular values below this fraction of the largest are rounding errors, not channel: far above
the 1e-16 of the arithmetic, far below any mode that could carry power."""


def check_positive(name: str, value: float) -> None:
    """Raise `InputError`, which names the quantity, for a `value` not above 0."""
    if not value > 0.0:
        raise InputError(f"the {name} must be above 0, got {value}")


def with_power(P: Complex, power: float) -> Complex:
    """Return P scaled to tr(P^H P) = power, W, zero matrices as a scaled identity."""
    check_positive("transmit power", power)
    largest = np.max(np.abs(P), axis=(-2, -1), keepdims=True)
    # Divided by its largest entry first, no P is too small or too large to be squared.
    P = np.where(largest > 0.0, P / np.where(largest > 0.0, largest, 1.0), np.eye(P.shape[-1]))
    energy = np.sum(P.real**2 + P.imag**2, axis=(-2, -1), keepdims=True)
    return np.asarray(P * np.sqrt(power / energy), dtype=np.complex128)


def _by_modes(H: RealOrComplex, power: float, gains: Callable[[Real], Real]) -> Complex:
    """Return V diag(gains(s)) U^H of H = U diag(s) V^H, widened to N_t columns, of the power.

    V stands for U where N_r > N_t: the right polar factor is V diag(s) V^H.
    """
    receive, transmit = np.shape(H)[-2:]
    U, s, Vh = np.linalg.svd(np.asarray(H, dtype=np.complex128), full_matrices=False)
    V = Vh.conj().mT
    P = (V * gains(s)[..., None, :]) @ (V if receive > transmit else U).conj().mT
    missing = max(0, transmit - receive)
    return with_power(np.pad(P, [(0, 0)] * (P.ndim - 1) + [(0, missing)]), power)


def mrt(H: RealOrComplex, power: float, noise: float) -> Complex:  # noqa: ARG001
    """Return the precoder of maximum-ratio transmission, P ∝ H^H, (..., N_t, N_t).

    `H` (..., N_r, N_t) are channels (N_r ≠ N_t: see the module), `power` is W and `noise` σ², W, as
    for all schemes, which raise `InputError` for a power or a noise that they need and that is not
    above 0.

    >>> mrt(np.array([[3.0, 0.0], [0.0, 4.0]]), 25.0, 1.0).real.round(12)
    array([[3., 0.],
           [0., 4.]])
    """
    return _by_modes(H, power, lambda s: s)


def zf(H: RealOrComplex, power: float, noise: float) -> Complex:  # noqa: ARG001
    """Return the zero-forcing precoder, P ∝ H^+, the pseudo-inverse: H P is diagonal.

    Directions in which H is zero to within rounding are left out.

    >>> zf(np.array([[3.0, 0.0], [0.0, 4.0]]), 25.0, 1.0).real.round(12)
    array([[4., 0.],
           [0., 3.]])
    """

    def inverse(s: Real) -> Real:
        kept = s > _RANK * s[..., :1]
        return np.where(kept, s[..., :1] / np.where(kept, s, 1.0), 0.0)

    return _by_modes(H, power, inverse)


def mmse(H: RealOrComplex, power: float, noise: float) -> Complex:
    """Return the regularised zero-forcing (MMSE) precoder, P ∝ H^H (H H^H + (N_r σ²/W) I)^-1.

    It tends to zero forcing as the noise vanishes and to maximum ratio as it takes over; N_r is
    that of the square channel. Source: Peel, Hochwald and Swindlehurst, "A vector-perturbation
    technique for near-capacity multiantenna multiuser communication, part I", IEEE Trans. Commun.
    53 (2005).

    >>> mmse(np.array([[1.0, 0.0], [0.0, 3.0]]), 2.0, 3.0).real.round(12)
    array([[1., 0.],
           [0., 1.]])
    """
    check_positive("transmit power", power)
    check_positive("noise power", noise)
    return _by_modes(H, power, lambda s: s / (s**2 + s.shape[-1] * noise / power))


def waterfilling(H: RealOrComplex, power: float, noise: float) -> Complex:
    """Return the optimal precoder for Gaussian inputs, P = V diag(√p) with H = U S V^H.

    p_i = max(0, μ - σ²/s_i²), the water level μ such that Σ p_i = W.

    >>> waterfilling(np.diag([1.0, 0.5]), 5.0, 1.0).real.round(12) ** 2
    array([[4., 0.],
           [0., 1.]])
    """
    check_positive("transmit power", power)
    check_positive("noise power", noise)
    _, s, Vh = np.linalg.svd(np.asarray(H, dtype=np.complex128), full_matrices=True)
    # Floors come lowest first. With the first r in use the level is (W + their sum) / r, and the
    # right r is the last whose highest floor lies below its level. The floor of a dead mode is
    # infinite.
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        floor = noise / s**2
        level = (power + np.cumsum(floor, axis=-1)) / np.arange(1, s.shape[-1] + 1)
        active = np.isfinite(floor) & (floor < level)
        r = np.maximum(1, np.sum(active, axis=-1, keepdims=True))
        p = np.where(active, np.take_along_axis(level, r - 1, axis=-1) - floor, 0.0)
    p = np.pad(p, [(0, 0)] * (p.ndim - 1) + [(0, Vh.shape[-1] - p.shape[-1])])
    return with_power(Vh.conj().mT * np.sqrt(p)[..., None, :], power)


def bpsk_two_antennas(H: RealOrComplex, power: float) -> Complex:
    """Return the precoder of highest cutoff rate for BPSK on two antennas, (..., 2, 2).

    P = √(W/2) v_1 [1, j]: both streams in quadrature on v_1, the dominant right singular vector
    of H. It reaches R_0 = 2 (1 - log2(1 + e^-x)), x = W λ_1² / (2 σ²), λ_1 the largest singular
    value of H. Source: derived for this project; no numerical search has found a better one.

    `H` (..., N_r, 2) are channels, `power` is W, W. Raises `InputError` for a power not above 0.

    >>> np.abs(bpsk_two_antennas(np.diag([1.0, 2.0]), 2.0)).round(12)
    array([[0., 0.],
           [1., 1.]])
    """
    _, _, Vh = np.linalg.svd(np.asarray(H, dtype=np.complex128), full_matrices=False)
    v = np.conj(Vh[..., 0, :])
    return with_power(v[..., :, None] * np.array([1.0, 1j]), power)


SCHEMES: Mapping[str, Scheme] = MappingProxyType(
    {"mrt": mrt, "zf": zf, "mmse": mmse, "waterfilling": waterfilling}
)
"""The classical schemes by name."""
