"""The sums of ``class_sum`` for square alphabets, whose differences are lattices.

The real and the imaginary part of a difference u_1 of two 16- or 64-QAM symbols are chosen
independently. With r the differences of the other streams, w = Σ_j Z_1j r_j / Z_11 and the Schur
complement S = Z_rr - Z_r1 Z_1r / Z_11,

    u^H Z u = Z_11 |u_1 + w|² + r^H S r,

so that for one r the sum over u_1 is a product of a sum over Re u_1 and one over Im u_1: with L
values of each, 2 L exponentials in place of L². The features φ are polynomials in both parts, whose
products up to the fourth power, the moments of these sums, give all derivatives. Nothing is left
out: the results differ from those over the classes by rounding only.
"""

from collections.abc import Iterator
from itertools import combinations_with_replacement, product

import numpy as np

from faao_mav.arrays import Complex, Integers, Real
from faao_mav.radio.constellation import Lattice
from faao_mav.radio.quadratic_form import coordinates, features

_BLOCK = 1 << 18
"""Exponents held at once, 2 MB: long enough for NumPy's calls not to count. Chosen."""

_TINY = np.finfo(np.float64).tiny
"""The least number with all its digits."""

_Polynomial = dict[tuple[int, int], Real]
"""Coefficients (R,) of Re(u_1)^i Im(u_1)^j by (i, j), for each r."""


class LatticeSum:
    """The sums Σ_u multiplicity_u e^(-D_u) [1, φ, φ φ] / rho^N over all non-zero differences u.

    >>> from faao_mav.radio.class_sum import ClassSum
    >>> from faao_mav.radio.constellation import difference_classes
    >>> classes = difference_classes("16qam", 2)
    >>> z = np.array([[1.0, 2.0, 0.3, -0.2]])
    >>> s = np.log(LatticeSum(classes.lattice, 2, classes.symbols).sums(z, False)[:, 0])
    >>> bool(np.isclose(s, ClassSum(classes).value(z), rtol=1e-12))
    True
    """

    def __init__(self, lattice: Lattice, antennas: int, symbols: int) -> None:
        self._antennas, self._lattice = antennas, lattice
        self._squares = lattice.values ** np.arange(3)[:, None]
        self._powers = lattice.counts * lattice.values ** np.arange(5)[:, None]
        alone, counts = _quarter(lattice, 1)
        self._alone = np.abs(alone[:, 0]) ** 2
        shares = counts / np.sum(lattice.counts)  # the other streams are alike in rho^(N - 1) pairs
        self._alone_terms = self._alone[:, None] ** np.arange(3) * shares[:, None]
        self._rest, counts = _quarter(lattice, antennas - 1)
        self._weights = counts / symbols
        self._rest_features = features(self._rest).T
        self._kept: dict[bool, list[tuple[tuple[int, int], Integers, Real]]] = {}

    def sums(self, z: Real, derivatives: bool) -> Real:
        """Return the sums, (b, 1 + N² + N² (N² + 1) / 2) or without `derivatives` (b, 1)."""
        step = max(1, _BLOCK // (2 * len(self._lattice.values) * len(self._rest)))
        parts = (z[start : start + step] for start in range(0, max(1, len(z)), step))
        return np.concatenate([self._block(part, derivatives) for part in parts])

    def _block(self, z: Real, derivatives: bool) -> Real:
        """Return the sums at few z (b, N²).

        Z is positive semidefinite, |Z_1j|² <= Z_11 Z_jj: however weak the first stream is, no term
        is larger than those of u^H Z u itself, and rounding errors are those of Z.
        """
        N = self._antennas
        own = z[:, :1]
        # Of streams without power w is 0 / 0, and any will do.
        share = np.divide(1.0, own, out=np.zeros_like(own), where=own >= _TINY)
        real, imaginary = z[:, N : 3 * N - 2 : 2], z[:, N + 1 : 3 * N - 2 : 2]
        r = self._rest.T
        row = np.stack([real @ r.real - imaginary @ r.imag, real @ r.imag + imaginary @ r.real])
        # Z_11 (u + w)² of either part of u_1, by powers of it.
        D = np.stack([-share * row**2, -2.0 * row, np.broadcast_to(-own, row.shape)])
        D = self._squares.T @ D.reshape(3, -1)
        moments = self._powers[: 1 + 4 * derivatives] @ np.exp(D, out=D)
        x, y = moments.reshape(len(moments), *row.shape).swapaxes(0, 1)
        schur = _schur(z, share, N)
        x *= np.exp(-(schur @ self._rest_features))

        sums = np.zeros((len(z), 1 + derivatives * (N**2 * (N**2 + 3) // 2)))
        near = np.exp(-own * self._alone) @ self._alone_terms
        sums[:, 0] = near[:, 0]
        if derivatives:
            sums[:, 1], sums[:, 1 + N**2] = near[:, 1], near[:, 2]
        for (i, j), columns, terms in self._terms(derivatives):
            sums[:, columns] += (x[i] * y[j]) @ terms
        return sums

    def _terms(self, derivatives: bool) -> list[tuple[tuple[int, int], Integers, Real]]:
        """Return for each power (i, j) the columns that it counts in, and coefficients (R, c)."""
        if derivatives not in self._kept:
            polynomials = [*_columns(self._rest, derivatives)]
            self._kept[derivatives] = []
            for power in product(range(5), range(5)):
                columns = [c for c, terms in enumerate(polynomials) if power in terms]
                if columns:
                    terms = np.column_stack([polynomials[c][power] for c in columns])
                    terms *= self._weights[:, None]
                    self._kept[derivatives].append((power, np.array(columns), terms))
        return self._kept[derivatives]


def _quarter(lattice: Lattice, antennas: int) -> tuple[Complex, Real]:
    """Return one of each four differences (k, N) that turns of 90° exchange, and their pairs (k,).

    Its first entry other than 0 is in the first quadrant; the zero difference is left out.
    """
    parts = np.indices((len(lattice.values),) * 2 * antennas).reshape(antennas, 2, -1)
    real, imaginary = lattice.values[parts].swapaxes(0, 1)
    u = (real + 1j * imaginary).T
    first = u[np.arange(len(u)), np.argmax(u != 0.0, axis=1)]
    chosen = (first.real > 0.0) & (first.imag >= 0.0)
    return u[chosen], 4.0 * lattice.counts[parts].prod(axis=(0, 1))[chosen]


def _columns(rest: Complex, derivatives: bool) -> Iterator[_Polynomial]:
    """Yield 1 and with `derivatives` φ and φ_a φ_b, a <= b, as polynomials in the parts of u_1."""
    one = np.ones(len(rest))
    yield {(0, 0): one}
    if not derivatives:
        return
    width = rest.shape[1]
    of_rest = list(features(rest).T)
    phi: list[_Polynomial] = [{(2, 0): one, (0, 2): one}]
    phi += [{(0, 0): energy} for energy in of_rest[:width]]
    for r in 2.0 * rest.T:
        phi += [{(1, 0): r.real, (0, 1): r.imag}, {(1, 0): -r.imag, (0, 1): r.real}]
    phi += [{(0, 0): crossed} for crossed in of_rest[width:]]
    yield from phi
    for a, b in combinations_with_replacement(phi, 2):
        term: _Polynomial = {}
        for p, q in product(a, b):
            power = p[0] + q[0], p[1] + q[1]
            term[power] = term.get(power, 0.0) + a[p] * b[q]
        yield term


def _schur(z: Real, share: Real, antennas: int) -> Real:
    """Return the coordinates of S = Z_rr - Z_r1 Z_1r / Z_11, `share` being 1 / Z_11."""
    crossed = z[:, antennas : 3 * antennas - 2]
    row = crossed[:, ::2] + 1j * crossed[:, 1::2]
    rest = np.concatenate([z[:, 1:antennas], z[:, 3 * antennas - 2 :]], axis=1)
    return rest - share * coordinates(row.conj()[:, :, None] * row[:, None, :])
