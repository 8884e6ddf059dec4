"""Algorithm 1 of the paper, as printed: alternating optimisation over (27) and (35).

Its objective is the sum of exponentials of (15), not the rate: the rate of an iterate may fall,
so the best iterate by R_avg is what is returned. Where the line of sight follows the UAV
(`ula`), H_r is held inside (27), as in the paper, and refreshed after it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import PlanError, SolverError
from faao_mav.optimizer.algorithm1.precoder_step import optimize_precoders
from faao_mav.optimizer.algorithm1.trajectory_step import link_sum, optimize_trajectory
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.start import straight_flight
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution
from faao_mav.radio.precoder import SCHEMES

MAX_CONES = 300_000
"""Exponential cones that a convex problem may have: slots times classes, both links."""


Pair = tuple[Complex, Complex]
"""An array for each link: BS to UAV, UAV to user."""


@dataclass(frozen=True, slots=True)
class _Iterate:
    flight: Trajectory
    fading: Pair
    precoders: Pair


def algorithm1(problem: Problem, *, observe: Observer | None = None) -> Solution:
    """Run Algorithm 1 on `problem` from the straight flight and equal-power precoders.

    `optimizer.precoder` other than `faao` replaces (35) by that scheme at the new positions:
    the paper's comparison. Raises `PlanError` when the alphabet makes the convex problems too
    large, and `InfeasibleError` when there is no flight at all.
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
            current = _iterate(problem, current, tell)
        except SolverError as error:
            ending = f"stopped in iteration {iteration}, the best so far is kept: {error}"
            break
        history.append(_rate(problem, current))
        if history[-1] >= max(history):
            best = current
        if abs(history[-1] - history[-2]) < options.tolerance:
            converged, ending = True, f"R_avg changed by less than {options.tolerance:g} bit/s/Hz"
            break
    return make_solution(
        problem,
        best.flight,
        best.fading,
        best.precoders,
        history,
        converged=converged,
        ending=ending,
    )


def _start(problem: Problem) -> _Iterate:
    flight = straight_flight(problem.kinematics)
    fading = _fading(problem, flight.w)
    scheme = problem.plan.optimizer.precoder
    if scheme != "faao":
        return _Iterate(flight, fading, _scheme_precoders(problem, scheme, flight.w, fading))
    slots = problem.kinematics.slots
    bs, relay = (
        np.tile(_equal_power(link.power, link.transmit), (slots, 1, 1)) for link in problem.links
    )
    return _Iterate(flight, fading, (bs, relay))


def _equal_power(power: float, antennas: int) -> Complex:
    return np.asarray(np.sqrt(power / antennas) * np.eye(antennas), dtype=np.complex128)


def _iterate(problem: Problem, last: _Iterate, tell: Callable[[str], None]) -> _Iterate:
    """Steps 3 and 4 of Algorithm 1."""
    scheme = problem.plan.optimizer.precoder
    tell("trajectory (27)")
    first, second = (
        link_sum(link, H_r, P)
        for link, H_r, P in zip(problem.links, last.fading, last.precoders, strict=True)
    )
    flight = optimize_trajectory(
        problem, (first, second), last.flight, observe=lambda _: tell("trajectory (27)")
    )
    fading = _fading(problem, flight.w)
    if scheme != "faao":
        return _Iterate(flight, fading, _scheme_precoders(problem, scheme, flight.w, fading))
    bs, relay = (
        optimize_precoders(
            link, link.channel(flight.w, H_r), P, observe=lambda _: tell("precoders (35)")
        )
        for link, H_r, P in zip(problem.links, fading, last.precoders, strict=True)
    )
    return _Iterate(flight, fading, (bs, relay))


def _fading(problem: Problem, w: Real) -> Pair:
    return problem.bs_uav.small_scale(w), problem.uav_user.small_scale(w)


def _scheme_precoders(problem: Problem, scheme: str, w: Real, fading: Pair) -> Pair:
    bs, relay = (
        SCHEMES[scheme](link.channel(w, H_r), link.power, link.noise)
        for link, H_r in zip(problem.links, fading, strict=True)
    )
    return bs, relay


def _rate(problem: Problem, iterate: _Iterate) -> float:
    return min(
        float(link.rates(iterate.flight.w, H_r, P).mean())
        for link, H_r, P in zip(problem.links, iterate.fading, iterate.precoders, strict=True)
    )


def _check_plan(problem: Problem) -> None:
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
    cones = problem.kinematics.slots * sum(len(k.classes.multiplicity) for k in problem.links)
    if cones > MAX_CONES:
        raise PlanError(
            f"{plan.source}: optimizer.method: algorithm1 would need {cones:,} exponential cones "
            f"for {plan.radio.modulation} over {problem.kinematics.slots:,} slots, at most "
            f"{MAX_CONES:,} are accepted; use a smaller alphabet, fewer antennas or a longer "
            "flight.time_step"
        )
