"""Real coordinates z of the Hermitian Z in u^H Z u = Σ_a φ_a z_a, and the features φ of u.

The coordinates are the diagonal of Z, then the real and then the imaginary parts of the entries
above it, row by row.
"""

import numpy as np

from faao_mav.arrays import Complex, Real


def features(u: Complex) -> Real:
    """Return φ (..., N²) of u (..., N): |u_i|², then Re and Im of 2 u_i u_j* for i < j."""
    i, j = np.triu_indices(u.shape[-1], 1)
    product = 2.0 * u[..., i] * u[..., j].conj()
    return np.concatenate([np.abs(u) ** 2, product.real, product.imag], axis=-1)


def coordinates(Z: Complex) -> Real:
    """Return the real coordinates z of Z, (..., N, N) to (..., N²)."""
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
