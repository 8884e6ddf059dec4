"""Convex problems over the feasible flights through CVXPY, in units that suit its solver.

With metres as the unit Clarabel fails on (27); with lengths in about 100 m, speeds in v_max and
accelerations in a_max every variable is of the order of one.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from faao_mav.errors import SolverError
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory

# The variables are scaled here already: Clarabel's own equilibration of the many exponential
# cones more often stalls it than helps. Where it does stall, shorter steps mostly get through.
_ATTEMPTS: tuple[dict[str, Any], ...] = (
    {"equilibrate_enable": False},
    {"equilibrate_enable": False, "max_step_fraction": 0.8},
    {"equilibrate_enable": True, "max_step_fraction": 0.6},
)

# A gap of 1e-4 is good enough to go on from; a limit broken by more than 1e-7 is not.
_REDUCED = {"reduced_tol_gap_abs": 1e-4, "reduced_tol_gap_rel": 1e-4, "reduced_tol_feas": 1e-7}


@dataclass(frozen=True, slots=True)
class FlightVariables:
    """w, v, a of (11)-(13f) as scaled variables, with their constraints."""

    kinematics: Kinematics
    w: cp.Variable
    v: cp.Variable
    a: cp.Variable
    constraints: list[Any]

    def trajectory(self) -> Trajectory:
        """Return the solved flight in SI units, exact in (11), (12) and (13d)."""
        kin = self.kinematics
        start = kin.start_velocity
        if start is None:
            start = np.asarray(self.v.value)[0] * kin.max_speed
        return kin.integrate(start, np.asarray(self.a.value) * kin.max_acceleration)


def flight_variables(kin: Kinematics) -> FlightVariables:
    """Return new variables under (11), (12), (13d)-(13f)."""
    n, dt = kin.slots, kin.time_step
    w, v, a = (cp.Variable((n, 2)) for _ in range(3))
    advance = kin.max_speed * dt / LENGTH
    bend = kin.max_acceleration * dt**2 / 2 / LENGTH
    gain = kin.max_acceleration * dt / kin.max_speed
    constraints = [
        w[1:] == w[:-1] + advance * v[:-1] + bend * a[:-1],
        v[1:] == v[:-1] + gain * a[:-1],
        w[0] == kin.start / LENGTH,
        w[-1] == kin.end / LENGTH,
        cp.norm(v, axis=1) <= 1,
        cp.norm(a[kin.first_bounded_acceleration :], axis=1) <= 1,
        a[-1] == 0,
    ]
    if np.isfinite(kin.max_airspeed):
        wind = np.array(kin.wind) / kin.max_speed
        constraints.append(cp.norm(v - wind, axis=1) <= kin.max_airspeed / kin.max_speed)
    if kin.start_velocity is not None:
        constraints.append(v[0] == kin.start_velocity / kin.max_speed)
    if kin.end_velocity is not None:
        constraints.append(v[-1] == kin.end_velocity / kin.max_speed)
    return FlightVariables(kin, w, v, a, constraints)


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
