"""Convex problems over the feasible flights through CVXPY, in units that suit its solver.

With metres as the unit Clarabel fails on (27); with lengths in about 100 m, speeds in v_max and
accelerations in a_max every variable is of the order of one.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import SolverError
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory

_INSIDE = 1e-7  # by which the least speed is raised, for what the solver leaves open

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


def flight_variables(kin: Kinematics, about: Real | None = None) -> FlightVariables:
    """Return new variables under (11), (12), (13d)-(13f).

    `about`, feasible velocities (N + 2, 2) in m/s, adds the least speed: v(n) about v_i(n) on the
    far side of the half-plane v(n)^T v_i(n) >= v_min ||v_i(n)||, which is inside the true set.
    Without it the least speed is left out.
    """
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
    wind = np.array(kin.wind) / kin.max_speed
    if np.isfinite(kin.max_airspeed):
        constraints.append(cp.norm(v - wind, axis=1) <= kin.max_airspeed / kin.max_speed)
    if kin.start_velocity is not None:
        constraints.append(v[0] == kin.start_velocity / kin.max_speed)
    if kin.end_velocity is not None:
        constraints.append(v[-1] == kin.end_velocity / kin.max_speed)
    if about is not None and kin.min_speed > 0:
        ahead = about - kin.wind
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        free = slice(
            0 if kin.start_velocity is None else 1,
            kin.slots if kin.end_velocity is None else kin.slots - 1,
        )
        # given end velocities keep it already: twice said, they would leave no interior
        least = kin.min_speed / kin.max_speed * (1 + _INSIDE)
        along = cp.sum(cp.multiply(ahead, v - wind), axis=1)
        constraints.append(along[free] >= least)
        if np.isfinite(kin.most_fall):
            constraints += _slow_to_change(kin, about, along, v - wind)
        if kin.turn_binds:
            constraints.append(_slow_to_turn(kin, about, v, a))
    return FlightVariables(kin, w, v, a, constraints)


def _slow_to_change(kin: Kinematics, about: Real, along: Any, airspeed: Any) -> list[Any]:
    """Return that the airspeed changes no faster than thrust and drag let it, convex and inside.

    `along` (N + 2,) is the part of `airspeed` along that of the velocities `about`: never above its
    size, which it is to first order.
    """
    speed, first = np.hypot(*(about - kin.wind).T) / kin.max_speed, kin.first_bounded_acceleration
    fall = kin.most_fall * kin.time_step / kin.max_speed
    rise = 2 * kin.most_power * kin.time_step / kin.max_speed**2
    square = 2 * cp.multiply(speed, along) - speed**2
    return [
        (cp.norm(airspeed[:-1], axis=1) - along[1:])[first:] <= fall,
        (cp.sum(cp.square(airspeed[1:]), axis=1) - square[:-1])[first:] <= rise,
    ]


def _slow_to_turn(kin: Kinematics, about: Real, v: cp.Variable, a: cp.Variable) -> Any:
    """Return that turns keep `most_turn`, convex and inside: c^2 to first order about `about`."""
    at, first = about / kin.max_speed, kin.first_bounded_acceleration
    square = cp.sum(2 * cp.multiply(at, v) - at**2, axis=1)
    counts = (square[:-1] + square[1:]) / 2 + (kin.wind_in_turns / kin.max_speed) ** 2
    share = (kin.most_turn * kin.max_speed / kin.max_acceleration) ** 2
    return (cp.sum(cp.square(a[:-1]), axis=1) - share * counts)[first:] <= 0


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
