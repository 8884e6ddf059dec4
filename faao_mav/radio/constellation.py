"""Finite alphabets, and the differences between their vectors merged into classes.

Each alphabet is kept unscaled on an integer grid, where sums, differences and products of symbols
are exact (8-PSK on the unit circle, to rounding), and scaled to unit energy only when handed out.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InputError

_DECIMALS = 9
"""Decimals by which differences are compared: only 8-PSK has irrational coordinates, whose spacing
is far above 1e-9 and whose rounding errors are far below."""


def _square_qam(side: int) -> Complex:
    levels = np.arange(1.0 - side, side, 2.0)
    return (levels[:, None] + 1j * levels).ravel()


_GRIDS: dict[str, Complex] = {
    "bpsk": np.array([1.0 + 0j, -1.0]),
    "qpsk": _square_qam(2),
    "8psk": np.exp(0.25j * np.pi * np.arange(8)),
    "16qam": _square_qam(4),
    "64qam": _square_qam(8),
}

_BY_PARTS = ("16qam", "64qam")
"""The square alphabets whose sums by parts are quicker than over classes: measured with two and
three antennas, 1.3 to 7 times; not with QPSK."""

MODULATIONS: tuple[str, ...] = tuple(_GRIDS)
"""The names of the alphabets, from the smallest to the largest."""


@lru_cache
def _grid(modulation: str) -> tuple[Complex, float]:
    """Return the unscaled alphabet and the factor that gives it unit mean energy."""
    if modulation not in _GRIDS:
        raise InputError(f"unknown modulation {modulation!r}; known are {', '.join(MODULATIONS)}")
    grid = _GRIDS[modulation]
    return grid, float(1.0 / np.sqrt(np.mean(np.abs(grid) ** 2)))


def _product(values: Complex, antennas: int) -> Complex:
    """Return all vectors with entries from ``values``, the last entry running fastest."""
    index = np.indices((len(values),) * antennas).reshape(antennas, -1)
    return np.ascontiguousarray(values[index].T)


@lru_cache
def constellation(modulation: str) -> Complex:
    """Return the symbols of an alphabet, (rho,) complex, mean energy 1; read-only.

    BPSK is ±1, QPSK (±1 ± j)/√2, 8-PSK the eighth roots of 1, 16- and 64-QAM square. Raises
    `InputError` for a modulation that is not one of ``MODULATIONS``.

    >>> constellation("bpsk").real
    array([ 1., -1.])
    """
    grid, scale = _grid(modulation)
    symbols: Complex = grid * scale
    symbols.setflags(write=False)
    return symbols


@lru_cache(maxsize=16)
def symbol_vectors(modulation: str, antennas: int) -> Complex:
    """Return all input vectors x of (3), (rho**N, N) complex with E[x x^H] = I; read-only.

    Raises `InputError` for an unknown modulation.

    >>> symbol_vectors("bpsk", 2).real.tolist()
    [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
    """
    vectors = _product(constellation(modulation), antennas)
    vectors.setflags(write=False)
    return vectors


def features(u: Complex) -> Real:
    """Return φ (..., N²) of u (..., N): |u_i|², then Re and Im of 2 u_i u_j* for i < j.

    With the ``coordinates`` z of a Hermitian Z, u^H Z u = Σ_a φ_a z_a.
    """
    i, j = np.triu_indices(u.shape[-1], 1)
    product = 2.0 * u[..., i] * u[..., j].conj()
    return np.concatenate([np.abs(u) ** 2, product.real, product.imag], axis=-1)


def coordinates(Z: Complex) -> Real:
    """Return z (..., N²) of Z (..., N, N): its diagonal, then Re and Im of what is above it."""
    above = Z[(..., *np.triu_indices(Z.shape[-1], 1))]
    diagonal = np.diagonal(Z, axis1=-2, axis2=-1).real
    return np.concatenate([diagonal, above.real, above.imag], axis=-1)


def outer(phi: Real) -> Complex:
    """Return the Hermitian u u^H (..., N, N), or a mean of it, of the features φ (..., N²)."""
    N = round(phi.shape[-1] ** 0.5)
    i, j = np.triu_indices(N, 1)
    re, im = phi[..., N : N + len(i)], phi[..., N + len(i) :]
    M = np.zeros((*phi.shape[:-1], N, N), dtype=np.complex128)
    M[..., np.arange(N), np.arange(N)] = phi[..., :N]
    M[..., i, j], M[..., j, i] = (re + 1j * im) / 2, (re - 1j * im) / 2
    return M


@dataclass(frozen=True, eq=False)
class DifferenceClasses:
    """The non-zero differences u_mk = x_m - x_k of (7), merged up to a common unit phase.

    ||H P u|| is the same for u and e^{jφ} u whatever H and P are, so a sum over all rho^{2N} pairs
    (m, k) is a sum over these classes weighted by ``multiplicity``, plus ``symbols`` pairs m = k.

    `vectors` (k, N) has one representative u of each class, `multiplicity` (k,) how many ordered
    pairs (m, k) lie in it. `symbols` is rho**N, the number of input vectors and the size of the
    zero class; `bits` is N log2(rho), what one channel use carries at most. `part_differences`
    (2, L) are the differences of the real or the imaginary parts of two symbols, and how many
    ordered pairs of levels give each, where sums are formed by them: ``SquareSum``.
    """

    vectors: Complex
    multiplicity: Real
    symbols: int
    bits: float
    part_differences: Real | None


def _scalar_differences(grid: Complex) -> tuple[Complex, Real]:
    """Return the distinct differences of two symbols, zero too, and how many pairs give each."""
    pairs = np.round((grid[:, None] - grid).ravel(), _DECIMALS) + 0.0  # + 0.0 turns -0 into 0
    _, first, counts = np.unique(pairs, return_index=True, return_counts=True)
    return (grid[:, None] - grid).ravel()[first], counts.astype(np.float64)


@lru_cache
def difference_vector_count(modulation: str, antennas: int) -> int:
    """Return how many distinct difference vectors ``difference_classes`` has to go through.

    Its time and memory are proportional to this number, which is known without allocating. Raises
    `InputError` for an unknown modulation.

    >>> difference_vector_count("64qam", 2), difference_vector_count("64qam", 4)
    (50625, 2562890625)
    """
    grid, _ = _grid(modulation)
    return int(len(_scalar_differences(grid)[0]) ** antennas)


@lru_cache(maxsize=16)
def difference_classes(modulation: str, antennas: int) -> DifferenceClasses:
    """Return the differences of all pairs of input vectors, merged into classes.

    Two vectors differ by a unit phase exactly if u u^H is the same, so its ``features``, exact on
    the integer grids and rounded for 8-PSK, identify a class. Pairs are never enumerated:
    the distinct differences of single symbols are counted and combined over the antennas. Raises
    `InputError` for an unknown modulation.

    >>> classes = difference_classes("bpsk", 2)
    >>> classes.multiplicity.tolist(), classes.symbols, classes.bits
    ([4.0, 4.0, 2.0, 2.0], 4, 2.0)
    """
    grid, scale = _grid(modulation)
    values, counts = _scalar_differences(grid)
    u = _product(values, antennas)
    pairs = _product(counts.astype(np.complex128), antennas).real.prod(axis=1)

    keys = np.round(features(u), _DECIMALS) + 0.0
    _, first, label = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    multiplicity: Real = np.bincount(label.ravel(), weights=pairs).astype(np.float64)
    vectors = u[first] * scale

    # Nearest first: the classes that decide the rate at high SNR come together at the front.
    energy = np.round(np.sum(np.abs(vectors) ** 2, axis=1), _DECIMALS)
    order = np.argsort(energy, kind="stable")[1:]  # without the zero vector, alone at energy 0
    vectors, multiplicity = vectors[order], multiplicity[order]
    vectors.setflags(write=False)
    multiplicity.setflags(write=False)
    part_differences = None
    if antennas > 1 and modulation in _BY_PARTS:
        levels = np.unique(grid.real)
        steps, pairs = np.unique(np.rint(levels[:, None] - levels), return_counts=True)
        part_differences = np.stack([steps * scale, pairs])
    bits = antennas * float(np.log2(len(grid)))
    return DifferenceClasses(vectors, multiplicity, len(grid) ** antennas, bits, part_differences)
