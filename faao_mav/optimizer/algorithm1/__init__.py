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
from faao_mav.optimizer.search.starts import straight_flight
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution
from faao_mav.radio.precoder import SCHEMES

MAX_CONES = 300_000
"""Exponential cones accepted in a convex problem: slots times classes, both links. Chosen."""

Pair = tuple[Complex, Complex]
"""An array for each link: BS to UAV, UAV to user."""


@dataclass(frozen=True, slots=True)
class _Iterate:
    """Trajectory, H_r and precoders after an iteration."""

    flight: Trajectory
    fading: Pair
    precoders: Pair


def algorithm1(problem: Problem, *, observe: Observer | None = None) -> Solution:
    """Return the best iterate of Algorithm 1 on `problem`.

    With an `optimizer.precoder` other than `faao`, that scheme at the new positions takes the place
    of (35): the paper's comparison. `observe` is told the progress after every convex problem.
    Raises `PlanError` for a plan that is not for Algorithm 1 or whose alphabet makes the problems
    too large, `InfeasibleError` where no flight satisfies the plan.
    """
    _check_plan(problem)
    options = problem.plan.optimizer
    best = current = _start(problem)
    history = [_rate(problem, current)]
    converged, ending = False, f"max_iterations ({options.max_iterations}) reached"
    for iteration in range(1, options.max_iterations + 1):

        def tell(stage: str, iteration: int = iteration) -> None:
            if observe is not None:
                observe(Progress(iteration, options.max_iterations, stage, max(history)))

        try:
            current = _next(problem, current, tell)
        except SolverError as error:
            ending = f"stopped in iteration {iteration}, the best so far is kept: {error}"
            break
        history.append(_rate(problem, current))
        if history[-1] >= max(history):
            best = current
        if abs(history[-1] - history[-2]) < options.tolerance:
            converged, ending = True, f"R_avg changed by less than {options.tolerance:g} bit/s/Hz"
            break
    made = (best.flight, best.fading, best.precoders)
    return make_solution(problem, *made, history, converged=converged, ending=ending)


def _start(problem: Problem) -> _Iterate:
    """Return the straight flight with equal-power precoders, sqrt(W / N) I, or the scheme's."""

    def equal_power(_: int, link: Link, H: Complex) -> Complex:
        N = link.transmit
        return np.tile(np.sqrt(link.power / N) * np.eye(N) + 0j, (len(H), 1, 1))

    return _iterate_at(problem, straight_flight(problem.kinematics), equal_power)


def _next(problem: Problem, last: _Iterate, tell: Callable[[str], None]) -> _Iterate:
    """Return the next iterate, by steps 3 and 4."""
    tell("trajectory (27)")
    both = zip(problem.links, last.fading, last.precoders, strict=True)
    sums = tuple(link_sum(*one) for one in both)
    flight = optimize_trajectory(
        problem, sums, last.flight, observe=lambda _: tell("trajectory (27)")
    )

    def best(number: int, link: Link, H: Complex) -> Complex:
        before = last.precoders[number]
        return optimize_precoders(link, H, before, observe=lambda _: tell("precoders (35)"))

    return _iterate_at(problem, flight, best)


def _iterate_at(
    problem: Problem, flight: Trajectory, precoders: Callable[[int, Link, Complex], Complex]
) -> _Iterate:
    """Return the iterate at `flight`, with the plan's scheme or else `precoders`.

    These are given for the number of a link, the link and its channels H, (1) or (2).
    """
    scheme = SCHEMES.get(problem.plan.optimizer.precoder)
    fading, chosen = [], []
    for number, link in enumerate(problem.links):
        H_r = link.small_scale(flight.w)
        H = link.channel(flight.w, H_r)
        fading.append(H_r)
        P = scheme(H, link.power, link.noise) if scheme else precoders(number, link, H)
        chosen.append(P)
    return _Iterate(flight, (fading[0], fading[1]), (chosen[0], chosen[1]))


def _rate(problem: Problem, iterate: _Iterate) -> float:
    """Return R_avg of (9), bit/s/Hz."""
    return min(
        float(link.rates(iterate.flight.w, H_r, P).mean())
        for link, H_r, P in zip(problem.links, iterate.fading, iterate.precoders, strict=True)
    )


def _check_plan(problem: Problem) -> None:
    """Raise `PlanError` for plans that Algorithm 1 is not made for."""
    plan = problem.plan
    if plan.radio.fading == "ergodic":
        raise PlanError(
            f"{plan.source}: radio.fading: ergodic is not for algorithm1, which plans for one "
            "known draw; use realization or none, or optimizer.method: direct"
        )
    if plan.optimizer.inputs == "gaussian":
        raise PlanError(
            f"{plan.source}: optimizer.inputs: gaussian is not for algorithm1, whose sums are "
            "those of an alphabet; use optimizer.method: direct"
        )
    if plan.optimizer.rate != "cutoff":
        raise PlanError(
            f"{plan.source}: optimizer.rate: {plan.optimizer.rate} is not for algorithm1, whose "
            "sums are those of the cutoff rate; use cutoff, or optimizer.method: direct"
        )
    cones = problem.kinematics.slots * sum(len(k.classes.multiplicity) for k in problem.links)
    if cones > MAX_CONES:
        raise PlanError(
            f"{plan.source}: optimizer.method: algorithm1 would need {cones:,} exponential cones "
            f"for {plan.radio.modulation} over {problem.kinematics.slots:,} slots, at most "
            f"{MAX_CONES:,} are accepted; use a smaller alphabet, fewer antennas or a longer "
            "flight.time_step"
        )
