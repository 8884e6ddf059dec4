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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex
from faao_mav.errors import PlanError, SolverError
from faao_mav.optimizer.algorithm1.precoder_step import optimize_precoders
from faao_mav.optimizer.algorithm1.trajectory_step import link_sum, optimize_trajectory
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution
from faao_mav.radio.precoder import SCHEMES

MAX_CONES = 300_000
"""Exponential cones accepted in a convex problem: slots times classes, both links. Chosen."""


@dataclass(frozen=True, slots=True)
class _Iterate:
    """A trajectory and the precoders of both links, with R_avg of (9), bit/s/Hz."""

    flight: Trajectory
    precoders: list[Complex]
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
    iterates = [_iterate_at(problem, straight_flight(problem.kinematics))]
    converged, ending = False, f"max_iterations ({options.max_iterations}) reached"
    for iteration in range(1, options.max_iterations + 1):
        last, best = iterates[-1], max(iterate.rate for iterate in iterates)

        def tell(stage: str, iteration: int = iteration, best: float = best) -> None:
            if observe is not None:
                observe(Progress(iteration, options.max_iterations, stage, best))

        try:
            tell("trajectory (27)")
            sums = tuple(
                link_sum(link, link.small_scale(last.flight.w), P)
                for link, P in zip(problem.links, last.precoders, strict=True)
            )
            flight = optimize_trajectory(problem, sums, last.flight)
            tell("precoders (35)")
            iterates.append(_iterate_at(problem, flight, last.precoders))
        except SolverError as error:
            ending = f"stopped in iteration {iteration}, the best so far is kept: {error}"
            break
        if abs(iterates[-1].rate - last.rate) < options.tolerance:
            converged, ending = True, f"R_avg changed by less than {options.tolerance:g} bit/s/Hz"
            break
    found = max(reversed(iterates), key=lambda iterate: iterate.rate)
    history = [iterate.rate for iterate in iterates]
    return make_solution(
        problem, found.flight, found.precoders, history, converged=converged, ending=ending
    )


def _iterate_at(
    problem: Problem, flight: Trajectory, last: Sequence[Complex] | None = None
) -> _Iterate:
    """Return the iterate at `flight`: the plan's scheme, or (35) from `last`, or equal powers."""
    scheme = SCHEMES.get(problem.plan.optimizer.precoder)
    precoders, rates = [], []
    for number, link in enumerate(problem.links):
        H_r, N = link.small_scale(flight.w), link.transmit
        H = link.channel(flight.w, H_r)
        if scheme is not None:
            P = scheme(H, link.power, link.noise)
        elif last is not None:
            P = optimize_precoders(link, H, last[number])
        else:
            P = np.tile(np.sqrt(link.power / N) * np.eye(N) + 0j, (len(H), 1, 1))
        precoders.append(P)
        rates.append(float(link.rates(flight.w, H_r, P).mean()))
    return _Iterate(flight, precoders, min(rates))


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
