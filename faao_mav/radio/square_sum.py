"""The sums of ``class_sum`` for square alphabets, by the parts of a difference.

The real and the imaginary part of a difference u_1 of two 16- or 64-QAM symbols are chosen
independently. With r the differences of the other streams, w = Σ_j Z_1j r_j / Z_11 and the Schur
complement S = Z_rr - Z_r1 Z_1r / Z_11,

    u^H Z u = Z_11 |u_1 + w|² + r^H S r,

so that for one r the sum over u_1 is a product of a sum over Re u_1 and one over Im u_1: with L
values of each, 2 L exponentials in place of L². Nothing is left out: the results differ from those
over the classes by rounding only.
"""

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.radio.quadratic_form import coordinates, features

_BLOCK = 1 << 18
"""Exponents in memory at once, 2 MB: long enough for NumPy's calls not to count. Chosen."""

_TINY = np.finfo(np.float64).tiny
"""The least number with all its digits."""


class SquareSum:
    """The sums Σ_u multiplicity_u e^(-D_u) [1, φ] / rho^N over all non-zero differences u.

    >>> from faao_mav.radio.class_sum import ClassSum
    >>> from faao_mav.radio.constellation import difference_classes
    >>> classes = difference_classes("16qam", 2)
    >>> z = np.array([[1.0, 2.0, 0.3, -0.2]])
    >>> s = np.log(SquareSum(classes.part_differences, 2, classes.symbols).sums(z, 1)[:, 0])
    >>> bool(np.isclose(s, ClassSum(classes).value(z), rtol=1e-12))
    True
    """

    def __init__(self, part_differences: Real, antennas: int, symbols: int) -> None:
        values, pairs = part_differences
        self._squares = values ** np.arange(3)[:, None]
        self._powers = pairs * self._squares
        alone, counts = _quarter(part_differences, 1)
        self._alone = np.abs(alone[:, 0]) ** 2
        weights = counts / np.sum(pairs)  # the other streams are alike in rho^(N - 1) pairs
        self._alone_terms = self._alone[:, None] ** np.arange(2) * weights[:, None]
        self._rest, counts = _quarter(part_differences, antennas - 1)
        self._weights = counts / symbols
        self._rest_features = features(self._rest)

    def sums(self, z: Real, columns: int) -> Real:
        """Return the first `columns`, 1 or 1 + N², of the sums, (b, columns), at z (b, N²)."""
        step = max(1, _BLOCK // (2 * self._squares.shape[1] * len(self._rest)))
        parts = (z[start : start + step] for start in range(0, max(1, len(z)), step))
        return np.concatenate([self._block(part, columns) for part in parts])

    def _block(self, z: Real, columns: int) -> Real:
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
        moments = self._powers[: min(3, columns)] @ np.exp(D, out=D)
        x, y = moments.reshape(len(moments), *row.shape).swapaxes(0, 1)
        schur = z[:, among] - inverse * coordinates(Z_1r.conj()[:, :, None] * Z_1r[:, None, :])
        x *= np.exp(-(schur @ self._rest_features.T)) * self._weights

        near = np.exp(-own * self._alone) @ self._alone_terms
        total = x[0] * y[0]
        sums = np.empty((len(z), columns))
        sums[:, 0] = np.sum(total, axis=1) + near[:, 0]
        if columns == 1:
            return sums
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
