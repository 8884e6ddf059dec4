"""Algorithm 1 of the paper, as printed: alternating optimisation over (27) and (35).

Step by step, with the paper's numbers:

1. Start: the straight flight and equal-power precoders; R_avg by (9), (10) of the cutoff rates (7),
   (8).
2. Repeat:
3. Problem (27), the trajectory for given precoders: `trajectory_step`. Proposition 1 replaces each
   exponent D of (16) by its tangent D^lb; the convex problem is solved again about its solution
   until xi settles (`successive`).
4. Problem (35), the precoders for given positions: `precoder_step`, with the tangent C^ap of
   Proposition 2, solved again about its solution.
5. R_avg of the new iterate, by (9), (10).
6. to 8. Until R_avg changes by less than `optimizer.tolerance`.
9. Output.

Where the text leaves a choice: the objective of (27) and (35) is the sum of exponentials of (15),
not the rate, so that the rate of an iterate may fall; the best iterate by R_avg is returned. Where
the line of sight depends on the position (`ula`), H_r is constant within (27), as in the paper, and
recomputed after it. (35) falls apart into one problem per link.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex
from faao_mav.errors import PlanError, SolverError
from faao_mav.optimizer.algorithm1.precoder_step import optimize_precoders
from faao_mav.optimizer.algorithm1.trajectory_step import link_sum, optimize_trajectory
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution
from faao_mav.radio.precoder import SCHEMES

MAX_CONES = 300_000
"""Exponential cones accepted in a convex problem: slots times classes, both links. Chosen."""


@dataclass(frozen=True, slots=True)
class _Iterate:
    """A trajectory, and for both links H_r and the precoders, with R_avg of (9), bit/s/Hz."""

    flight: Trajectory
    fading: tuple[Complex, Complex]
    precoders: tuple[Complex, Complex]
    rate: float


def algorithm1(problem: Problem, *, observe: Observer | None = None) -> Solution:
    """Return the best iterate of Algorithm 1 on `problem`.

    With an `optimizer.precoder` other than `faao`, that scheme at the new positions takes the place
    of (35): the paper's comparison. `observe` is told the progress before every step. Raises
    `PlanError` for a plan that is not for Algorithm 1 or whose alphabet makes the problems too
    large, `InfeasibleError` where no flight satisfies the plan.
    """
    _check_plan(problem)
    options = problem.plan.optimizer

    def equal_power(_: int, link: Link, H: Complex) -> Complex:
        N = link.transmit
        return np.tile(np.sqrt(link.power / N) * np.eye(N) + 0j, (len(H), 1, 1))

    iterates = [_iterate_at(problem, straight_flight(problem.kinematics), equal_power)]
    converged, ending = False, f"max_iterations ({options.max_iterations}) reached"
    for iteration in range(1, options.max_iterations + 1):

        def tell(stage: str, iteration: int = iteration) -> None:
            if observe is not None:
                best = max(iterate.rate for iterate in iterates)
                observe(Progress(iteration, options.max_iterations, stage, best))

        try:
            iterates.append(_next(problem, iterates[-1], tell))
        except SolverError as error:
            ending = f"stopped in iteration {iteration}, the best so far is kept: {error}"
            break
        if abs(iterates[-1].rate - iterates[-2].rate) < options.tolerance:
            converged, ending = True, f"R_avg changed by less than {options.tolerance:g} bit/s/Hz"
            break
    best = max(reversed(iterates), key=lambda iterate: iterate.rate)
    history = [iterate.rate for iterate in iterates]
    return make_solution(
        problem, best.flight, best.precoders, history, converged=converged, ending=ending
    )


def _next(problem: Problem, last: _Iterate, tell: Callable[[str], None]) -> _Iterate:
    """Return the next iterate, by steps 3 and 4."""
    tell("trajectory (27)")
    both = zip(problem.links, last.fading, last.precoders, strict=True)
    flight = optimize_trajectory(problem, tuple(link_sum(*one) for one in both), last.flight)
    tell("precoders (35)")
    return _iterate_at(
        problem, flight, lambda j, link, H: optimize_precoders(link, H, last.precoders[j])
    )


def _iterate_at(
    problem: Problem, flight: Trajectory, precoders: Callable[[int, Link, Complex], Complex]
) -> _Iterate:
    """Return the iterate at `flight`, with the plan's scheme or else `precoders`.

    These are given for the number of a link, the link and its channels H, (1) or (2).
    """
    scheme = SCHEMES.get(problem.plan.optimizer.precoder)
    fading, chosen, rates = [], [], []
    for number, link in enumerate(problem.links):
        H_r = link.small_scale(flight.w)
        H = link.channel(flight.w, H_r)
        P = scheme(H, link.power, link.noise) if scheme else precoders(number, link, H)
        fading.append(H_r)
        chosen.append(P)
        rates.append(float(link.rates(flight.w, H_r, P).mean()))
    return _Iterate(flight, (fading[0], fading[1]), (chosen[0], chosen[1]), min(rates))


def _check_plan(problem: Problem) -> None:
    """Raise `PlanError` for plans that Algorithm 1 is not made for."""
    plan = problem.plan
    for refused, setting, reason in (
        (plan.radio.fading == "ergodic", "radio.fading: ergodic", "it plans for one known draw"),
        (
            plan.optimizer.inputs == "gaussian",
            "optimizer.inputs: gaussian",
            "its sums are those of an alphabet",
        ),
        (
            plan.optimizer.rate != "cutoff",
            f"optimizer.rate: {plan.optimizer.rate}",
            "its sums are those of the cutoff rate",
        ),
        (
            any(link.gains.above or not link.gains.law.square for link in problem.links),
            "radio.gain",
            "its Proposition 1 is of a gain that falls by the square of the distance",
        ),
    ):
        if refused:
            raise PlanError(
                f"{plan.source}: {setting} is not for algorithm1, as {reason}; change it, or use "
                "optimizer.method: direct"
            )
    cones = problem.kinematics.slots * sum(len(k.classes.multiplicity) for k in problem.links)
    if cones > MAX_CONES:
        raise PlanError(
            f"{plan.source}: optimizer.method: algorithm1 would need {cones:,} exponential cones "
            f"for {plan.radio.modulation} over {problem.kinematics.slots:,} slots, at most "
            f"{MAX_CONES:,} are accepted; use a smaller alphabet, fewer antennas or a longer "
            "flight.time_step"
        )
