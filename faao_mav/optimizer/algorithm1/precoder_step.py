"""Problem (35): the precoders for a given trajectory, by successive convex approximation.

P_B(n) stands only in the first sum of (35) and P_U(n) only in the second, so that minimising
each sum by itself solves (35): its xi is the larger of the two minima. Of the many solutions
that (35) has for the link with room to spare, this is the one that serves that link best too.
"""

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from faao_mav.arrays import Complex, Real
from faao_mav.errors import SolverError
from faao_mav.optimizer.algorithm1.exponential import shrink
from faao_mav.optimizer.algorithm1.surrogate import precoder_exponents
from faao_mav.optimizer.algorithm1.trajectory_step import (
    MAX_STEPS,
    MIN_DECREASE,
    NEGLIGIBLE,
    Observer,
)
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.scaled import solve


def optimize_precoders(
    link: Link, H: Complex, P: Complex, *, observe: Observer | None = None
) -> Complex:
    """Minimise the sum of (15) of `link` over its precoders, from `P`, within tr(P^H P) <= W.

    `H` (N + 2, N_r, N_t) is (1) or (2), `P` (N + 2, N_t, N_t) in sqrt(W). Stops like
    `optimize_trajectory`; the sum never increases. `observe` is told the sum over the non-zero
    classes. Raises `SolverError` when Clarabel fails.
    """
    M = np.conj(np.swapaxes(H, -1, -2)) @ H

    def value(precoders: Complex) -> float:
        C = precoder_exponents(M, precoders, link.classes.vectors, link.noise)
        return float((link.classes.multiplicity * np.exp(-C)).sum())

    current = value(P)
    for _ in range(MAX_STEPS):
        if current <= NEGLIGIBLE * len(P) * link.classes.symbols:
            break
        candidate = _solve_35(link, M, P, current)
        reached = value(candidate)
        decrease = max(0.0, current - reached)
        if observe is not None:
            observe(min(current, reached))
        if reached < current:
            P = candidate
        done = decrease <= MIN_DECREASE * current
        current = min(current, reached)
        if done:
            break
    return P


def _solve_35(link: Link, M: Complex, P_i: Complex, scale: float) -> Complex:
    """Solve the part of (35) that belongs to `link`, about `P_i`."""
    slots, N = P_i.shape[:2]
    slope, c = _tangent(link, M, P_i)
    factor = shrink(c)
    width = 2 * N * N
    terms = c.size
    rows = sp.csr_array(
        (
            (slope * factor[..., None]).ravel(),
            (np.repeat(np.arange(slots), c.shape[1])[:, None] * width + np.arange(width)).ravel(),
            np.arange(terms + 1) * width,
        ),
        shape=(terms, slots * width),
    )
    p = cp.Variable((slots, width))
    weight = np.log(np.tile(link.classes.multiplicity, slots) / scale)
    total = cp.sum(cp.exp((factor * c).ravel() + weight - rows @ cp.vec(p, order="C")))
    if solve(cp.Problem(cp.Minimize(total), [cp.norm(p, axis=1) <= 1])) == cp.INFEASIBLE:
        raise SolverError("Clarabel calls (35) infeasible, although precoders are known")
    solved = np.asarray(p.value).reshape(slots, 2, N, N)
    P = solved[:, 0] + 1j * solved[:, 1]
    norm = np.maximum(np.linalg.norm(P, axis=(1, 2), keepdims=True), 1.0)
    return np.asarray(np.sqrt(link.power) * P / norm)


def _tangent(link: Link, M: Complex, P_i: Complex) -> tuple[Real, Real]:
    """Return C^ap / (4 sigma²) = slope p - c: slope (n, k, 2 N²) and c (n, k).

    p holds Re P and Im P row by row, in units of sqrt(W).
    """
    u, N = link.classes.vectors, P_i.shape[1]
    b = np.einsum("nab,nbc,kc->nka", M, P_i, u, optimize=True)
    z = b.conj()[..., :, None] * u[None, :, None, :]
    z = z.reshape(*z.shape[:2], N * N) * (2 * np.sqrt(link.power) / (4 * link.noise))
    return np.concatenate([z.real, -z.imag], axis=-1), precoder_exponents(M, P_i, u, link.noise)
