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
from faao_mav.optimizer.fence_geometry import FenceGeometry
from faao_mav.optimizer.interior.energy import EnergyLimit
from faao_mav.optimizer.interior.rewards import Stage
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.radio.relay import RelayQueue

_INSIDE = 1e-7  # by which the least speed is raised, for what the solver leaves open

# The variables are scaled here already: Clarabel's own equilibration of the many exponential
# cones more often stalls it than helps. Where it does stall, shorter steps mostly get through.
_ATTEMPTS: tuple[dict[str, Any], ...] = (
    {"equilibrate_enable": False},
    {"equilibrate_enable": False, "max_step_fraction": 0.8},
    {"equilibrate_enable": True, "max_step_fraction": 0.6},
)

# A gap of 1e-4 is good enough to go on from; a limit broken by more than 1e-7 is not.
_REDUCED_TOLERANCES = {
    "reduced_tol_gap_abs": 1e-4,
    "reduced_tol_gap_rel": 1e-4,
    "reduced_tol_feas": 1e-7,
}


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


def solve(problem: cp.Problem) -> str:
    """Solve with Clarabel and return the status: usable, or `cp.INFEASIBLE`.

    Raises `SolverError` for every other end of all attempts.
    """
    for attempt in _ATTEMPTS:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            try:
                problem.solve(
                    solver=cp.CLARABEL,
                    ignore_dpp=True,
                    canon_backend=cp.SCIPY_CANON_BACKEND,
                    **attempt,
                    **_REDUCED_TOLERANCES,
                )
            except cp.error.SolverError:
                continue
        if problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            return str(problem.status)
        if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
            return str(cp.INFEASIBLE)
    raise SolverError("Clarabel made no progress on a convex problem")


def _forwarded(
    relay: RelayQueue, rates: Real, time_step: float, unit: float, moved: list[Any]
) -> tuple[cp.Variable, list[Any]]:
    """Return the changes of what `relay` forwards, in `unit`, and what they have to keep.

    `rates` (2, n) are those now and `moved` (2, n) their changes in `unit`, to first order.
    """
    (I_U, I_G), n = rates, rates.shape[1]
    shares = relay.best_shares(I_U, I_G, time_step)
    now = relay.relayed(I_U, I_G, time_step, shares)
    received, forwarded, queue, turned = (cp.Variable(n) for _ in range(4))
    x = np.ones((2, n)) if shares is None else np.stack([shares, 1 - shares])
    spare_U, spare_G = x * rates - np.stack([now.received, now.forwarded])
    limits = [
        received <= spare_U / unit + cp.multiply(x[0], moved[0]) + cp.multiply(I_U, turned),
        forwarded <= spare_G / unit + cp.multiply(x[1], moved[1]) - cp.multiply(I_G, turned),
        forwarded - queue <= (now.queue - now.forwarded) / unit,
        received >= -now.received / unit,
        forwarded >= -now.forwarded / unit,
        queue[0] == 0,
        queue[1:] == (queue + received - forwarded)[:-1],
    ]
    if shares is None:
        limits.append(turned == 0)
    else:
        limits += [turned <= x[1] / unit, turned >= -x[0] / unit]
    if np.isfinite(relay.buffer):
        limits.append(queue <= (relay.buffer / time_step - now.queue) / unit)
    return forwarded, limits


def _within(limit: EnergyLimit, now: Trajectory, flight: FlightVariables) -> Any:
    """Return that `flight` keeps the energy `limit`, to first order about `now`."""
    kin, power = flight.kinematics, limit.partials(now.v.T, now.a.T)
    left = limit.most / limit.time_step - float(power.value.sum())
    by_v = cp.sum(cp.multiply(power.by_v.T, flight.v * kin.max_speed - now.v))
    by_a = cp.sum(cp.multiply(power.by_a.T, flight.a * kin.max_acceleration - now.a))
    unit = limit.most / limit.time_step
    return (by_v + by_a) / unit <= max(0.0, left) / unit


_NEAR = 3.0
"""The distance beyond the margin, in moves, from which a part of the fence is not in the way."""


def _apart(
    fence: FenceGeometry, kin: Kinematics, w: Real, shift: cp.Variable, reach: float
) -> list[Any]:
    """Return that the ends of every chord stay apart from the fence, for moves `reach` `shift`.

    For a chord and an obstacle near it, with the angle d by which its half-plane u turns,

        u . (w + reach shift - p) + d u' . (w - p) >= radius + room  for both ends and all corners p
    """
    free = np.ones(kin.slots, dtype=np.bool_)
    free[[0, -1]] = False
    room, limits = fence.room(kin), []
    obstacles = fence.obstacles
    if len(obstacles):
        u, h = obstacles.separation(w.T[:, None, :-1], w.T[:, None, 1:])
        u, h = u[:, :, 0], h[:, 0]
        left = np.minimum(*(np.einsum("cpn,nc->pn", u, end) for end in (w[:-1], w[1:]))) - h - room
        piece, slot = np.nonzero(left < _NEAR * reach)
        if piece.size:
            u, angle = u[:, piece, slot].T, cp.Variable(len(piece))
            across = np.stack([-u[:, 1], u[:, 0]], axis=1)
            for end in (slot, slot + 1):
                on = np.flatnonzero(free[end])
                for corner in obstacles.corners[piece].transpose(1, 0, 2):
                    away = w[end] - corner
                    least = obstacles.radius[piece] + room[slot] - np.einsum("mc,mc->m", u, away)
                    lever = np.einsum("mc,mc->m", across, away)
                    moved = cp.sum(cp.multiply(u[on], shift[end[on]]), axis=1)
                    turned = cp.multiply(lever[on] / reach, angle[on])
                    limits.append(moved + turned >= least[on] / reach)
    most = np.maximum(np.append(room, 0), np.insert(room, 0, 0))
    for normal, offset in zip(fence.normals, fence.offsets, strict=True):
        left = (offset - most - w @ normal) / reach
        near = np.flatnonzero((left < _NEAR) & free)
        if near.size:
            limits.append(shift[near] @ normal <= left[near])
    return limits


def kkt_residual(
    kin: Kinematics,
    stage: Stage,
    trajectory: Trajectory,
    *,
    reach: float = 1.0,
    relay: RelayQueue | None = None,
    fence: FenceGeometry | None = None,
    energy: EnergyLimit | None = None,
) -> float:
    """Return the best first-order gain of min_j F_j per metre, in rewards per metre.

        max  (min_j (F_j + G_j . d) - min_j F_j) / reach  over the feasible flights w + d
             with |d_n| <= `reach` metres in x and in y, G_j the gradient of F_j

    With `relay` it is the gain of the rate that it delivers of both rewards: with whatever is
    received, forwarded and held best after the move, and with other shares, whose product with the
    change of a rate is of second order and left out.

    With `fence` the distances of the path from what it has to keep out of are linear in the move,
    and in the turn of the half-planes that part it from them.

    With `energy` what the flight takes is linear in the move, with the power's own derivatives.

    Linearised so, the feasible set is convex, and this is zero exactly where the conditions of
    Karush, Kuhn and Tucker hold. It is a convex problem: its optimum is that of Clarabel, to about
    1e-8 of the largest gradient. Raises `SolverError` where Clarabel finds none.
    """
    values = stage(trajectory.w.T)
    total = values.value.mean(axis=1)
    slots = values.value.shape[1]
    unit = float(np.abs(values.gradient).max())
    if unit == 0:
        return 0.0
    flight = flight_variables(kin, about=trajectory.v)
    shift = (flight.w - trajectory.w / LENGTH) * (LENGTH / reach)
    moved = [
        cp.sum(cp.multiply(gradient.T / unit, shift), axis=1)
        for gradient in np.moveaxis(values.gradient, 1, 0)
    ]
    gain = cp.Variable()
    limits = [*flight.constraints, cp.abs(shift) <= 1]
    if relay is None:
        above = (total - total.min()) / (unit * reach)
        limits += [gain <= a + cp.sum(m) / slots for a, m in zip(above, moved, strict=True)]
    else:
        forwarded, queue = _forwarded(relay, values.value, kin.time_step, unit * reach, moved)
        limits += [*queue, gain == cp.sum(forwarded) / slots]
    if fence is not None:
        limits += _apart(fence, kin, trajectory.w, shift, reach)
    if energy is not None:
        limits.append(_within(energy, trajectory, flight))
    problem = cp.Problem(cp.Maximize(gain), limits)
    if solve(problem) == cp.INFEASIBLE:
        raise SolverError("the flight given breaks its limits")
    return max(0.0, float(problem.value)) * unit
