"""Sums over the classes of differences, as functions of the matrix that the exponents depend on.

With the Hermitian Z = P^H H^H H P / (4 σ²), every exponent of (7) and (8) is linear in Z:
D_k = u_k^H Z u_k = Σ_a φ_ka z_a (``quadratic_form``). The classes, thousands of them, therefore
enter only through products of matrices with the features φ, which are the same for all channels.
Those of 16- and 64-QAM are summed by ``square_sum``.
"""

from functools import lru_cache

import numpy as np

from faao_mav.arrays import Real
from faao_mav.radio.constellation import DifferenceClasses
from faao_mav.radio.quadratic_form import features
from faao_mav.radio.square_sum import SquareSum

_BLOCK = 1 << 17
"""Exponents in memory at once, 1 MB: they stay in the cache. Chosen."""

_NEAREST = 2048
"""Classes, the nearest first, among which the smallest exponent is looked for. Chosen."""

_TINY = 1e-300
"""The least sum that is told from zero: s is above -691."""


class ClassSum:
    """The function s(z) = ln Σ_k multiplicity_k e^(-φ_k z) / rho^N, in bounded memory.

    The sum is over the non-zero difference classes, as in (7) and (8): R_0 = N log2(rho) -
    log2(1 + e^s). Where it is below the least number s is about -691.

    >>> from faao_mav.radio.constellation import difference_classes
    >>> sums = ClassSum(difference_classes("bpsk", 1))
    >>> sums.value(np.array([[2.0]]))  # one class, u = 2, of two pairs: ln(2 e^(-4 z) / 2)
    array([-8.])
    """

    def __init__(self, classes: DifferenceClasses) -> None:
        self._phi = features(classes.vectors)
        weights = classes.multiplicity[:, None] / classes.symbols
        self._terms = np.hstack([weights, weights * self._phi])
        self._by_parts = (
            None
            if classes.part_differences is None
            else SquareSum(classes.part_differences, classes.vectors.shape[1], classes.symbols)
        )

    def value(self, z: Real) -> Real:
        """Return s, (b,), at z (b, N²)."""
        return np.asarray(np.log(np.maximum(self._sums(z, 1)[:, 0], _TINY)))

    def moments(self, z: Real) -> tuple[Real, Real]:
        """Return s (b,) and the mean of φ under the terms of the sum (b, N²), at z (b, N²)."""
        sums = self._sums(z, self._terms.shape[1])
        total = np.maximum(sums[:, :1], _TINY)
        return np.log(total[:, 0]), sums[:, 1:] / total

    def least(self, z: Real) -> Real:
        """Return the smallest exponent of the nearest differences, (b,), at z (b, N²)."""
        phi = self._phi[:_NEAREST].T
        step = max(1, _BLOCK // phi.shape[1])
        parts = [(z[i : i + step] @ phi).min(axis=1) for i in range(0, len(z), step)]
        return np.concatenate(parts)

    def _sums(self, z: Real, columns: int) -> Real:
        """Return the first `columns` of Σ_k weight_k e^-D_k [1, φ], (b, columns)."""
        if self._by_parts is not None:
            return self._by_parts.sums(z, columns)
        sums, phi = np.empty((len(z), columns)), -self._phi.T
        step = max(1, _BLOCK // len(self._phi))
        for start in range(0, len(z), step):
            D = z[start : start + step] @ phi
            sums[start : start + step] = np.exp(D, out=D) @ self._terms[:, :columns]
        return sums


@lru_cache(maxsize=2)
def class_sum(classes: DifferenceClasses) -> ClassSum:
    """Return the sum over `classes`, the same for all who ask: its features take long to form."""
    return ClassSum(classes)
