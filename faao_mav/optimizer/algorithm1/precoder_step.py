"""Step 4 of Algorithm 1, problem (35): the precoders for given positions.

P_B(n) occurs in the first sum of (35) only and P_U(n) in the second only, so that minimising each
sum by itself solves (35): its xi is the larger of the two minima. Of the many solutions that (35)
has for the better link, this one is the best for that link too.

Proposition 2: C = u^H P^H M P u, M = H^H H, is a convex quadratic form of P, so that its tangent
plane C^ap lies below it.
"""

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from faao_mav.arrays import Complex, Real
from faao_mav.errors import SolverError
from faao_mav.optimizer.algorithm1.successive import (
    rounded,
    shrink,
    successive_approximation,
)
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.scaled import solve
from faao_mav.radio.rate import exponents


def optimize_precoders(link: Link, H: Complex, P: Complex) -> Complex:
    """Return precoders that minimise the sum of (15) of `link` within tr(P^H P) <= W.

    `H` (N + 2, N_r, N_t) are channels (1) or (2), `P` (N + 2, N_t, N_t) the precoders to start
    from, sqrt(W); the sum never increases. Raises `SolverError` where Clarabel fails.
    """

    def objective(precoders: Complex) -> float:
        C = exponents(H, precoders, link.classes.vectors, link.noise)
        return float((link.classes.multiplicity * np.exp(-C)).sum())

    return successive_approximation(
        P,
        objective,
        lambda last, gap: _solve_35(link, H, last, gap),
        floor=0.0,
        scale=len(P) * link.classes.symbols,
    )


def precoder_tangent(
    H: Complex, P_i: Complex, u: Complex, power: float, noise: float
) -> tuple[Real, Real]:
    """Return the tangent C^ap / (4 sigma²) = slope p - c of Proposition 2 about the precoders P_i.

    p (n, 2 N²) is [Re P, Im P] row by row, in units of sqrt(W), W = `power`. The slope is
    (n, k, 2 N²), c (n, k) are the exponents at P_i.
    """
    N = P_i.shape[1]
    b = np.einsum("nab,nbc,kc->nka", H.conj().mT @ H, P_i, u, optimize=True)
    z = b.conj()[..., :, None] * u[None, :, None, :]
    z = z.reshape(*z.shape[:2], N * N) * (2 * np.sqrt(power) / (4 * noise))
    return np.concatenate([z.real, -z.imag], axis=-1), exponents(H, P_i, u, noise)


def _solve_35(link: Link, H: Complex, P_i: Complex, scale: float) -> Complex:
    """Return the solution of the part of (35) that belongs to `link` about P_i.

    `scale`, the sum at P_i, is the unit of the objective.
    """
    slots, N = P_i.shape[:2]
    slope, c = precoder_tangent(H, P_i, link.classes.vectors, link.power, link.noise)
    factor = shrink(c)
    width = 2 * N * N
    terms = c.size
    rows = sp.csr_array(
        (
            rounded(slope * factor[..., None]).ravel(),
            (np.repeat(np.arange(slots), c.shape[1])[:, None] * width + np.arange(width)).ravel(),
            np.arange(terms + 1) * width,
        ),
        shape=(terms, slots * width),
    )
    p = cp.Variable((slots, width))
    weight = np.log(np.tile(link.classes.multiplicity, slots) / scale)
    at_zero = rounded((factor * c).ravel() + weight)
    total = cp.sum(cp.exp(at_zero - rows @ cp.vec(p, order="C")))
    if solve(cp.Problem(cp.Minimize(total), [cp.norm(p, axis=1) <= 1])) == cp.INFEASIBLE:
        raise SolverError("Clarabel calls (35) infeasible, although precoders are known")
    solved = np.asarray(p.value).reshape(slots, 2, N, N)
    P = solved[:, 0] + 1j * solved[:, 1]
    norm = np.maximum(np.linalg.norm(P, axis=(1, 2), keepdims=True), 1.0)
    return np.asarray(np.sqrt(link.power) * P / norm)
