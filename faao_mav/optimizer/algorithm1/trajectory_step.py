"""Step 3 of Algorithm 1, problem (27): the trajectory for given precoders.

Proposition 1: the exponent D = rho_0 A / (||w - p||² + H²) of (16) is a convex function of
y = ||w - p||², so that its tangent in y, D^lb, lies below it and exp(-D^lb) above exp(-D); D^lb is
concave in w. (The gradients (25), (26) hold with the vector w - p in place of its norm and without
the minus sign: the sum of exponentials grows with the distance.)
"""

from dataclasses import dataclass
from typing import Any

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
from faao_mav.optimizer.kinematics import LENGTH, Trajectory
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.scaled import flight_variables, solve
from faao_mav.radio.rate import exponents


@dataclass(frozen=True, slots=True)
class SumOfExponentials:
    """The constraint (16b) or (16c) of one link.

    `A` (N + 2, k) is rho_0 A_mk(n) in m² for the k classes of differences. `offset` is O_B or O_U
    minus the (N + 2) rho^N_t terms of the zero class.
    """

    link: Link
    A: Real
    offset: float

    def value(self, w: Real) -> float:
        """Return the sum over slots and non-zero classes of multiplicity exp(-D) at w."""
        d2 = np.sum((w - self.link.gains.station) ** 2, axis=-1) + self.link.gains.height**2
        return float((self.link.classes.multiplicity * np.exp(-self.A / d2[:, None])).sum())


def link_sum(link: Link, H_r: Complex, P: Complex) -> SumOfExponentials:
    """Return the constraint of `link` for H_r (N + 2, N_r, N_t) and P (N + 2, N_t, N_t)."""
    slots, classes = len(H_r), link.classes
    rho_0 = link.gains.law.gain(np.ones(1), link.gains.height)
    A = rho_0 * exponents(H_r, P, classes.vectors, link.noise)
    # O_B, O_U = 2 (N + 2) N_t log2 rho
    return SumOfExponentials(link, A, slots * (2 * classes.bits - classes.symbols))


def xi(sums: tuple[SumOfExponentials, ...], w: Real) -> float:
    """Return the least xi of (16) at the trajectory w: the larger of both constraints."""
    return max(s.value(w) - s.offset for s in sums)


def optimize_trajectory(
    problem: Problem,
    sums: tuple[SumOfExponentials, ...],
    flight: Trajectory,
) -> Trajectory:
    """Solve (27) again and again about its last solution, from the feasible `flight`.

    The objective is xi, which never increases; its floor is the xi of two links without errors.
    Raises `SolverError` where Clarabel fails.
    """
    floor = max(-s.offset for s in sums)
    return successive_approximation(
        flight,
        lambda trajectory: xi(sums, trajectory.w),
        lambda last, gap: _solve_27(problem, sums, last, floor, gap),
        floor=floor,
        scale=len(flight.w) * max(s.link.classes.symbols for s in sums),
    )


def _solve_27(
    problem: Problem,
    sums: tuple[SumOfExponentials, ...],
    last: Trajectory,
    floor: float,
    gap: float,
) -> Trajectory:
    """Solve (27) about the flight `last`, with (xi - floor) / gap as the objective."""
    flight = flight_variables(problem.kinematics, last.v)
    objective = cp.Variable()
    constraints: list[Any] = list(flight.constraints)
    for s in sums:
        sum_lb, more = convex_bound(s, last.w, flight.w, gap)
        constraints += [*more, sum_lb - (s.offset + floor) / gap <= objective]
    if solve(cp.Problem(cp.Minimize(objective), constraints)) == cp.INFEASIBLE:
        raise SolverError("Clarabel calls (27) infeasible, although a feasible flight is known")
    return flight.trajectory()


def convex_bound(
    s: SumOfExponentials, w_i: Real, w: cp.Expression, gap: float
) -> tuple[cp.Expression, list[Any]]:
    """Return the sum of multiplicity exp(-D^lb) / gap about w_i (N + 2, 2), and its constraints.

    w (N + 2, 2) are positions in units of `LENGTH`. With c = D(w_i) the tangent of Proposition 1 is
    D^lb = c (1 - q), q >= (||w - p||² - ||w_i - p||²) / d_i²: one quadratic per slot serves all
    classes.
    """
    link = s.link
    y_i = np.sum((w_i - link.gains.station) ** 2, axis=1)
    d2 = y_i + link.gains.height**2
    c = s.A / d2[:, None]
    c = rounded(c * shrink(c))
    slot, classes = np.divmod(np.arange(c.size), c.shape[1])
    weight = rounded(np.log(link.classes.multiplicity / gap))[classes]
    q = cp.Variable(len(w_i))
    offset = cp.multiply(
        LENGTH / np.sqrt(d2)[:, None] * np.ones(2), w - link.gains.station / LENGTH
    )
    select = sp.csr_array((c.ravel(), (np.arange(c.size), slot)), shape=(c.size, len(w_i)))
    terms = cp.exp(select @ q - c.ravel() + weight)
    return cp.sum(terms), [cp.sum(cp.square(offset), axis=1) - y_i / d2 <= q]
