"""Speeds and waits with which the predicted flight keeps the plan's time.

minimise sum_i |p(t_i) - w(t_i)|² over the speeds commanded for the legs, the waits at the hovers
and the lead, p being the predicted flight. A Levenberg-Marquardt method with bounds minimises this
of the last predicted flight `Retimed`; what it finds is then flown. Where that is better it is the
next flight to retime. A few flights do. An error early in the flight shows in everything that
follows: later legs and waits make up for earlier ones.

Legs are causal. The speed of a leg changes how long it takes, a wait how long the aircraft stays;
everything behind comes later by as much, along the same path. So one predicted flight tells how all
its positions depend on all its commands, and no further flight has to be predicted for a slope. How
long legs take at other speeds is known of some autopilots (``model.LegDurations``); of others the
flight tells.

Constants that name no source are chosen; what a change costs is not measured.
"""

from dataclasses import replace

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.autopilot.model import LegDurations
from faao_mav.schedule.prediction import LATE_WEIGHT, Schedule
from faao_mav.schedule.route import Route
from faao_mav.schedule.waypoints import SLOWEST
from faao_mav.vector import lengths

MOST_LEAD = 2.0  # the longest time by which the aircraft sets out before the plan, s
SHORTEST_HOLD = 1.0  # the shortest wait at a hover, s: untold to wait, an autopilot flies through

_STEPS = 8  # the most steps with one flight retimed: far from it the slopes are others
_SETTLED = 1e-3  # the share of the sum of squares that a step saves for another one to follow

_STRIDE = 3  # of so many samples of a predicted flight, 0.1 s apart, one is kept, for speed

_REACHED = 1.03  # the largest ratio of a command and the speed flown for which it counts as reached

# How far speeds are moved to see what they do, m/s: beyond the kinks of what legs come to. With
# 0.15 to 0.4 schedules of 105 plans for ArduCopter are as good; with 0.01 fits end at kinks.
_MOVE = 0.2
_NUDGE = 1e-5  # the same where nothing is known but that commands are not reached; downwards only
_NEAR = 4  # the speed of a leg tells on how long these take: it, one before, two behind


class Retimed:
    """The flight of `schedule` as it would be at other commands, leg by leg.

    At the speeds v'_k and the waits h'_k it is at the same places later by

        D(t, v') + sum_k (h'_k - h_k) [t > departure k],  D = sum_k d_k(t) T_k(v').

    T_k is by how much longer leg k takes, d_k(t), from 0 to 1, the share of it that has come up by
    t: it grows with the way that is flown. What is `known` of the vehicle tells T_k; without that
    it is c_k (v_k / v'_k - 1), c_k being how long the leg takes at its command. A command that is
    not reached, as on a short leg, counts as the greatest speed of the leg:
    `limits` (m - 1,), m/s, infinite where it is reached. An aircraft that is `slow` to change its
    speed comes to it legs behind: its commands have no limit.
    """

    def __init__(self, schedule: Schedule, known: LegDurations | None, *, slow: bool) -> None:
        route, flown = schedule.route, schedule.flown
        self._waits, self._lead, self._known = route.waits, route.lead, known
        self._t, self._places = flown.t[::_STRIDE], flown.position[::_STRIDE, :2]
        self._steps = np.diff(self._places, axis=0)
        leg = np.searchsorted(flown.departures[1:-1], self._t, side="right")
        self._left = (self._t[:, None] > flown.departures).astype(float)
        # the samples at which the clocks of plan and flight meet, and with which the flight is over
        self._start, self._late = schedule.start, schedule.late
        over = self._start + schedule.t[-1] + self._late
        found = np.searchsorted(self._t, [schedule.met, over])
        self._met, self._over = np.minimum(found, len(self._t) - 1).tolist()

        speed = lengths(flown.velocity[::_STRIDE])
        under_way = (self._t >= flown.departures[leg]) & (self._t < flown.arrivals[leg + 1])
        peaks = np.full(len(route.speeds), SLOWEST)
        np.maximum.at(peaks, leg, speed * under_way)
        tops = route.speeds if known is None else known.flown(route.speeds)[0]
        self._peaks = np.where(slow | (tops <= _REACHED * peaks), np.inf, peaks)
        self.limits = self._peaks if known is None else np.minimum(self._peaks, known.most)
        self._speeds = np.minimum(tops, self._peaks)
        share = np.clip(speed / self._speeds[leg], 1e-9, 1.0) * under_way
        steps = np.zeros((len(self._t), len(peaks)))
        steps[np.arange(1, len(leg)), leg[:-1]] = share[:-1] * np.diff(self._t)
        self._cruise = steps.sum(axis=0)
        done = np.cumsum(steps, axis=0)
        self._done = done / np.maximum(done[-1], 1e-9)
        self._told = self._durations(route.speeds)

    def at(self, t: Real, route: Route) -> tuple[Real, Real, Integers, float]:
        """Return the flight with the commands of `route` at the plan's times `t` (n,), s.

        Positions (n, 2), m, velocities (n, 2), m/s, the nearest samples (n,) of the flight that is
        retimed, and by how much later than planned it is over, s.
        """
        delays = self._done @ self._longer(route.speeds) + self._left @ (route.waits - self._waits)
        ahead = route.lead - self._lead
        clock = np.maximum.accumulate(self._t + delays) - (
            self._start + float(delays[self._met]) + ahead
        )
        k = np.minimum(np.maximum(np.searchsorted(clock, t, side="right"), 1), len(clock) - 1)
        begins = clock[k - 1]
        widths = np.maximum(clock[k] - begins, 1e-9)
        share = (t - begins) / widths
        steps = self._steps[k - 1]
        kept = np.minimum(np.maximum(share, 0.0), 1.0)
        # before and after, the aircraft is at an end
        velocities = steps / widths[:, None] * (share == kept)[:, None]
        late = self._late + float(delays[self._over] - delays[self._met]) - ahead
        return self._places[k - 1] + kept[:, None] * steps, velocities, k - (share < 0.5), late

    def slopes(self, route: Route, samples: Integers) -> Real:
        """Return what the commands of `route` do to when the flight is where, (n + 1, 2 m).

        The rows are the `samples` (n,), and the end; the columns the speeds of the legs, the waits
        at the points, and the lead: by how many seconds later for each m/s or s.
        """
        rows, later = np.append(samples, self._over), self._later_slopes(route.speeds)
        return np.hstack(
            [
                later[rows] - later[self._met],
                self._left[rows] - self._left[self._met],
                np.full((len(rows), 1), -1.0),
            ]
        )

    def _later_slopes(self, speeds: Real) -> Real:
        """Return what each of the `speeds` (m - 1,) does to D, (k, m - 1), s for 1 m/s."""
        legs = np.arange(len(speeds))
        moves = legs % _NEAR == np.arange(_NEAR)[:, None]
        down, up = (_NUDGE, 0.0) if self._known is None else (_MOVE, _MOVE)
        less, more = np.maximum(speeds - down * moves, speeds / 2), speeds + up * moves
        change = np.subtract(*self._longer(np.stack([more, less])))
        slopes = np.zeros((len(legs), len(legs)))
        for before in range(-1, _NEAR - 1):  # what a leg's speed does to that leg, and to others
            told = legs[max(before, 0) : len(legs) + min(before, 0)]
            by = told - before
            slopes[told, by] = change[by % _NEAR, told] / (more - less)[by % _NEAR, by]
        later: Real = self._done @ slopes
        return later

    def _longer(self, speeds: Real) -> Real:
        return self._durations(speeds) - self._told

    def _durations(self, speeds: Real) -> Real:
        """Return how long the legs take, s, but for what stays as it is; shape as `speeds`."""
        if self._known is not None:
            return self._known.flown(speeds)[1]
        durations: Real = self._cruise * self._speeds / np.minimum(speeds, self._peaks)
        return durations


class Unknowns:
    """The unknowns x (k,) of a fit: a speed for each group of legs, the waits between, the lead.

    Legs with the same number in `groups` (m - 1,), counted from 0, share a speed. They stay within
    `low` and `high` (k,): speeds within `min_speed` and `max_speed`, m/s, waits at or above
    `SHORTEST_HOLD`, the lead within `MOST_LEAD`, 0 for a flight that begins at speed. The first
    wait and the last stay as they are. `chain` (2 m, k) tells what they do to the speeds of
    all legs, the waits at all points and the lead.
    """

    def __init__(self, route: Route, groups: Integers, min_speed: float, max_speed: float) -> None:
        free = 1 + np.flatnonzero(route.waits[1:-1] > 0)
        legs, waits = len(groups), len(free)
        means = np.bincount(groups, route.speeds) / np.bincount(groups)
        most_lead = MOST_LEAD if route.first == 0 else 0.0
        slowest, fastest = np.full((2, len(means)), [[min_speed], [max_speed]])
        self.low = np.concatenate([slowest, np.full(waits, SHORTEST_HOLD), [0.0]])
        self.high = np.concatenate([fastest, np.full(waits, np.inf), [most_lead]])
        begin = np.concatenate([means, route.waits[free], [route.lead]])
        self.initial = np.clip(begin, self.low, self.high)
        self.chain = np.zeros((2 * legs + 2, len(begin)))
        self.chain[np.arange(legs), groups] = 1.0
        self.chain[legs + free, len(means) + np.arange(waits)] = 1.0
        self.chain[-1, -1] = 1.0
        told = np.concatenate([np.zeros(legs), route.waits, [0.0]])
        self._route, self._fixed = route, np.where(self.chain.any(axis=1), 0.0, told)

    def commanded(self, x: Real) -> Route:
        """Return the route with the speeds, waits and lead of `x`."""
        speeds, waits, lead = np.split(self._fixed + self.chain @ x, [len(self._route.speeds), -1])
        return replace(self._route, speeds=speeds, waits=waits, lead=float(lead[0]))

    def reached(self, x: Real, limits: Real) -> Real:
        """Return `x` with no speed above the greatest of its legs' `limits` (m - 1,), m/s."""
        fastest = np.append(limits, np.full(len(self.chain) - len(limits), np.inf))
        within = np.minimum(x, np.where(self.chain > 0, fastest[:, None], 0.0).max(axis=0))
        return np.asarray(np.maximum(within, self.low))


def stepped(
    t: Real, w: Real, unknowns: Unknowns, retimed: Retimed, begin: Real
) -> tuple[Real, float]:
    """Return the best `x` (k,) of the `retimed` flight from `begin` on, and what it misses, m².

    That is `Schedule.error` squared of the instants `t` (n,), s, with the plan at `w` (n, 2), m.
    """
    low, high, weight = unknowns.low, unknowns.high, 1 / np.sqrt(len(t))

    def flown(x: Real) -> tuple[Real, Integers, Real, float]:
        positions, velocities, samples, late = retimed.at(t, unknowns.commanded(x))
        residuals = np.append(weight * (positions - w).T, LATE_WEIGHT * late)
        return velocities, samples, residuals, float(residuals @ residuals)

    x, damping = unknowns.reached(begin, retimed.limits), 1e-3
    velocities, samples, residuals, cost = flown(x)
    for _ in range(_STEPS):
        later = retimed.slopes(unknowns.commanded(x), samples) @ unknowns.chain
        moved = -weight * velocities.T[:, :, None] * later[:-1]
        slopes = np.vstack([moved.reshape(-1, len(x)), LATE_WEIGHT * later[-1:]])
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
                x, (velocities, samples, residuals, cost), damping = tried, new, damping / 5
                break
            damping *= 10
        if cost > (1 - _SETTLED) * before:
            break
    return x, cost
