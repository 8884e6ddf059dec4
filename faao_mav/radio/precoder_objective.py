"""The mean cutoff rate as a function of the precoder, with its first and second derivatives.

With Z = Q^H G Q, G = H^H H / (4 σ²), every exponent of (7) and (8) is linear in Z:
D_k = u_k^H Z u_k = Σ_a φ_ka z_a, z the N² real coordinates of Z. The classes, thousands of them,
therefore enter only through the mean and the covariance of φ under the weights
∝ multiplicity e^-D; what remains is algebra on matrices as small as Q.

The objective, which is minimised, is F = ln mean_s δ_s with δ_s = N ln(rho) - R_0(G_s) [nats] and s
the draws of a channel. Unlike R_0, F has a non-zero gradient at any SNR, even where R_0 equals
N log2(rho) to the last digit.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.radio.constellation import DifferenceClasses

_BLOCK, _CLASSES = 1 << 17, 2048
"""Exponents held at once, 1 MB, and classes taken together: they stay in the cache. Chosen."""

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


def _basis(antennas: int) -> Complex:
    """Return the N² Hermitian B_a with z_a = tr(B_a Z), (N², N, N).

    The coordinates z are the diagonal of Z, then Re and Im of the entries above it.
    """
    B = np.zeros((antennas**2, antennas, antennas), dtype=np.complex128)
    B[np.arange(antennas), np.arange(antennas), np.arange(antennas)] = 1.0
    for a, (i, j) in enumerate(combinations(range(antennas), 2)):
        B[antennas + 2 * a, i, j] = B[antennas + 2 * a, j, i] = 0.5
        B[antennas + 2 * a + 1, i, j] = 0.5j
        B[antennas + 2 * a + 1, j, i] = -0.5j
    return B


def _features(u: Complex) -> Real:
    """Return φ (k, N²) with Σ_a φ_a B_a = u u^H for u (k, N)."""
    columns = [np.abs(u[:, i]) ** 2 for i in range(u.shape[1])]
    for i, j in combinations(range(u.shape[1]), 2):
        product = 2.0 * u[:, i] * u[:, j].conj()
        columns += [product.real, product.imag]
    return np.column_stack(columns)


def _coordinates(Z: Complex) -> Real:
    """Return the real coordinates z of Z, (..., N, N) to (..., N²)."""
    antennas = Z.shape[-1]
    columns = [Z[..., i, i].real for i in range(antennas)]
    for i, j in combinations(range(antennas), 2):
        columns += [Z[..., i, j].real, Z[..., i, j].imag]
    return np.stack(columns, axis=-1)


class ClassSum:
    """The function s(z) = ln Σ_k multiplicity_k e^(-φ_k z) / rho^N, in bounded memory.

    The sum is over the non-zero difference classes, as in (7) and (8): R_0 = N log2(rho) -
    log2(1 + e^s).

    >>> from faao_mav.radio.constellation import difference_classes
    >>> sums = ClassSum(difference_classes("bpsk", 1))
    >>> sums.value(np.array([[2.0]]))  # one class, u = 2, of two pairs: ln(2 e^(-4 z) / 2)
    array([-8.])
    """

    def __init__(self, classes: DifferenceClasses) -> None:
        self.antennas = classes.vectors.shape[1]
        self.basis = _basis(self.antennas)
        self._phi = _features(classes.vectors)
        self._weights = classes.multiplicity / classes.symbols
        self._rows, self._columns = np.triu_indices(self.antennas**2)

    def _blocks(self, derivatives: bool) -> Iterator[tuple[Real, Real]]:
        for start in range(0, len(self._phi), _CLASSES):
            phi = self._phi[start : start + _CLASSES]
            terms = [np.ones((len(phi), 1))]
            if derivatives:
                terms += [phi, phi[:, self._rows] * phi[:, self._columns]]
            weights = self._weights[start : start + _CLASSES, None]
            yield np.ascontiguousarray(phi.T), np.concatenate(terms, axis=1) * weights

    def _sums(self, z: Real, derivatives: bool) -> tuple[Real, Real]:
        """Return Σ_k weight_k e^(least - D_k) [1, φ, φ φ] and least, the smallest D_k."""
        step = max(1, _BLOCK // min(_CLASSES, len(self._phi)))
        least = np.full(len(z), np.inf)
        width = 1 + derivatives * (z.shape[1] + len(self._rows))
        sums = np.zeros((len(z), width))
        for phi, terms in self._blocks(derivatives):
            for start in range(0, len(z), step):
                part = slice(start, start + step)
                D = z[part] @ phi
                lower = np.minimum(least[part], np.min(D, axis=1))
                sums[part] *= np.exp(lower - least[part])[:, None]
                np.subtract(lower[:, None], D, out=D)
                sums[part] += np.exp(D, out=D) @ terms
                least[part] = lower
        return sums, least

    def value(self, z: Real) -> Real:
        """Return s, (b,), at z (b, N²)."""
        sums, least = self._sums(z, False)
        return np.asarray(np.log(sums[:, 0]) - least)

    def moments(self, z: Real) -> tuple[Real, Real, Real]:
        """Return s (b,), and the mean (b, N²) and the covariance (b, N², N²) of φ, at z (b, N²)."""
        sums, least = self._sums(z, True)
        width = z.shape[1]
        mean = sums[:, 1 : 1 + width] / sums[:, :1]
        product = sums[:, 1 + width :] / sums[:, :1] - mean[:, self._rows] * mean[:, self._columns]
        covariance = np.empty((len(z), width, width))
        covariance[:, self._rows, self._columns] = product
        covariance[:, self._columns, self._rows] = product
        return np.log(sums[:, 0]) - least, mean, covariance


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
    return GQ, _coordinates(Z.reshape(b, N, S, N).transpose(0, 2, 1, 3))


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
