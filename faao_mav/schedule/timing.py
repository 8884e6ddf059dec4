"""Speeds and waits with which the predicted flight keeps the plan's time.

minimise sum_i |p(t_i) - w(t_i)|² over the speeds commanded for the legs, the waits at the hovers
and the lead, p being the predicted flight. A Levenberg-Marquardt method with bounds minimises this
of the last predicted flight `retimed`; what it finds is then flown. Where that is better it is the
next flight to retime. A few flights do. An error early in the flight shows in everything that
follows: later legs and waits make up for earlier ones.

Constants that name no source are chosen; what a change costs is not measured.
"""

from dataclasses import replace

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.schedule.retimed import Retimed, Retiming
from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import LATE_WEIGHT, Schedule

MOST_LEAD = 2.0  # the longest time by which the aircraft sets out before the plan, s
SHORTEST_HOLD = 1.0  # the shortest wait at a hover, s: untold to wait, an autopilot flies through

_SAMPLES = 240  # the most instants at which a predicted flight is compared with the plan
_STEPS = 8  # the most steps with one flight retimed: far from it the slopes are others
_SETTLED = 1e-3  # the share of the sum of squares that a step saves for another one to follow


class Unknowns:
    """The unknowns x (k,) of a fit: a speed for each group of legs, the waits between, the lead.

    Legs with the same number in `groups` (m - 1,), counted from 0, share a speed. They stay within
    `low` and `high` (k,): speeds within `min_speed` and `max_speed`, m/s, waits at or above
    `SHORTEST_HOLD`, the lead within `MOST_LEAD`, 0 for a flight that begins at speed. The first
    wait and the last stay as they are. `chain` (2 m, k) tells what they do to the speeds of
    all legs, the waits at all points and the lead.
    """

    def __init__(self, route: Route, groups: Integers, min_speed: float, max_speed: float) -> None:
        free = route.waits > 0
        free[[0, -1]] = False
        self._route, self._groups, self._free = route, groups, free
        means = np.bincount(groups, route.speeds) / np.bincount(groups)
        self._speeds, waits = len(means), int(free.sum())
        most_lead = MOST_LEAD if route.first == 0 else 0.0
        slowest, fastest = np.full((2, len(means)), [[min_speed], [max_speed]])
        self.low = np.concatenate([slowest, np.full(waits, SHORTEST_HOLD), [0.0]])
        self.high = np.concatenate([fastest, np.full(waits, np.inf), [most_lead]])
        begin = np.concatenate([means, route.waits[free], [route.lead]])
        self.initial = np.clip(begin, self.low, self.high)
        self.chain = np.zeros((2 * len(free), len(begin)))
        self.chain[np.arange(len(groups)), groups] = 1.0
        self.chain[len(groups) + np.flatnonzero(free), self._speeds + np.arange(waits)] = 1.0
        self.chain[-1, -1] = 1.0

    def commanded(self, x: Real) -> Route:
        """Return the route with the speeds, waits and lead of `x`."""
        waits = self._route.waits.copy()
        waits[self._free] = x[self._speeds : -1]
        return replace(self._route, speeds=x[self._groups], waits=waits, lead=float(x[-1]))

    def reached(self, x: Real, limits: Real) -> Real:
        """Return `x` with no speed above the greatest of its legs' `limits` (m - 1,), m/s."""
        fastest = np.zeros(self._speeds)
        np.maximum.at(fastest, self._groups, limits)
        fastest = np.append(fastest, np.full(len(x) - self._speeds, np.inf))
        within: Real = np.maximum(np.minimum(x, fastest), self.low)
        return within


class Goal:
    """The residuals whose sum of squares is least for a flight at `w` (n, 2), m, at `t` (n,), s."""

    def __init__(self, t: Real, w: Real) -> None:
        samples = np.unique(np.linspace(0, len(t) - 1, _SAMPLES).astype(int))
        self.t, self._w = t[samples], w[samples]
        self._weight = 1 / np.sqrt(len(samples))

    def cost(self, schedule: Schedule) -> float:
        """Return the sum of squares, m², of a flight."""
        residuals = self._residuals(schedule.positions(self.t), schedule.late)
        return float(residuals @ residuals)

    def residuals(self, found: Retiming) -> Real:
        """Return the residuals (r,), m, of a retimed flight."""
        return self._residuals(found.positions, found.late)

    def _residuals(self, positions: Real, late: float) -> Real:
        apart = (positions - self._w) * self._weight
        return np.append(apart.T, LATE_WEIGHT * late)

    def slopes(self, found: Retiming, later: Real) -> Real:
        """Return what the unknowns do to the residuals, (r, k).

        `later` (n + 1, k), s, is by how much later they make the flight, in the end by its last
        row.
        """
        velocities = found.velocities * self._weight
        apart = -(velocities.T[:, :, None] * later[:-1]).reshape(-1, later.shape[1])
        slopes: Real = np.vstack([apart, LATE_WEIGHT * later[-1:]])
        return slopes


def stepped(goal: Goal, unknowns: Unknowns, retimed: Retimed, begin: Real) -> tuple[Real, float]:
    """Return the best `x` (k,) of the `retimed` flight from `begin` on, and its cost, m²."""
    low, high = unknowns.low, unknowns.high

    def flown(x: Real) -> tuple[Route, Retiming, Real, float]:
        route = unknowns.commanded(x)
        found = retimed.at(goal.t, route)
        residuals = goal.residuals(found)
        return route, found, residuals, float(residuals @ residuals)

    x, damping = unknowns.reached(begin, retimed.limits), 1e-3
    route, found, residuals, cost = flown(x)
    for _ in range(_STEPS):
        later = retimed.slopes(route, found.samples) @ unknowns.chain
        slopes = goal.slopes(found, later)
        gradient = residuals @ slopes
        stuck = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
        slopes[:, stuck] = 0.0
        square = slopes.T @ slopes
        diagonal, downhill = np.diag(square), np.where(stuck, 0.0, -gradient)
        before = cost
        for _ in range(4):
            damped = square + np.diag(damping * diagonal + 1e-9)
            tried = np.minimum(np.maximum(x + np.linalg.solve(damped, downhill), low), high)
            new = flown(tried)
            if new[-1] < cost:
                x, (route, found, residuals, cost), damping = tried, new, damping / 5
                break
            damping *= 10
        if cost > (1 - _SETTLED) * before:
            break
    return x, cost
