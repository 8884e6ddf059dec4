"""What a flight is to be: the options that name a plan or its solution."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

from faao_mav.cli.shared import File, option
from faao_mav.errors import InputError

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution

PlanFile: TypeAlias = Annotated[
    File,
    option(
        "PLAN.yaml",
        "The plan: its vehicle, its limits, and the link that it is to deliver.",
        "--plan",
    ),
]
SolutionFile: TypeAlias = Annotated[
    File,
    option(
        "RESULT.npz",
        "Instead of --plan: what --save wrote, with the plan in it, already solved.",
        "--solution",
    ),
]


def planned(plan_file: Path | None, solution_file: Path | None) -> "Solution | None":
    """Return the solution saved, or that of the plan; None without either.

    Raises `InputError` where both are given.
    """
    if plan_file is not None and solution_file is not None:
        raise InputError("--plan and --solution: give one; the solution has its plan in it")
    if solution_file is not None:
        from faao_mav.optimizer.solution import load_solution

        return load_solution(solution_file)
    if plan_file is None:
        return None
    from faao_mav.cli.progress import optimizer_progress
    from faao_mav.optimizer.optimize import optimize
    from faao_mav.plan import read_plan

    plan = read_plan(plan_file)
    with optimizer_progress(shown=sys.stderr.isatty()) as observe:
        return optimize(plan, observe=observe)
