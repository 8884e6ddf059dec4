"""Propositions 1 and 2: the sums of (15), their convex bounds and the derivatives of both.

Pure functions of arrays, per slot n (leading axis). Classes of equal exponents are merged, so
sums over m and k run over k classes with multiplicities; the zero class (m = k) adds the
constant rho^N and is left out here.
"""

import numpy as np

from faao_mav.arrays import Complex, Real


def trajectory_exponents(A: Real, w: Real, station: Real, altitude: float) -> Real:
    """Return D = rho_0 A / (||w - p||² + H²), (n, k).

    `A` (n, k) is rho_0 A_mk(n) in m², `w` (n, 2), `station` (2,) and `altitude` in metres.
    """
    return np.asarray(A / (_square_distance(w, station) + altitude**2)[:, None])


def trajectory_exponents_bound(A: Real, w: Real, w_i: Real, station: Real, altitude: float) -> Real:
    """Return D^lb of Proposition 1 about the trajectory `w_i`, (n, k).

    D is convex in y = ||w - p||², so its tangent in y lies below it; D^lb is concave in w.
    """
    y, y_i = _square_distance(w, station), _square_distance(w_i, station)
    d2 = y_i + altitude**2
    return np.asarray(A / d2[:, None] * (1 - (y - y_i) / d2)[:, None])


def trajectory_sum_gradient(
    A: Real, multiplicity: Real, w: Real, station: Real, altitude: float
) -> Real:
    """Return the gradient of F = sum of multiplicity exp(-D) in w, (25), (n, 2).

    (25) prints the derivative along ||w - p|| and with a minus in front: but F grows with the
    distance. Here the vector w - p takes the place of its norm, and the sign is the true one.
    """
    d2 = _square_distance(w, station) + altitude**2
    D = trajectory_exponents(A, w, station, altitude)
    slope = (multiplicity * A * np.exp(-D)).sum(axis=1) * 2 / d2**2
    return np.asarray(slope[:, None] * (w - station))


def trajectory_bound_gradient(
    A: Real, multiplicity: Real, w: Real, w_i: Real, station: Real, altitude: float
) -> Real:
    """Return the gradient of F^lb = sum of multiplicity exp(-D^lb) in w, (26), (n, 2)."""
    d2 = _square_distance(w_i, station) + altitude**2
    D = trajectory_exponents_bound(A, w, w_i, station, altitude)
    slope = (multiplicity * A * np.exp(-D)).sum(axis=1) * 2 / d2**2
    return np.asarray(slope[:, None] * (w - station))


def precoder_exponents(M: Complex, P: Complex, u: Complex, noise: float) -> Real:
    """Return C / (4 sigma²) with C = u^H P^H M P u, (n, k).

    `M` = H^H H (n, N, N), `P` (n, N, N) in sqrt(W), `u` (k, N), `noise` sigma² in W.
    """
    Pu = np.einsum("nab,kb->nka", P, u)
    C = np.einsum("nka,nab,nkb->nk", Pu.conj(), M, Pu, optimize=True).real
    return np.asarray(C / (4 * noise))


def precoder_exponents_bound(
    M: Complex, P: Complex, P_i: Complex, u: Complex, noise: float
) -> Real:
    """Return C^ap / (4 sigma²) of Proposition 2 about the precoders `P_i`, (n, k).

    C is a convex quadratic form of P, so its tangent plane C^ap lies below it.
    """
    b = np.einsum("nab,nbc,kc->nka", M, P_i, u, optimize=True)
    Pu = np.einsum("nab,kb->nka", P, u)
    P_i_u = np.einsum("nab,kb->nka", P_i, u)
    C_ap = np.einsum("nka,nka->nk", b.conj(), 2 * Pu - P_i_u).real
    return np.asarray(C_ap / (4 * noise))


def precoder_sum_gradient(
    M: Complex, multiplicity: Real, P: Complex, u: Complex, noise: float
) -> Complex:
    """Return the derivative (33) of E = sum of multiplicity exp(-C / 4 sigma²), (n, N, N).

    The change of E for a small change dP is the real part of sum(conj(derivative) dP).
    """
    weight = multiplicity * np.exp(-precoder_exponents(M, P, u, noise))
    return _precoder_slope(M, P, weight, u, noise)


def precoder_bound_gradient(
    M: Complex, multiplicity: Real, P: Complex, P_i: Complex, u: Complex, noise: float
) -> Complex:
    """Return the derivative (34) of E^ap = sum of multiplicity exp(-C^ap / 4 sigma²), (n, N, N)."""
    weight = multiplicity * np.exp(-precoder_exponents_bound(M, P, P_i, u, noise))
    return _precoder_slope(M, P_i, weight, u, noise)


def _precoder_slope(M: Complex, P: Complex, weight: Real, u: Complex, noise: float) -> Complex:
    scatter = np.einsum("nk,ka,kb->nab", weight, u, u.conj(), optimize=True)
    return np.asarray(-2 * (M @ P @ scatter) / (4 * noise))


def _square_distance(w: Real, station: Real) -> Real:
    return np.asarray(np.sum((w - station) ** 2, axis=-1))
