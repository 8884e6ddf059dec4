"""Real coordinates z of the Hermitian Z in u^H Z u = Σ_a φ_a z_a, and the features φ of u.

The coordinates are the diagonal of Z, then the real and imaginary parts of the entries above it.
"""

from itertools import combinations

import numpy as np

from faao_mav.arrays import Complex, Real


def features(u: Complex) -> Real:
    """Return φ (..., N²) of u (..., N): |u_i|², then Re and Im of 2 u_i u_j* for i < j."""
    antennas = u.shape[-1]
    columns = [np.abs(u[..., i]) ** 2 for i in range(antennas)]
    for i, j in combinations(range(antennas), 2):
        product = 2.0 * u[..., i] * u[..., j].conj()
        columns += [product.real, product.imag]
    return np.stack(columns, axis=-1)


def coordinates(Z: Complex) -> Real:
    """Return the real coordinates z of Z, (..., N, N) to (..., N²)."""
    antennas = Z.shape[-1]
    columns = [Z[..., i, i].real for i in range(antennas)]
    for i, j in combinations(range(antennas), 2):
        columns += [Z[..., i, j].real, Z[..., i, j].imag]
    return np.stack(columns, axis=-1)


def outer(phi: Real) -> Complex:
    """Return the Hermitian u u^H (..., N, N), or a mean of it, of the features φ (..., N²)."""
    antennas = round(phi.shape[-1] ** 0.5)
    M = np.empty((*phi.shape[:-1], antennas, antennas), dtype=np.complex128)
    for i in range(antennas):
        M[..., i, i] = phi[..., i]
    for k, (i, j) in enumerate(combinations(range(antennas), 2)):
        at = antennas + 2 * k
        M[..., i, j] = (phi[..., at] + 1j * phi[..., at + 1]) / 2
        M[..., j, i] = M[..., i, j].conj()
    return M
