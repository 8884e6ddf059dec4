"""Sums over the classes of differences, as functions of the matrix that the exponents depend on.

With Z = P^H H^H H P / (4 σ²), every exponent of (7) and (8) is linear in Z:
D_k = u_k^H Z u_k = Σ_a φ_ka z_a, z the N² real coordinates of Z. The classes, thousands of them,
therefore enter only through products of matrices with the features φ, which are the same for all
channels.
"""

from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.radio.constellation import DifferenceClasses

_BLOCK, _CLASSES = 1 << 17, 2048
"""Exponents held at once, 1 MB, and classes taken together: they stay in the cache. Chosen."""

_KEPT = 1 << 24
"""Numbers of features and their products that are kept, 128 MB; more are computed anew. Chosen."""

_TINY = 1e-200
"""The least sum that is taken without a common factor. Chosen: far above the smallest number."""


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


def features(u: Complex) -> Real:
    """Return φ (k, N²) with Σ_a φ_a B_a = u u^H for u (k, N)."""
    columns = [np.abs(u[:, i]) ** 2 for i in range(u.shape[1])]
    for i, j in combinations(range(u.shape[1]), 2):
        product = 2.0 * u[:, i] * u[:, j].conj()
        columns += [product.real, product.imag]
    return np.column_stack(columns)


def coordinates(Z: Complex) -> Real:
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
        self._phi = features(classes.vectors)
        self._weights = classes.multiplicity / classes.symbols
        self._rows, self._columns = np.triu_indices(self.antennas**2)
        self._kept: dict[bool, list[tuple[Real, Real]]] = {}

    def _blocks(self, derivatives: bool) -> Iterable[tuple[Real, Real]]:
        """Return φᵀ and weight [1, φ, φ φ] of the classes, `_CLASSES` at once."""
        if self._phi.size * (1 + derivatives * self._phi.shape[1]) > _KEPT:
            return self._computed(derivatives)
        if derivatives not in self._kept:
            self._kept[derivatives] = list(self._computed(derivatives))
        return self._kept[derivatives]

    def _computed(self, derivatives: bool) -> Iterator[tuple[Real, Real]]:
        for start in range(0, len(self._phi), _CLASSES):
            phi = self._phi[start : start + _CLASSES]
            terms = [np.ones((len(phi), 1))]
            if derivatives:
                terms += [phi, phi[:, self._rows] * phi[:, self._columns]]
            weights = self._weights[start : start + _CLASSES, None]
            yield np.ascontiguousarray(phi.T), np.concatenate(terms, axis=1) * weights

    def _sums(self, z: Real, derivatives: bool) -> tuple[Real, Real]:
        """Return Σ_k weight_k e^(least - D_k) [1, φ, φ φ] and least, 0 or the smallest D_k."""
        least = np.zeros(len(z))
        with np.errstate(over="ignore", invalid="ignore"):
            sums = self._shifted(z, least, derivatives)
        far = np.flatnonzero(~((sums[:, 0] > _TINY) & (sums[:, 0] < 1 / _TINY)))
        if far.size:
            least[far] = self._least(z[far])
            sums[far] = self._shifted(z[far], least[far], derivatives)
        return sums, least

    def _shifted(self, z: Real, least: Real, derivatives: bool) -> Real:
        """Return Σ_k weight_k e^(least - D_k) [1, φ, φ φ]."""
        sums = np.zeros((len(z), 1 + derivatives * (z.shape[1] + len(self._rows))))
        shift = bool(least.any())
        for phi, terms in self._blocks(derivatives):
            for part in self._parts(z):
                D = z[part] @ -phi
                if shift:
                    D += least[part, None]
                sums[part] += np.exp(D, out=D) @ terms
        return sums

    def _least(self, z: Real) -> Real:
        """Return the smallest exponent at z (b, N²), (b,)."""
        least = np.full(len(z), np.inf)
        for phi, _ in self._blocks(False):
            for part in self._parts(z):
                least[part] = np.minimum(least[part], (z[part] @ phi).min(axis=1))
        return least

    def _parts(self, z: Real) -> Iterator[slice]:
        """Yield the parts of z that are taken at once."""
        step = max(1, _BLOCK // min(_CLASSES, len(self._phi)))
        return (slice(start, start + step) for start in range(0, len(z), step))

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
