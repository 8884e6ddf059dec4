"""Plan -> Solution, by the method that the plan asks for, at the best of the heights it allows.

Under the paper's law the lowest height is the best wherever the stations are; under a law with
terms over the elevation, over a map or beside ground it is not, and it may have several local
optima. Heights are tried at even distances, and those about each optimum to the end: each is a
whole plan, which begins with the flight of the last.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Unpack

import numpy as np

from faao_mav.errors import InfeasibleError, InputError, PlanError
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import OwnParts, build_problem
from faao_mav.optimizer.shadowing import shadowed, worth
from faao_mav.optimizer.solution import BestHeight, Observer, Solution, staged
from faao_mav.plan import Plan
from faao_mav.plan.fields import dbm
from faao_mav.plan.sections import Heights

_EVENLY = 9
"""Heights that are tried at first; local optima among them are then sought. Chosen."""

_DECIMALS = 1
"""Decimals of a height, m: missions and aircraft keep no finer one. Chosen."""

_TIE = 1e-3
"""What the share of a rate that was asked for counts, in steps of the duration: it decides between
equal ones alone. Chosen."""

Solve = Callable[[Plan, Trajectory | None], Solution]
"""How a plan of one height is solved, from the flight of a plan nearby where there is one."""


def optimize(plan: Plan, *, observe: Observer | None = None, **parts: Unpack[OwnParts]) -> Solution:
    """Optimise trajectory and precoders of `plan` by `optimizer.method`, for its `goal`.

    Where `flight.altitude` leaves the height open, it is the best: see `Solution.height`.
    `observe` is told the progress; `parts` are one's own, see `OwnParts`. Raises `PlanError` when
    the plan asks for more than the method can handle, `InfeasibleError` when no flight satisfies
    it, `InputError` for parts with a goal or Algorithm 1.

    >>> from faao_mav import read_plan
    >>> solution = optimize(read_plan("missions/copter_relay.yaml"))
    >>> solution.converged, solution.w.shape, solution.P_B.shape
    (True, (240, 2), (240, 2, 2))
    """
    if parts and (plan.goal.minimise or plan.goal.maximise == "data"):
        raise InputError(f"{', '.join(parts)}: a plan with a goal takes no parts of one's own")
    if parts and plan.optimizer.method == "algorithm1":
        raise InputError(f"{', '.join(parts)}: Algorithm 1 takes no parts of one's own")
    if isinstance(plan.flight.height, Heights):

        def at_height(candidate: Plan, known: Trajectory | None) -> Solution:
            told = staged(observe, f"height {candidate.flight.altitude:g} m")
            return _solved(candidate, told, known, **parts)

        return best_height(plan, at_height)
    return _solved(plan, observe, None, **parts)


def _solved(
    plan: Plan, observe: Observer | None, known: Trajectory | None, **parts: Unpack[OwnParts]
) -> Solution:
    """Return the solution of `plan`, of one height; of plans without a goal from `known` too."""
    if plan.goal.minimise or plan.goal.maximise == "data":
        from faao_mav.optimizer.goal import reach_goal

        return reach_goal(plan, observe=observe)
    problem = build_problem(plan, **parts)
    if plan.optimizer.method == "algorithm1":
        from faao_mav.optimizer.algorithm1 import algorithm1  # CVXPY takes half a second

        return algorithm1(problem, observe=observe)
    from faao_mav.optimizer.direct import direct

    return direct(problem, observe=observe, known=known)


def best_height(plan: Plan, solve: Solve) -> Solution:
    """Return the solution of `plan` at the best of its heights; it tells what other ones bring.

    The heights are those of `flight.altitude` between the floor and the ceiling of the vehicle's
    own fence. Raises `PlanError` where none is left, and what `solve` raises where no height has a
    flight.
    """
    from scipy.optimize import minimize_scalar

    low, high = _limits(plan)
    solved: dict[float, Solution] = {}
    worths: dict[float, float] = {}
    refused: list[Exception] = []

    def worth_at(height: float) -> float:
        at = round(float(height), _DECIMALS)
        if at not in worths:
            near = min(solved, key=lambda other: abs(other - at), default=None)
            known = None if near is None else solved[near].trajectory
            try:
                solved[at] = solve(plan.changed({"flight.altitude": at}), known)
                worths[at] = _worth(solved[at])
            except (InfeasibleError, PlanError) as error:
                refused.append(error)
                worths[at] = -math.inf
        return worths[at]

    grid = np.linspace(low, high, _EVENLY)
    values = np.array([-math.inf, *map(worth_at, grid), -math.inf])
    if not solved:
        raise refused[0]
    inner = values[1:-1]
    peaks = np.flatnonzero((inner >= values[:-2]) & (inner >= values[2:]) & np.isfinite(inner))
    least = float(inner[np.isfinite(inner)].min()) - 1.0  # instead of what has no flight
    for k in peaks.tolist():
        about = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        minimize_scalar(
            lambda height: -max(worth_at(height), least),
            bounds=about,
            method="bounded",
            options={"xatol": 10.0**-_DECIMALS},
        )
    best = solved[max(solved, key=worths.__getitem__)]
    at_low, at_high = (solved.get(round(end, _DECIMALS)) for end in (low, high))
    return replace(best, height=BestHeight(low, high, at_low, at_high, len(solved)))


def _limits(plan: Plan) -> tuple[float, float]:
    """Return the least and the greatest height that plan and vehicle's fence allow, m."""
    asked, (floor, ceiling) = plan.flight.height, plan.aircraft.fence_heights
    assert isinstance(asked, Heights)
    low, high = max(asked.least, floor), min(asked.most, ceiling)
    if low > high:
        raise PlanError(
            f"{plan.source}: flight.altitude: {asked.least:g} to {asked.most:g} m: the vehicle's "
            f"fence allows {floor:g} to {ceiling:g} m (vehicle.parameters); give heights in it"
        )
    return low, high


def _worth(solution: Solution) -> float:
    """Return what a plan is for, the more the better: a rate, what arrives, or less of its goal."""
    plan, goal = solution.plan, solution.plan.goal
    match goal.minimise:
        case "duration":  # of equal ones that which delivers most
            asked = plan.needed_rate / worth(solution)
            return -plan.flight.duration - _TIE * plan.flight.time_step * asked
        case "power":
            return -dbm(plan.powers[0])
        case "energy":
            assert solution.energy_wh is not None
            return -solution.energy_wh
    if goal.maximise == "data":
        return worth(solution) * plan.flight.duration
    if (under := shadowed(solution)) is not None:
        return under.worth
    return solution.maximised
