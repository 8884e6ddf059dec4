"""Problem (27): the trajectory for given precoders, by successive convex approximation."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from faao_mav.arrays import Complex, Real
from faao_mav.errors import SolverError
from faao_mav.optimizer.algorithm1.exponential import merge_equal, shrink
from faao_mav.optimizer.algorithm1.surrogate import trajectory_exponents
from faao_mav.optimizer.kinematics import LENGTH, Trajectory
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.scaled import flight_variables, solve
from faao_mav.radio.rate import exponents

MAX_STEPS = 20
MIN_DECREASE = 1e-4
NEGLIGIBLE = 1e-12

Observer = Callable[[float], None]
"""Is told xi after every convex problem."""


@dataclass(frozen=True, slots=True)
class SumOfExponentials:
    """One link's constraint (16b) or (16c): its terms, and the constant that xi is offset by.

    `A` (N + 2, k) is rho_0 A_mk(n) in m², `offset` is O_j minus the (N + 2) rho^N_s zero terms.
    """

    link: Link
    A: Real
    offset: float

    def value(self, w: Real) -> float:
        """Return the sum over slots and non-zero classes of multiplicity exp(-D)."""
        D = trajectory_exponents(self.A, w, self.link.station, self.link.altitude)
        return float((self.link.classes.multiplicity * np.exp(-D)).sum())


def link_sum(link: Link, H_r: Complex, P: Complex) -> SumOfExponentials:
    """Return the sum of `link` for the fading H_r (N + 2, N_r, N_t) and the precoders P."""
    slots, classes = len(H_r), link.classes
    A = link.reference_gain * exponents(H_r, P, classes.vectors, link.noise)
    # O_B, O_U = 2 (N + 2) N_s log2 rho
    return SumOfExponentials(link, A, slots * (2 * classes.bits - classes.symbols))


def xi(sums: tuple[SumOfExponentials, ...], w: Real) -> float:
    """Return the least xi of (16) at the trajectory w: the larger of both constraints."""
    return max(s.value(w) - s.offset for s in sums)


def optimize_trajectory(
    problem: Problem,
    sums: tuple[SumOfExponentials, ...],
    flight: Trajectory,
    *,
    observe: Observer | None = None,
) -> Trajectory:
    """Solve (27) again and again about its last solution, from the feasible `flight`.

    Stops when xi falls by less than `MIN_DECREASE` of what is left above its floor (the xi of
    two faultless links), or after `MAX_STEPS`. xi never increases. Raises `SolverError` when
    Clarabel fails.
    """
    floor = max(-s.offset for s in sums)
    scale = len(flight.w) * max(s.link.classes.symbols for s in sums)
    current = xi(sums, flight.w)
    for _ in range(MAX_STEPS):
        gap = current - floor
        if gap <= NEGLIGIBLE * scale:
            break
        candidate = _solve_27(problem, sums, flight, floor, gap)
        reached = xi(sums, candidate.w)
        if reached < current:
            flight, current, decrease = candidate, reached, current - reached
        else:
            decrease = 0.0
        if observe is not None:
            observe(current)
        if decrease <= MIN_DECREASE * gap:
            break
    return flight


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
        sum_lb, more = _surrogate(s, last.w, flight.w, gap)
        constraints += [*more, sum_lb - (s.offset + floor) / gap <= objective]
    if solve(cp.Problem(cp.Minimize(objective), constraints)) == cp.INFEASIBLE:
        raise SolverError("Clarabel calls (27) infeasible, although a feasible flight is known")
    return flight.trajectory()


def _surrogate(
    s: SumOfExponentials, w_i: Real, w: cp.Variable, gap: float
) -> tuple[cp.Expression, list[Any]]:
    """Return F^lb / gap as an expression of the scaled positions w, with its constraints.

    D^lb = c (1 - q), q >= (||w - p||² - ||w_i - p||²) / d_i², so that one quadratic per slot
    serves all classes.
    """
    link = s.link
    y_i = np.sum((w_i - link.station) ** 2, axis=1)
    d2 = y_i + link.altitude**2
    c = s.A / d2[:, None]
    slot, c, multiplicity = merge_equal(c * shrink(c), link.classes.multiplicity)
    q = cp.Variable(len(w_i))
    offset = cp.multiply(LENGTH / np.sqrt(d2)[:, None] * np.ones(2), w - link.station / LENGTH)
    select = sp.csr_array((c, (np.arange(len(c)), slot)), shape=(len(c), len(w_i)))
    terms = cp.exp(select @ q - c + np.log(multiplicity / gap))
    return cp.sum(terms), [cp.sum(cp.square(offset), axis=1) - y_i / d2 <= q]
