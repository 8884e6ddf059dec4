"""How far a flight is from a local optimum, found without the multipliers of its solver."""

import numpy as np

from faao_mav.errors import SolverError
from faao_mav.optimizer.interior.rewards import LENGTH, Stage
from faao_mav.optimizer.kinematics import Kinematics, Trajectory


def kkt_residual(
    kin: Kinematics, stage: Stage, trajectory: Trajectory, *, reach: float = 1.0
) -> float:
    """Return the best first-order gain of min_j F_j per metre, in rewards per metre.

        max  (min_j (F_j + G_j . d) - min_j F_j) / reach  over the feasible flights w + d
             with |d_n| <= `reach` metres in x and in y, G_j the gradient of F_j

    The feasible set is convex, so that this is zero exactly where the conditions of Karush, Kuhn
    and Tucker hold. It is a convex problem: its optimum is that of Clarabel, to about 1e-8 of
    the largest gradient. Raises `SolverError` where Clarabel finds none.
    """
    import cvxpy as cp

    from faao_mav.optimizer.scaled import flight_variables, solve

    values = stage(trajectory.w.T)
    total = values.value.mean(axis=1)
    slots = values.value.shape[1]
    unit = float(np.abs(values.gradient).max())
    if unit == 0:
        return 0.0
    flight = flight_variables(kin)
    shift = (flight.w - trajectory.w / LENGTH) * (LENGTH / reach)
    gains = [
        (above / (unit * reach)) + cp.sum(cp.multiply(gradient.T / (unit * slots), shift))
        for above, gradient in zip(
            total - total.min(), np.moveaxis(values.gradient, 1, 0), strict=True
        )
    ]
    gain = cp.Variable()
    problem = cp.Problem(
        cp.Maximize(gain),
        [*flight.constraints, cp.abs(shift) <= 1, *(gain <= each for each in gains)],
    )
    if solve(problem) == cp.INFEASIBLE:
        raise SolverError("the flight given breaks its limits")
    return max(0.0, float(problem.value)) * unit
