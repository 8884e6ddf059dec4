"""Real coordinates of the Hermitian Z in u^H Z u, and what multiplies them.

With the N² Hermitian B_a, Z has the real coordinates z_a and u u^H = Σ_a φ_a B_a, so that
u^H Z u = Σ_a φ_a z_a is linear in z.
"""

from itertools import combinations

import numpy as np

from faao_mav.arrays import Complex, Real


def basis(antennas: int) -> Complex:
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
