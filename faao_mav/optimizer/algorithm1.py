"""Algorithm 1 of the paper, as printed: alternating optimisation over (27) and (35).

Step by step, with the paper's numbers:

1. Start: the straight flight and equal-power precoders; R_avg by (9), (10) of the cutoff rates (7),
   (8).
2. Repeat:
3. Problem (27), the trajectory for given precoders. Proposition 1: the exponent D of (16),
   rho_0 A / (||w - p||² + H²), is a convex function of y = ||w - p||², so that its tangent in y,
   D^lb, lies below it and exp(-D^lb) above exp(-D); D^lb is concave in w. (The gradients (25),
   (26) hold with the vector w - p in place of its norm and without the minus sign: the sum of
   exponentials grows with the distance.) The convex problem is solved again about its solution
   until xi settles.
4. Problem (35), the precoders for given positions. Proposition 2: C = u^H P^H M P u, M = H^H H, is
   a convex quadratic form of P, so that its tangent plane C^ap lies below it. P_B(n) occurs in the
   first sum only and P_U(n) in the second only, so that minimising each sum by itself solves (35).
5. R_avg of the new iterate, by (9), (10).
6. to 8. Until it changes by less than `optimizer.tolerance`.
9. Output.

Where the text leaves a choice: the objective of (27) and (35) is the sum of exponentials of (15),
not the rate, so that the rate of an iterate may fall; the best iterate by R_avg is returned. Where
the line of sight depends on the position (`ula`), H_r is constant within (27), as in the paper, and
recomputed after it.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from faao_mav.arrays import Complex, Real
from faao_mav.errors import PlanError, SolverError
from faao_mav.optimizer.design import Link
from faao_mav.optimizer.interior.constraint import Grid
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.rate import exponents

MAX_CONES = 300_000
"""Exponential cones accepted in a convex problem: slots times classes, both links. Chosen."""

_MIN_DECREASE = 1e-4
"""The decrease of the objective, relative to its gap, below which a step of Algorithm 1 ends.
Chosen: the paper gives no number."""

_NEGLIGIBLE = 1e-12
"""Gap of the objective, as a part of its largest value, that counts as zero: rounding errors."""

CAP = 40.0
"""Largest exponent that is handed to the solver: e^-40 is 4e-18."""

_DECIMALS = 6
"""Decimals of the exponents that are handed to the solver, and significant digits of the gap.

What is left of rounding errors, which differ from processor to processor, changes the number of the
solver's iterations, and its solution by up to 1e-3 m. Chosen: no decrease below `_MIN_DECREASE`
hangs on more.
"""

# The variables are scaled here already: Clarabel's own equilibration of the many exponential
# cones more often stalls it than helps. Where it does stall, shorter steps mostly get through.
_ATTEMPTS: tuple[dict[str, Any], ...] = (
    {"equilibrate_enable": False},
    {"equilibrate_enable": False, "max_step_fraction": 0.8},
    {"equilibrate_enable": True, "max_step_fraction": 0.6},
)

# A gap of 1e-4 is good enough to go on from; a limit broken by more than 1e-7 is not.
_REDUCED = {"reduced_tol_gap_abs": 1e-4, "reduced_tol_gap_rel": 1e-4, "reduced_tol_feas": 1e-7}

Point = TypeVar("Point")


def algorithm1(problem: Problem, *, observe: Observer | None = None) -> Solution:
    """Return the best iterate of Algorithm 1 on `problem`.

    With an `optimizer.precoder` other than `faao`, that scheme at the new positions takes the place
    of (35): the paper's comparison. `observe` is told the progress before every step. Raises
    `PlanError` for a plan that is not for Algorithm 1 or whose alphabet makes the problems too
    large, `InfeasibleError` where no flight satisfies the plan.
    """
    _check_plan(problem)
    options, links = problem.plan.optimizer, problem.links
    flight = straight_flight(problem.kinematics)
    equal = [np.sqrt(link.power / link.transmit) * np.eye(link.transmit) + 0j for link in links]
    precoders = [np.tile(P, (len(flight.w), 1, 1)) for P in equal]
    if options.precoder in SCHEMES:
        precoders = _precoders_at(problem, flight, precoders)

    def reached() -> float:  # R_avg of (9), bit/s/Hz
        return float(problem.rates(flight.w, precoders).mean(axis=1).min())

    history, best = [reached()], (flight, precoders)
    converged, ending = False, f"max_iterations ({options.max_iterations}) reached"

    def tell(stage: str) -> None:
        if observe is not None:
            observe(Progress(len(history), options.max_iterations, stage, max(history)))

    for _ in range(options.max_iterations):
        try:
            tell("trajectory (27)")
            hops = zip(links, precoders, strict=True)
            sums = [link_sum(link, link.small_scale(flight.w), P) for link, P in hops]
            flight = optimize_trajectory(problem, sums, flight)
            tell("precoders (35)")
            precoders = _precoders_at(problem, flight, precoders)
        except SolverError as error:
            ending = f"stopped in iteration {len(history)}, the best so far is kept: {error}"
            break
        history.append(reached())
        if history[-1] == max(history):
            best = flight, precoders
        if abs(history[-1] - history[-2]) < options.tolerance:
            converged, ending = True, f"R_avg changed by less than {options.tolerance:g} bit/s/Hz"
            break
    return make_solution(problem, *best, history, converged=converged, ending=ending)


def _precoders_at(problem: Problem, flight: Trajectory, last: Sequence[Complex]) -> list[Complex]:
    """Return the precoders of both links at `flight`: the plan's scheme, or (35) from `last`."""
    scheme, found = SCHEMES.get(problem.plan.optimizer.precoder), []
    for link, P in zip(problem.links, last, strict=True):
        H = link.channel(flight.w)
        new = scheme(H, link.power, link.noise) if scheme else optimize_precoders(link, H, P)
        found.append(new)
    return found


def _check_plan(problem: Problem) -> None:
    """Raise `PlanError` for plans that Algorithm 1 is not made for."""
    plan, links = problem.plan, problem.links
    inputs, rate = plan.optimizer.inputs, plan.optimizer.rate
    other_gain = any(not link.gains.square for link in links)
    for wrong, setting, reason in (
        (plan.radio.fading == "ergodic", "radio.fading: ergodic", "it plans for one known draw"),
        (inputs == "gaussian", "optimizer.inputs: gaussian", "its sums are those of an alphabet"),
        (rate != "cutoff", f"optimizer.rate: {rate}", "its sums are those of the cutoff rate"),
        (plan.vehicle.min_speed > 0, "vehicle.min_speed", "the paper's aircraft can hover"),
        (other_gain, "radio.gain", "its Proposition 1 is of a gain by the distance squared"),
    ):
        if wrong:
            raise PlanError(
                f"{plan.source}: {setting} is not for algorithm1, as {reason}; change it, or use "
                "optimizer.method: direct"
            )
    cones = problem.kinematics.slots * sum(len(link.classes.multiplicity) for link in links)
    if cones > MAX_CONES:
        raise PlanError(
            f"{plan.source}: optimizer.method: algorithm1 would need {cones:,} exponential cones "
            f"for {plan.radio.modulation} over {problem.kinematics.slots:,} slots, at most "
            f"{MAX_CONES:,} are accepted; use a smaller alphabet, fewer antennas or a longer "
            "flight.time_step"
        )


@dataclass(frozen=True, slots=True)
class SumOfExponentials:
    """The constraint (16b) or (16c) of one link.

    `A` (N + 2, k) is rho_0 A_mk(n) in m² for the k classes of differences. `offset` is O_B or O_U
    minus the (N + 2) rho^N_t terms of the zero class.
    """

    link: Link
    A: Real
    offset: float

    def excess(self, w: Real) -> float:
        """Return the sum over slots and non-zero classes of multiplicity exp(-D), less `offset`."""
        d2 = np.sum((w - self.link.gains.station) ** 2, axis=-1) + self.link.gains.height**2
        terms = self.link.classes.multiplicity * np.exp(-self.A / d2[:, None])
        return float(terms.sum()) - self.offset


def link_sum(link: Link, H_r: Complex, P: Complex) -> SumOfExponentials:
    """Return the constraint of `link` for H_r (N + 2, N_r, N_t) and P (N + 2, N_t, N_t)."""
    classes = link.classes
    rho_0 = np.exp(link.gains.law.log(np.ones(1), link.gains.height))
    A = rho_0 * exponents(H_r, P, classes.vectors, link.noise)
    # O_B, O_U = 2 (N + 2) N_t log2 rho
    return SumOfExponentials(link, A, len(H_r) * (2 * classes.bits - classes.symbols))


def optimize_trajectory(
    problem: Problem, sums: Sequence[SumOfExponentials], flight: Trajectory
) -> Trajectory:
    """Solve (27) again and again about its last solution, from the feasible `flight`.

    The objective is xi of (16), the larger of both constraints, which never increases; its floor is
    that of two links without errors.
    Raises `SolverError` where Clarabel fails.
    """
    kin, floor = problem.kinematics, max(-s.offset for s in sums)

    def solved(last: Trajectory, gap: float) -> Trajectory:
        """Solve (27) about the flight `last`, with (xi - floor) / gap as the objective."""
        flight, objective = FlightVariables(kin), cp.Variable()
        constraints: list[Any] = list(flight.constraints)
        for s in sums:
            sum_lb, quadratic = convex_bound(s, last.w, flight.w, gap)
            constraints += [quadratic, sum_lb - (s.offset + floor) / gap <= objective]
        minimize(objective, constraints)
        first = kin.start_velocity
        if first is None:
            first = np.asarray(flight.v.value)[0] * kin.max_speed
        return kin.integrate(first, np.asarray(flight.a.value) * kin.max_acceleration)

    return _successively(
        flight,
        lambda trajectory: max(s.excess(trajectory.w) for s in sums),
        solved,
        floor=floor,
        scale=len(flight.w) * max(s.link.classes.symbols for s in sums),
    )


def convex_bound(
    s: SumOfExponentials, w_i: Real, w: cp.Expression, gap: float
) -> tuple[cp.Expression, Any]:
    """Return the sum of multiplicity exp(-D^lb) / gap about w_i (N + 2, 2), and its constraint.

    w (N + 2, 2) are positions in units of `LENGTH`. With c = D(w_i) the tangent of Proposition 1 is
    D^lb = c (1 - q), q >= (||w - p||² - ||w_i - p||²) / d_i²: one quadratic per slot serves all
    classes.
    """
    gains = s.link.gains
    y_i = np.sum((w_i - gains.station) ** 2, axis=1)
    d2 = y_i + gains.height**2
    c = s.A / d2[:, None]
    c *= shrink(c)
    q = cp.Variable((len(w_i), 1))
    unit = LENGTH / np.sqrt(d2)[:, None] * np.ones(2)
    away = cp.multiply(unit, w - gains.station / LENGTH)
    quadratic = cp.sum(cp.square(away), axis=1) - y_i / d2 <= q[:, 0]
    return _exponentials(s.link, -c, c[..., None], q, gap), quadratic


def optimize_precoders(link: Link, H: Complex, P: Complex) -> Complex:
    """Return precoders that minimise the sum of (15) of `link` within tr(P^H P) <= W.

    `H` (N + 2, N_r, N_t) are channels (1) or (2), `P` (N + 2, N_t, N_t) the precoders to start
    from, sqrt(W); the sum never increases. Raises `SolverError` where Clarabel fails.
    """
    slots, N = P.shape[:2]

    def objective(precoders: Complex) -> float:
        C = exponents(H, precoders, link.classes.vectors, link.noise)
        return float((link.classes.multiplicity * np.exp(-C)).sum())

    def solved(P_i: Complex, gap: float) -> Complex:
        """Return the solution of the part of (35) that belongs to `link` about P_i."""
        slope, c = precoder_tangent(H, P_i, link.classes.vectors, link.power, link.noise)
        factor, p = shrink(c), cp.Variable((slots, 2 * N * N))
        total = _exponentials(link, factor * c, -factor[..., None] * slope, p, gap)
        minimize(total, [cp.norm(p, axis=1) <= 1])
        parts = np.asarray(p.value).reshape(slots, 2, N, N)
        P = parts[:, 0] + 1j * parts[:, 1]
        norm = np.maximum(np.linalg.norm(P, axis=(1, 2), keepdims=True), 1.0)
        return np.asarray(np.sqrt(link.power) * P / norm)

    return _successively(P, objective, solved, floor=0.0, scale=slots * link.classes.symbols)


def precoder_tangent(
    H: Complex, P_i: Complex, u: Complex, power: float, noise: float
) -> tuple[Real, Real]:
    """Return the tangent C^ap / (4 sigma²) = slope p - c of Proposition 2 about the precoders P_i.

    p (n, 2 N²) is [Re P, Im P] row by row, in units of sqrt(W), W = `power`. The slope is
    (n, k, 2 N²), c (n, k) are the exponents at P_i.
    """
    b = np.einsum("nab,nbc,kc->nka", H.conj().mT @ H, P_i, u, optimize=True)
    z = b.conj()[..., :, None] * u[None, :, None, :]
    z = z.reshape(*z.shape[:2], -1) * (2 * np.sqrt(power) / (4 * noise))
    return np.concatenate([z.real, -z.imag], axis=-1), exponents(H, P_i, u, noise)


def _exponentials(
    link: Link, constant: Real, slope: Real, x: cp.Variable, gap: float
) -> cp.Expression:
    """Return the sum over slots n and classes k of multiplicity exp(constant + slope x_n) / gap.

    Constants are (n, k), slopes (n, k, d), x (n, d). Both are rounded, the same on all processors.
    """
    weight = np.log(link.classes.multiplicity / gap)
    rows = sp.block_diag(np.round(slope, _DECIMALS), format="csr")
    return cp.sum(
        cp.exp(rows @ cp.vec(x, order="C") + np.round(constant + weight, _DECIMALS).ravel())
    )


def shrink(c: Real) -> Real:
    """Return the factor min(1, CAP / c) for exponents worth `c` at the point of expansion.

    Exponents of 10^4 make cones that no solver scales. Such a term is worth e^-10000 and may be
    replaced by any larger one that is negligible as well: t -> t CAP / c. For t >= 0 that raises
    e^-t; for t < 0 the term stays above 1, which the true term never exceeds. The surrogate remains
    an upper bound, with an error below e^-CAP at the point of expansion.

    >>> shrink(np.array([4.0, 400.0])).tolist()
    [1.0, 0.1]
    """
    return np.minimum(1.0, CAP / np.maximum(c, CAP))


def _successively(
    start: Point,
    objective: Callable[[Point], float],
    solve_about: Callable[[Point, float], Point],
    *,
    floor: float,
    scale: float,
) -> Point:
    """Return the point that repeated convex problems lead to from the feasible `start`.

    `objective`, the true value of a point, never increases; `floor` is a lower bound on it, the gap
    the distance to that, `scale` the largest possible gap. `solve_about` gives the solution of the
    convex problem about a point with a gap.
    """
    point, value = start, objective(start)
    while (gap := value - floor) > _NEGLIGIBLE * scale:
        candidate = solve_about(point, float(f"{gap:.{_DECIMALS}g}"))
        reached = objective(candidate)
        decrease = max(0.0, value - reached)
        if reached < value:
            point, value = candidate, reached
        if decrease <= _MIN_DECREASE * gap:
            break
    return point


class FlightVariables:
    """w, v, a (n, 2) under the `constraints` (11), (12), (13d)-(13f): in 100 m, v_max and a_max.

    With metres as the unit Clarabel fails on (27).
    """

    def __init__(self, kin: Kinematics) -> None:
        n, grid, wind = kin.slots, Grid.of(kin), np.array(kin.wind) / kin.max_speed
        self.w, self.v, self.a = w, v, a = [cp.Variable((n, 2)) for _ in range(3)]
        self.constraints: list[Any] = [
            w[1:] == w[:-1] + grid.advance * v[:-1] + grid.bulge * a[:-1],
            v[1:] == v[:-1] + grid.gain * a[:-1],
            w[0] == kin.start / LENGTH,
            w[-1] == kin.end / LENGTH,
            cp.norm(v, axis=1) <= 1,
            cp.norm(a[kin.first_bounded_acceleration :], axis=1) <= 1,
            a[-1] == 0,
        ]
        if np.isfinite(kin.max_airspeed):
            self.constraints.append(cp.norm(v - wind, axis=1) <= kin.max_airspeed / kin.max_speed)
        for end, velocity in ((0, kin.start_velocity), (-1, kin.end_velocity)):
            if velocity is not None:
                self.constraints.append(v[end] == velocity / kin.max_speed)


def minimize(objective: cp.Expression, constraints: list[Any]) -> cp.Problem:
    """Return the problem of the least `objective`, solved by Clarabel.

    Raises `SolverError` where all attempts fail, or where it finds the problem infeasible: flights
    that are solved about satisfy it.
    """
    problem = cp.Problem(cp.Minimize(objective), constraints)
    for attempt in _ATTEMPTS:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            try:
                problem.solve(
                    solver=cp.CLARABEL,
                    ignore_dpp=True,
                    canon_backend=cp.SCIPY_CANON_BACKEND,
                    **attempt,
                    **_REDUCED,
                )
            except cp.error.SolverError:
                continue
        if problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            return problem
        if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
            raise SolverError("Clarabel calls a convex problem infeasible that has a solution")
    raise SolverError("Clarabel made no progress on a convex problem")
