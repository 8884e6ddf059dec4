"""An upper bound on R_avg over all trajectories and precoders, by a convex relaxation.

The best rate of a slot falls with the distance r to the station. A line of slope at most zero that
lies above this curve, over the distances that the UAV can have in that slot, is a concave function
of the position; so is the minimum of many such lines, the majorant. Maximising the smaller mean of
the majorants over all flights is a convex problem. Its value bounds R_avg of every trajectory under
(11)-(13f) with every precoder under (13b), (13c).

The shorter the range of distances, the lower the majorant. A known plan shortens it: a flight that
is far away in one slot is not near in the next, and on its way out and back it loses more rate than
it may if it is to be better than the known plan.

More lines, weights, blocks, cells and passes below make the bound tighter and slower; fewer never
make it wrong. They were chosen; what a change costs is not measured.
"""

from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.kinematics import LENGTH, Kinematics
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.rates.mode_rate import has_few_modes, mode_rates
from faao_mav.optimizer.rates.rate_model import best_curves
from faao_mav.radio.best_precoder import best_precoders, has_closed_form
from faao_mav.radio.rate import cutoff_rate

_LINES = 64  # tangents of the majorant of each slot
_DISTANCES = 600  # distances at which the best rate of each slot is tabulated
_SEARCHED = 25  # distances at which precoders are searched where there is no table of modes
_DIRECTIONS = 257  # directions u over which the largest singular values are taken
_WEIGHTS = (0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.7)  # weights lambda of R_B against R_U
_BISECTIONS = 11  # bisections of the greatest distance: it is found to 1 / 2048 of the range
_BLOCKS = 150  # blocks of slots in which the rate along a way out and back is summed
_PASSES = 2  # rounds of limiting the distances; the second tabulates the shorter ranges
_SPEED_CELLS = 12  # cells of the radial speed between -v_max and v_max
_MOST_SLOTS = 2_000  # slots up to which known plans limit the distances: memory grows with them


def relaxed_bound(problem: Problem, known: float = 0.0) -> float:
    """Return an upper bound on R_avg over all trajectories and precoders of `problem`, bit/s/Hz.

    `known` is R_avg of any plan for it, or less: the larger it is, the tighter the bound. Raises
    `SolverError` where Clarabel fails.
    """
    import cvxpy as cp

    from faao_mav.optimizer.scaled import flight_variables, solve

    kin = problem.kinematics
    ranges = [reachable_distances(kin, link.station) for link in problem.links]
    for _ in range(_PASSES):
        ranges = _shortened(problem, ranges, known)
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
        # A flight better than the known plan would stay within the ranges, and none does.
        return known
    # Clarabel stops within 1e-8 of the optimum, or within 1e-4 where it made no more progress.
    slack = 1e-6 if relaxed.status == cp.OPTIMAL else 1e-3
    ceiling = float(min(link.classes.bits for link in problem.links))
    return min(ceiling, max(known, float(value.value) + slack))


Ranges: TypeAlias = list[tuple[Real, Real]]
"""For each link the least and the greatest horizontal distance of every slot (n,), m."""


def _shortened(problem: Problem, ranges: Ranges, known: float) -> Ranges:
    """Return `ranges` without distances that exclude R_avg > `known`.

    For any weight lambda, R_avg <= mean of lambda R_B + (1 - lambda) R_U. At a distance s from one
    station the other is no nearer than |s - L|, L the distance between the stations. That bounds
    the term of a slot by a function of s; let Phi(s) be its maximum over s and beyond. A flight at
    distance rho in slot n is not near in the slots around it either. If the mean of Phi over its
    least distances is below `known`, no better flight is at rho or beyond in slot n.
    """
    kin, links = problem.kinematics, problem.links
    apart = float(np.linalg.norm(links[0].station - links[1].station))
    most = max(float(farthest.max()) for _, farthest in ranges)
    s = np.linspace(0.0, most, _DISTANCES)
    if kin.slots > _MOST_SLOTS:
        return ranges
    wide = np.broadcast_to(s, (kin.slots, len(s)))
    tables = [best_rates(problem, link, wide)[0] for link in links]
    shortened = []
    for own, (nearest, farthest) in enumerate(ranges):
        rate, other = tables[own], tables[1 - own]
        # A grid point stands for what follows it: rates fall, so its own is an upper bound there.
        least = np.maximum(0.0, np.abs(s - apart) - s[1])
        seen = other[:, np.minimum(least / s[1], len(s) - 1).astype(np.intp)]
        limit = farthest
        for weight in _WEIGHTS:
            share = weight * rate + (1 - weight) * seen
            best_beyond = np.maximum.accumulate(share[:, ::-1], axis=1)[:, ::-1]
            limit = np.minimum(limit, _greatest_distance(kin, s, best_beyond, farthest, known))
        shortened.append((nearest, np.maximum(limit, nearest)))
    return shortened


def _greatest_distance(
    kin: Kinematics, s: Real, best_beyond: Real, farthest: Real, known: float
) -> Real:
    """Return the greatest rho (n,), m, at which the mean of Phi is at least `known`, by bisection.

    `best_beyond` (n, m) is Phi at the distances s (m,). A flight at distance rho with radial speed
    v_r is at least rho + v_r tau - a_max tau²/2 away tau seconds later (or earlier, tau < 0). v_r
    is in one of the cells that cover -v_max to v_max; the cell with the largest mean counts.
    """
    slots = np.arange(kin.slots)
    first = np.arange(0, kin.slots, max(1, kin.slots // _BLOCKS))
    size = np.diff(np.append(first, kin.slots))
    phi = np.add.reduceat(best_beyond, first, axis=0) / kin.slots
    ends = [kin.time_step * (edge - slots[:, None]) for edge in (first, first + size - 1)]
    slow = -kin.max_speed * np.maximum(*np.abs(ends))
    if not kin.bound_first_acceleration:
        slow[:, 0] -= 2 * kin.max_speed * kin.time_step
    edges = np.linspace(-kin.max_speed, kin.max_speed, _SPEED_CELLS + 1)
    # The distance is concave in tau: over a block of slots its minimum is at one of the ends.
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
    """Return the least and the greatest horizontal distance (n,) from `station` (2,), m.

    In slot n the UAV is no farther from w_I than it can fly since slot 0, and no farther from w_F
    than it can fly until slot N + 1.

    >>> kin = Kinematics(np.zeros(2), np.array([10.0, 0.0]), 5, 1.0, 4.0, 9.0, None, None, True)
    >>> nearest, farthest = reachable_distances(kin, np.array([10.0, 0.0]))
    >>> nearest.tolist(), farthest.tolist()
    ([10.0, 6.0, 2.0, 0.0, 0.0], [10.0, 12.0, 8.0, 4.0, 0.0])
    """
    since, until = kin.longest_ways()
    from_start = float(np.linalg.norm(kin.start - station))
    from_end = float(np.linalg.norm(kin.end - station))
    nearest = np.maximum(0.0, np.maximum(from_start - since, from_end - until))
    return nearest, np.minimum(from_start + since, from_end + until)


def best_rates(problem: Problem, link: Link, r: Real) -> tuple[Real, bool]:
    """Return the best rate of every slot at distances r (n, m), bits, and whether it is exact.

    Where a draw is known for every slot and the channel depends on the direction, the result is an
    upper bound: each singular value of H_r is the largest over all directions.
    """
    optimal = replace(design(problem.plan), scheme="faao", gaussian=False)
    exact = has_closed_form(link.modulation, link.transmit) and link.measure == "cutoff"
    gain_log = np.log(link.reference_gain / (r**2 + link.altitude**2))
    if link.nlos is None or optimal.averaged:
        span = np.array([gain_log.min(), gain_log.max()])
        curve = best_curves([link], optimal, [span])[0]
        return curve.value(gain_log, gain_log), not optimal.averaged and exact
    singular = _largest_singular_values(link, len(r))
    H_r = np.zeros((len(r), link.receive, link.transmit), dtype=np.complex128)
    k = np.arange(singular.shape[1])
    H_r[:, k, k] = singular
    if exact:
        # a path gain scales H and leaves the singular vectors, and with them P, as they are
        best = best_precoders(H_r, link.power, link.modulation, link.noise)
        H = np.exp(gain_log / 2)[..., None, None] * H_r[:, None]
        return cutoff_rate(H, best.P[:, None], link.classes, link.noise), True
    diagonal = replace(link, line_of_sight="all_ones", nlos=H_r, rician_factor=0.0)
    if has_few_modes(link):
        (rate,) = mode_rates([diagonal], [np.array([gain_log.min(), gain_log.max()])])
        return np.stack([rate.value(column, column) for column in gain_log.T], axis=1), False
    # One distance after the other, each search starting from the precoders of the last.
    from scipy.interpolate import CubicSpline

    columns = np.linspace(0, r.shape[1] - 1, _SEARCHED).astype(np.intp)
    rates, P = [], None
    for column in columns:
        H = np.exp(gain_log[:, column] / 2)[:, None, None] * H_r
        P = link.best(H[:, None], P)
        rates.append(link.draw_rates(H, P))
    spline = CubicSpline(columns, np.stack(rates, axis=1), axis=1)
    return np.asarray(spline(np.arange(r.shape[1]))), False


def _largest_singular_values(link: Link, slots: int) -> Real:
    """Return upper bounds on the singular values of H_r over all directions, (slots, modes)."""
    directions = np.linspace(-1, 1, _DIRECTIONS) if link.follows_position else np.zeros(1)
    largest = np.zeros((slots, min(link.receive, link.transmit)))
    for u in directions:
        H_r = link.fade(link.line_of_sight_at(np.full(slots, u)))
        largest = np.maximum(largest, np.linalg.svd(H_r, compute_uv=False))
    # Between two directions of the grid a singular value changes by less than the norm of the
    # change of H_r, in which no phase changes by more than pi (antennas - 1) du.
    du = 1 / (len(directions) - 1) if len(directions) > 1 else 0.0
    phase = np.pi * (max(link.receive, link.transmit) - 1) * du
    return np.asarray(largest + phase * link.los_share * np.sqrt(link.receive * link.transmit))


def majorant_lines(r: Real, rates: Real) -> tuple[Real, Real]:
    """Return slopes and offsets (n, lines) of lines slope r + offset that lie above `rates`.

    `r` and `rates` are (n, m), r evenly spaced and increasing in each row. Slopes are at most zero.
    The offsets allow for the curvature of the rates between the points.

    >>> slope, offset = majorant_lines(np.array([[0.0, 1.0, 2.0]]), np.array([[2.0, 1.0, 0.0]]))
    >>> float(slope.min()), float(offset.max())
    (-1.0, 2.0)
    """
    step = r[:, 1:2] - r[:, :1]
    moving = np.where(step > 0, step, 1.0)
    # A curve rises by at most h² |R''| / 8 above its chord; the double allows for R'' being known
    # on the grid only.
    between = np.abs(np.diff(rates, 2, axis=1)).max(axis=1, keepdims=True) / 4
    tangent = np.minimum(0.0, np.diff(rates, axis=1) / moving)
    whole = np.minimum(0.0, (rates[:, -1:] - rates[:, :1]) / (moving * (r.shape[1] - 1)))
    picks = np.linspace(0, tangent.shape[1] - 1, _LINES).astype(np.intp)
    slope = np.concatenate([tangent[:, picks], whole, np.zeros_like(whole)], axis=1)
    offset = np.empty_like(slope)
    for k in range(slope.shape[1]):
        offset[:, k] = (rates - slope[:, k : k + 1] * r).max(axis=1)
    return slope, offset + between
