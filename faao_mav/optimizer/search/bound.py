"""What no trajectory and no precoder can exceed.

Given its position a slot's best rate falls with the distance r to the station. Any line that lies
above that curve over the distances the UAV can have at that instant, with a slope of at most zero,
is a concave function of the position; so is the lowest of many such lines. Maximising the smaller
mean of these majorants over all flights is a convex problem, whose value bounds R_avg of every
trajectory under (11)-(13f) and every precoder under (13b), (13c).

The shorter the range of distances, the lower the majorant. A known plan shortens it: a flight that
is far away at one instant is not near at the next, and loses more rate on its way out and back than
it may if it is to be better than that plan.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.kinematics import LENGTH, Kinematics
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.rates.mode_rate import has_few_modes, mode_rate
from faao_mav.optimizer.rates.rate_model import best_curve
from faao_mav.radio.best_precoder import best_precoders

_LINES = 64
_DISTANCES = 600
_SEARCHED = 25
_DIRECTIONS = 257
_WEIGHTS = (0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.7)
_BISECTIONS = 11
_BLOCKS = 150
_PASSES = 2
_CELLS = 12
_MOST_SLOTS = 2_000


@dataclass(frozen=True, slots=True)
class Bound:
    """An upper bound on R_avg, bit/s/Hz.

    `exact`: the best precoders are known in closed form. Otherwise they are searched numerically,
    and the bound holds as far as the search is right.
    """

    value: float
    exact: bool


def upper_bound(problem: Problem, known: float = 0.0) -> Bound:
    """Return what no trajectory under (11)-(13f) with any precoders can exceed.

    `known` is the R_avg of any plan for the problem: the better it is, the tighter the bound.
    Raises `SolverError` when Clarabel fails.
    """
    import cvxpy as cp

    from faao_mav.optimizer.scaled import flight_variables, solve

    kin = problem.kinematics
    ranges = [reachable_distances(kin, link.station) for link in problem.links]
    for _ in range(_PASSES):  # the second sees the shorter ranges in more detail
        ranges, exact = _without_excursions(problem, ranges, known)
    flight = flight_variables(kin)
    value, constraints = cp.Variable(), list(flight.constraints)
    for link, (nearest, farthest) in zip(problem.links, ranges, strict=True):
        r = nearest[:, None] + (farthest - nearest)[:, None] * np.linspace(0.0, 1.0, _DISTANCES)
        slope, offset = majorant_lines(r / LENGTH, best_rates(problem, link, r)[0])
        distance, rate = cp.Variable((kin.slots, 1)), cp.Variable((kin.slots, 1))
        lines = np.ones((1, slope.shape[1]))
        constraints += [
            cp.norm(flight.w - link.station / LENGTH, axis=1) <= distance[:, 0],
            rate @ lines <= cp.multiply(slope, distance @ lines) + offset,
            value <= cp.sum(rate) / kin.slots,
        ]
    relaxed = cp.Problem(cp.Maximize(value), constraints)
    if solve(relaxed) == cp.INFEASIBLE:
        # Every flight leaves the ranges that a better one than the known plan would keep to.
        return Bound(known, exact)
    # The solver stops within 1e-8 of the optimum, or 1e-4 where it had to be content with less.
    slack = 1e-6 if relaxed.status == cp.OPTIMAL else 1e-3
    ceiling = min(link.classes.bits for link in problem.links)
    return Bound(min(ceiling, max(known, float(value.value) + slack)), exact)


Ranges: TypeAlias = list[tuple[Real, Real]]
"""For each link the least and the greatest distance (n,), m."""


def _without_excursions(problem: Problem, ranges: Ranges, known: float) -> tuple[Ranges, bool]:
    """Shorten `ranges` to what a flight better than `known` can use; and whether rates are exact.

    For any weight lambda, R_avg <= mean of lambda R_B + (1 - lambda) R_U. At a distance s from one
    station the other is no nearer than |s - L|, L the distance between both: that bounds a slot's
    share by a function of s, and Phi(s), its maximum from s on, bounds it at s or farther. A flight
    rho away at slot n cannot be near at the slots around it. If the mean of Phi along its way is
    below `known`, rho is not reached by anything better.
    """
    kin, links = problem.kinematics, problem.links
    apart = float(np.linalg.norm(links[0].station - links[1].station))
    most = max(float(farthest.max()) for _, farthest in ranges)
    s = np.linspace(0.0, most, _DISTANCES)
    tables = [best_rates(problem, link, np.broadcast_to(s, (kin.slots, len(s)))) for link in links]
    exact = all(is_exact for _, is_exact in tables)
    if kin.slots > _MOST_SLOTS:
        return ranges, exact
    shortened = []
    for own, (nearest, farthest) in enumerate(ranges):
        rate, other = tables[own][0], tables[1 - own][0]
        # A grid point stands for what follows it: rates fall, so its own is an upper bound there.
        least = np.maximum(0.0, np.abs(s - apart) - s[1])
        seen = other[:, np.minimum(least / s[1], len(s) - 1).astype(np.intp)]
        limit = farthest
        for weight in _WEIGHTS:
            share = weight * rate + (1 - weight) * seen
            best_beyond = np.maximum.accumulate(share[:, ::-1], axis=1)[:, ::-1]
            limit = np.minimum(limit, _excursion(kin, s, best_beyond, farthest, known))
        shortened.append((nearest, np.maximum(limit, nearest)))
    return shortened, exact


def _excursion(kin: Kinematics, s: Real, best_beyond: Real, farthest: Real, known: float) -> Real:
    """The greatest rho (n,) at which the mean of Phi is still `known`, by bisection from above.

    Moving outwards at v_r when rho away, a flight is at least rho + v_r tau - a_max tau²/2 away
    tau seconds later (or earlier, tau < 0): nothing pulls it in faster. v_r is taken from cells
    that cover -v_max..v_max, and of the cells the one that suits the flight best.
    """
    slots = np.arange(kin.slots)
    first = np.arange(0, kin.slots, max(1, kin.slots // _BLOCKS))
    size = np.diff(np.append(first, kin.slots))
    phi = np.add.reduceat(best_beyond, first, axis=0) / kin.slots
    ends = [kin.time_step * (edge - slots[:, None]) for edge in (first, first + size - 1)]
    slow = -kin.max_speed * np.maximum(*np.abs(ends))
    if not kin.bound_first_acceleration:
        slow[:, 0] -= 2 * kin.max_speed * kin.time_step
    edges = np.linspace(-kin.max_speed, kin.max_speed, _CELLS + 1)
    # All of it is concave in tau: over a block of slots the least is at one of its ends.
    fall = kin.max_acceleration / 2
    cells = [
        np.minimum(*(np.minimum(u * tau, v * tau) - fall * tau**2 for tau in ends))
        for u, v in pairwise(edges)
    ]
    if not kin.bound_first_acceleration:
        for cell in cells:
            cell[:, 0] = slow[:, 0]
    inwards = [np.maximum(slow, cell) for cell in cells]
    low, high = np.zeros(kin.slots), farthest.copy()
    columns = np.arange(len(first))
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        reached = np.zeros(kin.slots)
        for inward in inwards:
            at = np.clip((middle[:, None] + inward) / s[1], 0, len(s) - 1).astype(np.intp)
            np.maximum(reached, phi[columns, at].sum(axis=1), out=reached)
        enough = reached >= known
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    return high


def reachable_distances(kin: Kinematics, station: Real) -> tuple[Real, Real]:
    """Return the least and the greatest horizontal distance (n,) from `station`, m.

    At each instant the UAV is no farther from w_I than it can have come, and no farther from w_F
    than it can still go.
    """
    come = _travelled(kin, kin.start_velocity, free_jump=not kin.bound_first_acceleration)
    still = _travelled(kin, kin.end_velocity, free_jump=False)[::-1]
    from_start = float(np.linalg.norm(kin.start - station))
    from_end = float(np.linalg.norm(kin.end - station))
    nearest = np.maximum(0.0, np.maximum(from_start - come, from_end - still))
    return nearest, np.minimum(from_start + come, from_end + still)


def _travelled(kin: Kinematics, velocity: Real | None, *, free_jump: bool) -> Real:
    """The longest way (n,) in 0, 1, ... steps from an end with the given velocity."""
    n = np.arange(kin.slots, dtype=float)
    speed = np.full(kin.slots, kin.max_speed)
    if velocity is not None:
        gain = (
            np.where(n > 0, np.inf, 0.0) if free_jump else kin.max_acceleration * kin.time_step * n
        )
        speed = np.minimum(speed, float(np.linalg.norm(velocity)) + gain)
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) * kin.time_step


def best_rates(problem: Problem, link: Link, r: Real) -> tuple[Real, bool]:
    """Return the best rate of every slot at distances r (n, m), bits, and whether it is exact.

    Where a known draw meets arrays that turn, the direction is chosen in the bound's favour: each
    singular value of H_r is the largest that any direction gives it.
    """
    optimal = replace(design(problem.plan), scheme="faao", gaussian=False)
    gain_log = np.log(link.reference_gain / (r**2 + link.altitude**2))
    if link.nlos is None or optimal.averaged:
        curve = best_curve(link, optimal, gain_log.min(), gain_log.max())
        return curve.value(gain_log, gain_log), False if optimal.averaged else _closed_form(link)
    singular = _largest_singular_values(link, len(r))
    H_r = np.zeros((len(r), link.receive, link.transmit), dtype=np.complex128)
    k = np.arange(singular.shape[1])
    H_r[:, k, k] = singular
    if _closed_form(link):
        H = np.exp(gain_log / 2)[..., None, None] * H_r[:, None]
        return best_precoders(H, link.power, link.modulation, link.noise).rate, True
    diagonal = replace(link, line_of_sight="all_ones", nlos=H_r, rician_factor=0.0)
    if has_few_modes(link):
        rate = mode_rate(diagonal, gain_log.min(), gain_log.max())
        return np.stack([rate.value(column, column) for column in gain_log.T], axis=1), False
    # Searched on a coarse grid of each slot, one distance after the other, and interpolated.
    from scipy.interpolate import CubicSpline

    columns = np.linspace(0, r.shape[1] - 1, _SEARCHED).astype(np.intp)
    found, start = [], None
    for column in columns:
        H = np.exp(gain_log[:, column] / 2)[:, None, None] * H_r
        best = best_precoders(H, link.power, link.modulation, link.noise, start=start)
        found.append(best.rate)
        start = best.P
    spline = CubicSpline(columns, np.stack(found, axis=1), axis=1)
    return np.asarray(spline(np.arange(r.shape[1]))), False


def _closed_form(link: Link) -> bool:
    return link.transmit == 1 or (link.modulation == "bpsk" and link.transmit == 2)


def _largest_singular_values(link: Link, slots: int) -> Real:
    directions = np.linspace(-1, 1, _DIRECTIONS) if link.follows_position else np.zeros(1)
    largest = np.zeros((slots, min(link.receive, link.transmit)))
    for u in directions:
        H_r = link.fade(link.line_of_sight_at(np.full(slots, u)))
        largest = np.maximum(largest, np.linalg.svd(H_r, compute_uv=False))
    # Between two directions of the grid, a singular value moves by less than H_r does: no phase
    # turns by more than pi (antennas - 1) du.
    du = 1 / (len(directions) - 1) if len(directions) > 1 else 0.0
    turn = np.pi * (max(link.receive, link.transmit) - 1) * du
    return np.asarray(largest + turn * link.los_share * np.sqrt(link.receive * link.transmit))


def majorant_lines(r: Real, rates: Real) -> tuple[Real, Real]:
    """Return slopes and offsets (n, lines): slope r + offset is above `rates` for every line.

    `r` and `rates` (n, m), r evenly spaced and increasing in each row. Slopes are at most zero.
    Offsets allow for what the curve may do between the points.
    """
    step = r[:, 1:2] - r[:, :1]
    moving = np.where(step > 0, step, 1.0)
    # h² |R''| / 8 is what a curve may rise above its chord; twice that, as R'' is seen on the grid.
    between = np.abs(np.diff(rates, 2, axis=1)).max(axis=1, keepdims=True) / 4
    tangent = np.minimum(0.0, np.diff(rates, axis=1) / moving)
    whole = np.minimum(0.0, (rates[:, -1:] - rates[:, :1]) / (moving * (r.shape[1] - 1)))
    picks = np.linspace(0, tangent.shape[1] - 1, _LINES).astype(np.intp)
    slope = np.concatenate([tangent[:, picks], whole, np.zeros_like(whole)], axis=1)
    offset = np.empty_like(slope)
    for k in range(slope.shape[1]):
        offset[:, k] = (rates - slope[:, k : k + 1] * r).max(axis=1)
    return slope, offset + between
