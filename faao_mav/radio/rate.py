"""The cutoff rate (7), (8), in closed form: one of the two rates that may count.

The cutoff rate is what is known of every code, a lower bound on the mutual information (5), (6);
that is what the best codes come near to.

With the Hermitian Z = P^H H^H H P / (4 σ²), every exponent of (7) and (8) is linear in Z:
D_k = u_k^H Z u_k = Σ_a φ_ka z_a, with the features φ of u and the coordinates z of Z. The classes
of differences, thousands of them, therefore enter only through products of matrices with the
features, which are the same for all channels. Those of 16- and 64-QAM are summed by the parts of a
difference.
"""

from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.arrays import CACHE, Complex, Real, RealOrComplex
from faao_mav.radio.constellation import (
    DifferenceClasses,
    coordinates,
    difference_classes,
    features,
)
from faao_mav.radio.precoder import check_positive

Measure: TypeAlias = Literal["cutoff", "mutual_information"]
"""The name of the rate that counts."""

_TINY = 1e-300
"""The least sum that is told from zero, s is above -691, and the least power that is divided by."""


def _coordinates(H: RealOrComplex, P: RealOrComplex, noise: float) -> Real:
    """Return z of Z = P^H H^H H P / (4 σ²), (..., N_t²)."""
    check_positive("noise power", noise)
    A = np.asarray(H) @ np.asarray(P) / (2.0 * np.sqrt(noise))
    return coordinates(np.asarray(A.conj().mT @ A, dtype=np.complex128))


def exponents(H: RealOrComplex, P: RealOrComplex, u: RealOrComplex, noise: float) -> Real:
    """Return the exponents D = ||H P u||² / (4 σ²) of (7) and (8), (..., k), never negative.

    `H` (..., N_r, N_t) are channels and `P` (..., N_t, N_t) precoders, whose leading axes
    broadcast; `u` (k, N_t) are differences of input vectors, ``DifferenceClasses.vectors``; `noise`
    is σ², W. Raises `InputError` for a noise not above 0.

    >>> exponents(np.eye(1), np.eye(1), np.array([[2.0 + 0j]]), 0.5)
    array([2.])
    """
    D: Real = _coordinates(H, P, noise) @ features(np.asarray(u, dtype=np.complex128)).T
    return np.maximum(D, 0.0, out=D)


def cutoff_rate(H: RealOrComplex, P: RealOrComplex, modulation: str, noise: float) -> Real:
    """Return the cutoff rate of a link, (7) or (8), in bit/s/Hz, (...) from 0 to N log2(rho).

    R_0 = 2 N log2(rho) - log2 Σ_m Σ_k exp(-||H P u_mk||² / (4 σ²)), the double sum taken over the
    classes: N log2(rho) - log2(1 + Σ multiplicity e^-D / rho^N).

    `H` (..., N_r, N_t) are channels and `P` (..., N_t, N_t) precoders, whose leading axes
    broadcast; `modulation` is the alphabet, one of ``MODULATIONS``; `noise` is σ², W. Raises
    `InputError` for an unknown modulation or a noise not above 0.

    >>> float(cutoff_rate(np.eye(1), np.eye(1), "bpsk", 1.0).round(6))
    0.548059
    """
    classes = difference_classes(modulation, np.shape(P)[-1])
    z = _coordinates(H, P, noise)
    s, _ = class_sum(classes).moments(z.reshape(-1, z.shape[-1]))
    rate: Real = classes.bits - np.logaddexp(0.0, s) / np.log(2.0)
    return np.maximum(rate, 0.0).reshape(z.shape[:-1])


class ClassSum:
    """The function s(z) = ln Σ_k multiplicity_k e^(-φ_k z) / rho^N, in bounded memory.

    The sum is over the non-zero difference classes, as in (7) and (8): R_0 = N log2(rho) -
    log2(1 + e^s). Where it is below the least number s is about -691.

    >>> sums = ClassSum(difference_classes("bpsk", 1))
    >>> sums.moments(np.array([[2.0]]))  # one class, u = 2, of two pairs: ln(2 e^(-4 z) / 2)
    (array([-8.]), array([[4.]]))
    """

    def __init__(self, classes: DifferenceClasses) -> None:
        self._phi = features(classes.vectors)
        weights = classes.multiplicity[:, None] / classes.symbols
        self._terms = np.hstack([weights, weights * self._phi])
        self._exponents = len(self._phi)

    def moments(self, z: Real) -> tuple[Real, Real]:
        """Return s (b,) and the mean of φ under the terms of the sum (b, N²), at z (b, N²)."""
        sums = self.sums(z)
        total = np.maximum(sums[:, :1], _TINY)
        return np.log(total[:, 0]), sums[:, 1:] / total

    def sums(self, z: Real) -> Real:
        """Return Σ_k weight_k e^-D_k [1, φ], (b, 1 + N²), at z (b, N²)."""
        step = max(1, CACHE // self._exponents)
        parts = [self._block(z[i : i + step]) for i in range(0, max(1, len(z)), step)]
        return np.concatenate(parts)

    def _block(self, z: Real) -> Real:
        """Return the sums at few z (b, N²)."""
        D = z @ -self._phi.T
        return np.asarray(np.exp(D, out=D) @ self._terms)


class SquareSum(ClassSum):
    """The same sums for square alphabets, from real and imaginary parts chosen independently.

    With r the differences of the streams other than the first, w = Σ_j Z_1j r_j / Z_11 and the
    Schur complement S = Z_rr - Z_r1 Z_1r / Z_11,

        u^H Z u = Z_11 |u_1 + w|² + r^H S r,

    so that for one r the sum over u_1 is a product of a sum over Re u_1 and one over Im u_1: with L
    values of each, 2 L exponentials in place of L². The results differ by rounding only.

    >>> classes, z = difference_classes("16qam", 2), np.array([[1.0, 2.0, 0.3, -0.2]])
    >>> bool(np.allclose(SquareSum(classes).sums(z), ClassSum(classes).sums(z), rtol=1e-12))
    True
    """

    def __init__(self, classes: DifferenceClasses) -> None:
        super().__init__(classes)
        assert classes.part_differences is not None
        values, pairs = classes.part_differences
        self._squares = values ** np.arange(3)[:, None]
        self._powers = pairs * self._squares
        alone, counts = _quarter(classes.part_differences, 1)
        self._alone = np.abs(alone[:, 0]) ** 2
        weights = counts / np.sum(pairs)  # the other streams are alike in rho^(N - 1) pairs
        self._alone_terms = self._alone[:, None] ** np.arange(2) * weights[:, None]
        self._rest, counts = _quarter(classes.part_differences, classes.vectors.shape[1] - 1)
        self._weights = counts / classes.symbols
        self._rest_features = features(self._rest)
        self._exponents = 2 * len(values) * len(self._rest)

    def _block(self, z: Real) -> Real:
        """Return the sums at few z (b, N²).

        Z is positive semidefinite, |Z_1j|² <= Z_11 Z_jj: however weak the first stream is, no term
        is larger than those of u^H Z u itself, and rounding errors are those of Z.
        """
        N = self._rest.shape[1] + 1
        first = np.arange(N, 2 * N - 1)  # Re Z_1j, and with as many pairs more Im Z_1j
        pairs = N * (N - 1) // 2
        own, Z_1r = z[:, :1], z[:, first] + 1j * z[:, first + pairs]
        among = np.delete(np.arange(1, N * N), np.r_[first, first + pairs] - 1)
        # Of streams without power w is 0 / 0, and any will do.
        inverse = np.divide(1.0, own, out=np.zeros_like(own), where=own >= _TINY)
        w = Z_1r @ self._rest.T
        row = np.stack([w.real, w.imag])
        # Z_11 (u + w)² of either part of u_1, by powers of it.
        D = np.stack([-inverse * row**2, -2.0 * row, np.broadcast_to(-own, row.shape)])
        D = self._squares.T @ D.reshape(3, -1)
        moments = self._powers @ np.exp(D, out=D)
        x, y = moments.reshape(len(moments), *row.shape).swapaxes(0, 1)
        schur = z[:, among] - inverse * coordinates(Z_1r.conj()[:, :, None] * Z_1r[:, None, :])
        x *= np.exp(-(schur @ self._rest_features.T)) * self._weights

        near = np.exp(-own * self._alone) @ self._alone_terms
        total = x[0] * y[0]
        sums = np.empty((len(z), 1 + N * N))
        sums[:, 0] = np.sum(total, axis=1) + near[:, 0]
        with_first = 2.0 * ((x[1] * y[0] + 1j * x[0] * y[1]) @ self._rest.conj())
        sums[:, 1] = np.sum(x[2] * y[0] + x[0] * y[2], axis=1) + near[:, 1]
        sums[:, 1 + first], sums[:, 1 + first + pairs] = with_first.real, with_first.imag
        sums[:, 1 + among] = total @ self._rest_features
        return sums


def _quarter(part_differences: Real, antennas: int) -> tuple[Complex, Real]:
    """Return one of each four differences (k, N) that turns of 90° exchange, and their pairs (k,).

    Its first entry other than 0 is in the first quadrant; the zero difference is left out.
    """
    values, pairs = part_differences
    parts = np.indices((len(values),) * 2 * antennas).reshape(antennas, 2, -1)
    real, imaginary = values[parts].swapaxes(0, 1)
    u = (real + 1j * imaginary).T
    first = u[np.arange(len(u)), np.argmax(u != 0.0, axis=1)]
    chosen = (first.real > 0.0) & (first.imag >= 0.0)
    return u[chosen], 4.0 * pairs[parts].prod(axis=(0, 1))[chosen]


@lru_cache(maxsize=2)
def class_sum(classes: DifferenceClasses) -> ClassSum:
    """Return the sum over `classes`, the same for all who ask: its features take long to form."""
    return (ClassSum if classes.part_differences is None else SquareSum)(classes)
