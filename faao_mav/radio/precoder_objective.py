"""The mean cutoff rate as a function of the precoder, with its first and second derivatives.

The classes of ``class_sum`` enter only through the mean and the covariance of φ under the weights
∝ multiplicity e^-D, with Z = Q^H G Q and G = H^H H / (4 σ²); what remains is algebra on matrices as
small as Q.

The objective, which is minimised, is F = ln mean_s δ_s with δ_s = N ln(rho) - R_0(G_s) [nats] and s
the draws of a channel. Unlike R_0, F has a non-zero gradient at any SNR, even where R_0 equals
N log2(rho) to the last digit.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.radio.class_sum import ClassSum
from faao_mav.radio.quadratic_form import coordinates

_SATURATED = -36.0
"""s below which ln δ, δ = ln(1 + e^s), equals s to the last digit: e^s / 2 < 1.2e-16."""


@dataclass(frozen=True, eq=False)
class Objective:
    """F at b points, with its derivatives by the m = 2 q N real coordinates [Re Q, Im Q].

    `value` (b,) is F, `gradient` (b, m) ∂F and `hessian` (b, m, m) ∂²F.
    """

    value: Real
    gradient: Real
    hessian: Real


def to_real(Q: Complex) -> Real:
    """Return [Re Q, Im Q], (..., q, N) complex to (..., 2 q N) real.

    >>> to_real(np.array([[1.0 + 2.0j, 3.0]])).tolist()
    [1.0, 3.0, 2.0, 0.0]
    """
    flat = Q.reshape(*Q.shape[:-2], Q.shape[-2] * Q.shape[-1])
    return np.concatenate([flat.real, flat.imag], axis=-1)


def to_complex(x: Real, antennas: int) -> Complex:
    """Return Q from [Re Q, Im Q], (..., 2 q N) real to (..., q, N) complex.

    >>> to_complex(np.array([1.0, 3.0, 2.0, 0.0]), 2).tolist()
    [[(1+2j), (3+0j)]]
    """
    half = x.shape[-1] // 2
    Q: Complex = x[..., :half] + 1j * x[..., half:]
    return Q.reshape(*x.shape[:-1], half // antennas, antennas)


def _log_deficit(s: Real) -> tuple[Real, Real, Real]:
    """Return ln δ, δ = ln(1 + e^s), and δ'/δ and δ''/δ."""
    low = s < _SATURATED
    bounded = np.where(low, 0.0, s)
    deficit = np.logaddexp(0.0, bounded)
    sigmoid = 1.0 / (1.0 + np.exp(-bounded))
    first = np.where(low, 1.0, sigmoid / deficit)
    second = np.where(low, 1.0, sigmoid * (1.0 - sigmoid) / deficit)
    return np.where(low, s, np.log(deficit)), first, second


def _log_mean(y: Real) -> Real:
    top = np.max(y, axis=1)
    return np.asarray(np.log(np.mean(np.exp(y - top[:, None]), axis=1)) + top)


def _quadratic(G: Complex, Q: Complex) -> tuple[Complex, Real]:
    """Return G Q, (b, S, q, N), and the coordinates z of Q^H G Q, (b, S, N²)."""
    b, S, q, N = *G.shape[:3], Q.shape[2]
    GQ = (G.reshape(b, S * q, q) @ Q).reshape(b, S, q, N)
    Z = Q.conj().mT @ GQ.transpose(0, 2, 1, 3).reshape(b, q, S * N)
    return GQ, coordinates(Z.reshape(b, N, S, N).transpose(0, 2, 1, 3))


def value(sums: ClassSum, G: Complex, Q: Complex) -> Real:
    """Return F = ln mean_s δ_s, (b,), of G (b, S, q, q) and Q (b, q, N).

    >>> from faao_mav.radio.constellation import difference_classes
    >>> sums = ClassSum(difference_classes("bpsk", 1))
    >>> value(sums, np.array([[[[2.0 + 0j]]]]), np.array([[[1.0 + 0j]]])).round(6)
    array([-8.000168])
    """
    _, z = _quadratic(G, Q)
    s = sums.value(z.reshape(-1, z.shape[-1])).reshape(z.shape[:-1])
    return _log_mean(_log_deficit(s)[0])


def evaluate(sums: ClassSum, G: Complex, Q: Complex) -> Objective:
    """Return F and its first and second derivatives by the real coordinates of Q.

    `sums` are the classes of the alphabet, `G` (b, S, q, q), Hermitian, is H^H H / (4 σ²) of each
    draw, `Q` (b, q, N) are precoders.

    >>> from faao_mav.radio.constellation import difference_classes
    >>> sums = ClassSum(difference_classes("bpsk", 1))
    >>> evaluate(sums, np.array([[[[2.0 + 0j]]]]), np.array([[[1.0 + 0j]]])).gradient.round(3)
    array([[-15.997,  -0.   ]])
    """
    b, S, q = G.shape[:3]
    m = 2 * q * sums.antennas
    GQ, z = _quadratic(G, Q)
    width = z.shape[-1]
    s, mean, covariance = (
        part.reshape(b, S, *part.shape[1:]) for part in sums.moments(z.reshape(-1, width))
    )
    y, first, second = _log_deficit(s)
    share = np.exp(y - np.max(y, axis=1, keepdims=True))
    share /= np.sum(share, axis=1, keepdims=True)
    first, second = first * share, second * share

    # dz_a = <2 G Q B_a, dQ>, and s has the gradient -Σ_a mean_a dz_a.
    turned = GQ.reshape(-1, sums.antennas) @ (2.0 * np.concatenate(sums.basis, axis=1))
    turned = turned.reshape(b, S, q, width, sums.antennas)
    parts = np.empty((b, S, width, 2, q, sums.antennas))
    parts[:, :, :, 0], parts[:, :, :, 1] = (
        np.swapaxes(x, 2, 3) for x in (turned.real, turned.imag)
    )
    slopes = parts.reshape(b, S, width, m)
    stacked = slopes.reshape(b, S * width, m)
    shared = mean * first[..., None]
    gradient = -(shared.reshape(b, 1, S * width) @ stacked)[:, 0]

    inner = first[..., None, None] * covariance
    inner += second[..., None, None] * (mean[..., :, None] * mean[..., None, :])
    hessian = np.swapaxes(stacked, 1, 2) @ (inner @ slopes).reshape(b, S * width, m)
    hessian -= gradient[:, :, None] * gradient[:, None, :]

    # The second derivative of z: the quadratic form tr(G E M E^H), M = Σ_a mean_a B_a, in reals.
    M = np.tensordot(shared, sums.basis, axes=1)
    K = 2.0 * np.einsum("bsij,bskl->biljk", G, M, optimize=True).reshape(b, m // 2, m // 2)
    half = m // 2
    hessian[:, :half, :half] -= K.real
    hessian[:, half:, half:] -= K.real
    hessian[:, :half, half:] += K.imag
    hessian[:, half:, :half] -= K.imag
    return Objective(_log_mean(y), gradient, hessian)
