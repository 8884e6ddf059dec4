"""Sums over the classes of differences, as functions of the matrix that the exponents depend on.

With Z = P^H H^H H P / (4 σ²), every exponent of (7) and (8) is linear in Z:
D_k = u_k^H Z u_k = Σ_a φ_ka z_a, z the N² real coordinates of Z. The classes, thousands of them,
therefore enter only through products of matrices with the features φ, which are the same for all
channels. Those of 16- and 64-QAM are summed by ``lattice_sum``.
"""

from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np

from faao_mav.arrays import Real
from faao_mav.radio.constellation import DifferenceClasses
from faao_mav.radio.lattice_sum import LatticeSum
from faao_mav.radio.quadratic_form import basis, features

_BLOCK, _CLASSES = 1 << 17, 2048
"""Exponents held at once, 1 MB, and classes taken together: they stay in the cache. Chosen."""

_KEPT = 1 << 24
"""Numbers of features and their products that are kept, 128 MB; more are computed anew. Chosen."""

_TINY = 1e-200
"""The least sum that is taken without a common factor. Chosen: far above the smallest number."""


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
        self.basis = basis(self.antennas)
        self._phi = features(classes.vectors)
        self._weights = classes.multiplicity / classes.symbols
        self._rows, self._columns = np.triu_indices(self.antennas**2)
        self._kept: dict[bool, list[tuple[Real, Real]]] = {}
        self._by_parts = (
            None
            if classes.lattice is None
            else LatticeSum(classes.lattice, self.antennas, classes.symbols)
        )

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
            if self._by_parts is None:
                sums = self._shifted(z, least, derivatives)
            else:
                sums = self._by_parts.sums(z, derivatives)
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


@lru_cache(maxsize=2)
def class_sum(classes: DifferenceClasses) -> ClassSum:
    """Return the sum over `classes`, the same for all who ask: its features take long to form."""
    return ClassSum(classes)
