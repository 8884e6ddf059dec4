"""How much a flight can still gain to first order: a certificate of optimality by convex programs.

It is found by Clarabel from the flight alone, without the multipliers of the method that made it.
"""

from typing import Any

import cvxpy as cp
import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.fence_geometry import FenceGeometry
from faao_mav.optimizer.interior.constraint import Grid, unknowns
from faao_mav.optimizer.interior.maximize import constraints_of
from faao_mav.optimizer.interior.rewards import Stage
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.scaled import flight_variables, minimize
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.relay import RelayQueue


def still_gained(solution: Solution) -> float:
    """Return the `kkt_residual` of `solution`, in what its plan maximises, bit/s/Hz/m."""
    problem = solution.problem
    return kkt_residual(
        problem.kinematics,
        rate_field(problem, design(solution.plan)),
        solution.trajectory,
        relay=problem.maximised_queue,
        fence=problem.fence,
    )


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
        u, h = obstacles.separation(w.T[:, :-1], w.T[:, 1:])
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


def _never_slow(kin: Kinematics, flight: Trajectory, moved: Any) -> list[Any]:
    """Return the limits of an aircraft that cannot hover, linear in its move from `flight`."""
    x, grid, limits = unknowns(kin, flight), Grid.of(kin), list[Any]()
    by_slot = cp.hstack([moved.w, moved.v, moved.a]).T - x
    for limit in constraints_of(kin) if kin.min_speed > 0 else ():
        rows = limit.rows(x[list(limit.of)])
        for value, slope, on in zip(
            rows.value, rows.slope, limit.on(grid, len(rows.value)), strict=True
        ):
            change = sum(cp.multiply(slope[k], by_slot[i]) for k, i in enumerate(limit.of))
            limits.append((value + change)[np.flatnonzero(on)] >= 0)
    return limits


def kkt_residual(
    kin: Kinematics,
    stage: Stage,
    trajectory: Trajectory,
    *,
    reach: float = 1.0,
    relay: RelayQueue | None = None,
    fence: FenceGeometry | None = None,
) -> float:
    """Return the best first-order gain of min_j F_j per metre, in rewards per metre.

        max  (min_j (F_j + G_j . d) - min_j F_j) / reach  over the feasible flights w + d
             with |d_n| <= `reach` metres in x and in y, G_j the gradient of F_j

    With `relay` it is the gain of the rate that it delivers of both rewards: with whatever is
    received, forwarded and held best after the move, and with other shares, whose product with the
    change of a rate is of second order and left out.

    With `fence` the distances of the path from what it has to keep out of are linear in the move,
    and in the turn of the half-planes that part it from them.

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
    flight = flight_variables(kin)
    shift = (flight.w - trajectory.w / LENGTH) * (LENGTH / reach)
    moved = [
        cp.sum(cp.multiply(gradient.T / unit, shift), axis=1)
        for gradient in np.moveaxis(values.gradient, 1, 0)
    ]
    gain = cp.Variable()
    limits = [*flight.constraints, *_never_slow(kin, trajectory, flight), cp.abs(shift) <= 1]
    if relay is None:
        above = (total - total.min()) / (unit * reach)
        limits += [gain <= a + cp.sum(m) / slots for a, m in zip(above, moved, strict=True)]
    else:
        forwarded, queue = _forwarded(relay, values.value, kin.time_step, unit * reach, moved)
        limits += [*queue, gain == cp.sum(forwarded) / slots]
    if fence is not None:
        limits += _apart(fence, kin, trajectory.w, shift, reach)
    return max(0.0, -float(minimize(-gain, limits).value)) * unit
