"""Plan -> Solution, by the method that the plan asks for."""

from faao_mav.faao.algorithm1 import Observer, algorithm1
from faao_mav.faao.problem import build_problem
from faao_mav.faao.solution import Solution
from faao_mav.plan import Plan


def optimize(plan: Plan, *, observe: Observer | None = None) -> Solution:
    """Optimise trajectory and precoders of `plan` by `optimizer.method`.

    `observe` is told the progress. Raises `PlanError` when the plan asks for more than the
    method can handle, `InfeasibleError` when no flight satisfies it.
    """
    return algorithm1(build_problem(plan), observe=observe)
