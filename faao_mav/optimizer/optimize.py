"""Plan -> Solution, by the method that the plan asks for."""

from typing import Unpack

from faao_mav.errors import InputError
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import OwnParts, build_problem
from faao_mav.optimizer.solution import Observer, Solution, staged
from faao_mav.plan import Plan
from faao_mav.plan.sections import Heights


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
        from faao_mav.optimizer.height import best_height  # brings scipy.optimize along

        def at_height(candidate: Plan, known: Trajectory | None) -> Solution:
            told = staged(observe, f"height {candidate.flight.altitude:g} m")
            return _solved(candidate, told, known, **parts)

        return best_height(plan, at_height)
    return _solved(plan, observe, None, **parts)


def _solved(
    plan: Plan,
    observe: Observer | None,
    known: Trajectory | None,
    **parts: Unpack[OwnParts],
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
