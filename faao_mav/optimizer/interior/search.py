"""The iteration of the interior-point method: searches from several starts, side by side.

A numpy call on one flight of some hundred slots costs more in the call than in the arithmetic, so
that five flights at once take little longer than one. Each search is its own; arrays end in
(flights, slots), and what belongs to a flight as a whole in (flights, 1). Flights whose search has
ended are left out.

Lifecycle: `Search(...)` once, from the starts; `run` iterates. An iteration measures the residual
(`_measure`), factors the Newton system (`_newton`), takes the predictor's reach to choose the
barrier parameter mu (Mehrotra), and tries the corrector's direction (`_advance`, `_accept`); a
direction that is refused is tried anew with a proximal term, iterates that hug the limits are
centred anew (`_centre`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    ScaledFlight,
    largest,
    summed,
)
from faao_mav.optimizer.interior.iterate import Direction, Iterate, best_floor, merged, only
from faao_mav.optimizer.interior.newton import Newton
from faao_mav.optimizer.interior.rewards import ScaledRewards
from faao_mav.optimizer.kinematics import LENGTH, Kinematics

# The constants were chosen, and what a change costs was measured on 26 flights of up to 500 slots,
# nine of them with a least speed, to a tolerance of 1e-4: the iterations of all flights together
# (1,144) and the mean gain over the starts (100.1 %). No change that was tried gained more than
# 0.1 % or 1 % of the iterations.

_BARRIER_SHARE = 0.1
"""c / n: the weight of the barrier that keeps t below the F_j, in those of a slot's limits.

Half or twice as much costs 3 to 4 % more iterations, five times as much 0.3 % of the value.
"""

_TO_BOUNDARY = 0.99
"""The share of the way to the boundary that a step may go; 0.9 costs 5 % more iterations."""

_MISFIT = 0.25
"""The shortfall of rewards allowed, in shares of the model's decrease; 0.1 to 1 do as well."""

_SHORT_STEP, _SHORT_BILINEAR = 0.2, 0.1
"""Steps below this share of the direction are short. 0.1 and 0.3 lose 0.1 % of the value.

The second is for a bilinear constraint: see `_CENTRING_BILINEAR`.
"""

_PATIENCE, _PATIENCE_BILINEAR = 2, 4
"""The short steps in a row after which the multipliers are centred; 3 lose 0.1 % of the value."""

_MAX_CENTRINGS = 8
"""The centrings after which a search is given up; 4 lose 0.1 % of the value, 16 gain nothing."""

_CENTRING_FACTOR, _CENTRING_BILINEAR = 1000.0, 10.0
"""mu after a centring, in mean gaps before it. 100 and 10,000 lose up to 0.1 % of the value.

The second is for a bilinear constraint. There short steps come from saddles as well: after each the
proximal term is raised, after four the multipliers are centred by less, and mu is monotone from the
start. Measured on `copter_relay.yaml` in half duplex: with T = 70, 120 and 200 s and buffers of 2,
5, 10 and 20 MB at 20 MHz, and on 16 random plans (T = 72 to 150 s, 2 to 37 MB, 5 to 40 MHz, BPSK to
16-QAM), the best of the starts converges; of the twelve with the adaptive rule, five.
"""

_CENTRING_TURNING = 100.0
"""The same where half-planes turn. Measured on seven sites of forty random polygons, in 40 slots:
five searches converge with 100, two with 1,000 and three with 10, one of those 6 % lower."""

_MAX_ATTEMPTS = 6
"""The directions tried at one iterate before its multipliers are centred; 3 to 12 do as well."""

_FIRST_PROXIMAL = 1e-3
"""The proximal term of the second direction tried at one iterate, then eight times as much; 1e-4 to
1e-2 do as well."""

_STEPS_CUT = 2
"""The steps for which the curvature stays cut once it had to be; 1 loses 0.1 % of the value."""

_WIDEST = 1.0
"""The change of velocity in one step, in v_max, that limits with curvature are modelled for. Longer
directions are cut short, and the proximal term is raised. 0.5 does as well."""

_STRICT = 1e-4
"""The tolerance that limits with curvature are kept to where a search asks for less: so much is
what their `inside` leaves room for."""

_QUEUE_FALL = 0.3
"""The least share of mu that a step leaves where a queue is to be emptied.

Measured on 16 flights of up to 400 slots, from 68 starts: 1,283 iterations, 1 start that does not
converge. With 0.01 to 0.1 as elsewhere: 1,749 and 4.
"""

_MONOTONE_AFTER = 2
_SOLVED = 3.0
_MONOTONE_FALL = 0.2
"""With a queue, the centrings after which mu stays until the scaled gradient is below `_SOLVED` mu,
and then falls to this share: iterates that hug the limits again and again are led along the centre.

Measured on eight flights of the samples with buffers of 5 to 100 MB or a least speed, to a
tolerance of 1e-4: 7 converge, 3 with the adaptive rule alone.
"""

_SOLVED_TURNING = 30.0
"""The same where the half-planes of a fence turn with the flight: mu is monotone from the start.

Measured on two sample flights round obstacles, by a gap and by zones that touch: 134 and 95
iterations. With 100 in place of 30 neither converges in 300, with 300 one does, in 294.
"""

_MU_PER_TOLERANCE = 1 / 20
"""The least mu, in tolerances; up to 1/5 does as well, with 1/2 nothing converges."""


_MOST_PER_SLOT = 10.0
"""The inequalities per slot from which the least mu is smaller: the gap is their sum. Chosen."""


@dataclass(frozen=True, slots=True)
class StartStrategy:
    """How a search begins: the first barrier parameter mu, and the margin of the limits.

    Limits are widened by `margin` (in v_max, a_max) beyond the start. A smaller mu follows the
    start, a larger one the middle of the limits. A tenth or ten times the mu of `COLD_START`, or a
    third or three times its margin, costs up to 6 % more iterations and 0.1 to 0.5 % of the value.
    """

    mu: float
    margin: float


COLD_START = StartStrategy(mu=10.0, margin=1.0)
"""For any start: the optimum may be far away."""

WARM_START = StartStrategy(mu=0.1, margin=0.03)
"""For starts that are nearly optimal."""

WARM_SHARES = StartStrategy(mu=0.1, margin=0.1)
"""The same in half duplex. Measured on seven plans (T = 40 to 120 s, BPSK to 16-QAM): a third of
this margin takes 24 iterations for 12 at T = 70 s. Ten times mu leaves two starts unconverged with
a buffer of 20 MB."""


NEAR_START = StartStrategy(mu=1e-3, margin=0.01)
"""The same with a least speed. Measured on five plans: 15 to 71 steps from a rough optimum to the
tolerance, where `COLD_START` takes 40 to 250 and may end at a lower value."""


SLOW_START = StartStrategy(mu=0.1, margin=1.0)
"""For any start with a least speed: `COLD_START` forgets what turns where."""


@dataclass(frozen=True, slots=True)
class SearchResult:
    """Where a search ended: scaled speeds v (2, n), and the rest as in `LocalOptimum`."""

    v: Real
    weights: Real
    iterations: int
    residual: float
    converged: bool


@dataclass(slots=True)
class _Control:
    """What steers each search, (flights, 1).

    `attempts` counts the directions refused at this iterate, `short` the short steps in a row,
    `cut_left` the steps for which the curvature stays cut; `steepness` is how much steeper the
    rewards are than at the start. `best` and `best_v` (2, flights, n) are the largest min_j F_j
    within the limits so far and its speeds.
    """

    mu: Real
    proximal: Real
    steepness: Real
    best: Real
    best_v: Real
    iterations: Integers
    attempts: Integers
    short: Integers
    cut_left: Integers
    centrings: Integers


class Search:
    """Searches from starts w, v (2, flights, n) in SI units."""

    def __init__(
        self,
        kin: Kinematics,
        constraints: Sequence[Constraint],
        rewards: ScaledRewards,
        w: Real,
        v: Real,
        *,
        tolerance: float,
        strategy: StartStrategy,
    ) -> None:
        """Begin at the starts."""
        self.rewards, self.tolerance = rewards, tolerance
        self.flight = ScaledFlight(kin, constraints)
        self.turning = any(constraint.turns for constraint in constraints)
        self.bilinear = any(constraint.bilinear for constraint in constraints)
        self.curved = any(constraint.curved for constraint in constraints)
        self.barrier_share = _BARRIER_SHARE * kin.slots
        flights = w.shape[1]
        self.rows = np.arange(flights)
        one, none = np.ones((flights, 1)), np.zeros((flights, 1), dtype=np.int_)
        mu = strategy.mu * one
        w, v = w / LENGTH, v / kin.max_speed
        total, gradient, hessian = rewards.scaled(rewards.values)
        floor = best_floor(total, self.barrier_share * mu)
        weights = 1 / (total - floor)
        self.at = Iterate(
            w=w,
            v=v,
            y=np.zeros((2, flights, kin.slots - 1)),
            states=self.flight.begin(w, v, mu, strategy.margin),
            weights=weights / weights.sum(axis=0),
            total=total,
            floor=floor,
            gradient=gradient * self.flight.matrix.moves_w,
            hessian=hessian,
        )
        self.control = _Control(mu, 0 * one, one, -np.inf * one, v, none, none, none, none, none)

    def run(self, max_iterations: int) -> dict[int, SearchResult]:
        """Iterate until every search has ended; flights with flat rewards are left out."""
        results: dict[int, SearchResult] = {}
        self._keep(~self.rewards.flat)
        while self.rows.size:
            slope, residual = self._measure()
            control = self.control
            converged = residual < self.tolerance
            # not finite: the limits have no interior left
            lost = control.iterations >= max_iterations
            lost |= control.centrings > _MAX_CENTRINGS
            over = converged | ~np.isfinite(residual) | (lost & (control.attempts == 0))
            for k in np.flatnonzero(over).tolist():
                results[int(self.rows[k])] = self._result(k, residual[k, 0], converged[k, 0])
            if over.all():
                break
            self._keep(~over)
            self._advance(slope[~over[:, 0]])
        return results

    def _result(self, k: int, residual: float, converged: bool) -> SearchResult:
        """Return the best flight within the limits so far, else the last one."""
        control, at = self.control, self.at
        return SearchResult(
            v=(control.best_v if control.best[k, 0] > -np.inf else at.v)[:, k],
            weights=at.weights[:, k, 0],
            iterations=int(control.iterations[k, 0]),
            residual=float(residual) if np.isfinite(residual) else np.inf,
            converged=bool(converged),
        )

    def _keep(self, flights: Flags) -> None:
        """Go on with the flights that `flights` (flights, 1) marks alone."""
        if flights.all():
            return
        chosen = flights[:, 0]
        self.rows = self.rows[chosen]
        self.at, self.control = only(self.at, chosen), only(self.control, chosen)
        self.rewards.keep(chosen)

    def _measure(self) -> tuple[Real, Real]:
        """Return the scaled gradient of the Lagrangian and the residual; note the best iterate."""
        at, control, matrix = self.at, self.control, self.flight.matrix
        n = matrix.slots
        forces = [state.forces() for state in at.states]
        on_w = matrix.pull(at.y) - np.einsum("jb,cjbn->cbn", at.weights[..., 0], at.gradient)
        total = Forces.total(forces)
        if isinstance(total.w, np.ndarray):
            on_w -= total.w * matrix.moves_w
        on_v = self.flight.forces_asked(at.y, np.asarray(total.a)) - total.v * matrix.moves_v
        slope = np.maximum(largest(on_w), largest(on_v))
        size, gap = summed(np.abs(at.y)), (at.weights * (at.total - at.floor)).sum(axis=0)
        broken = largest(matrix.dynamics(at.w, at.v))
        for state, force in zip(at.states, forces, strict=True):
            size, gap = size + state.size(), gap + state.gap()
            broken = np.maximum(broken, state.violation())
            if isinstance(force.own, np.ndarray):
                slope = np.maximum(slope, np.abs(force.own).max(axis=(1, 2))[:, None])
        slope /= np.maximum(1, size / (80 * n))
        # a flight that is taken for an end has to be inside limits with curvature
        broken = broken * (max(1.0, self.tolerance / _STRICT) if self.curved else 1.0)
        least = at.value()
        better = (broken < self.tolerance / 10) & (least > control.best)
        control.best = np.where(better, least, control.best)
        control.best_v = np.where(better, at.v, control.best_v)
        # where the rewards are steeper than at the start, their unit is larger
        steepest = (np.abs(at.gradient).max(axis=(0, -1))[..., None] * at.weights).sum(axis=0)
        steepest = reduce(np.maximum, [state.steepness() for state in at.states], steepest)
        control.steepness = np.maximum(1, steepest)
        slope, gap = slope / control.steepness, gap / control.steepness
        return slope, np.maximum(np.maximum(slope, broken), gap / n)

    def _advance(self, slope: Real) -> None:
        """Try one direction of every flight; a refused one is tried anew with a proximal term."""
        control, at = self.control, self.at
        fresh = control.attempts == 0
        control.iterations = control.iterations + fresh
        newton, ahead = self._newton()
        share = np.minimum(1, ahead.reach(at))
        now, left = at.mean_gap(), at.mean_gap(share, ahead)
        queued = not len(at.total)
        slowest = _QUEUE_FALL if queued else np.where(slope < 1, 0.01, 0.1)
        keep = np.maximum((left / now) ** 3, slowest)
        per_slot = sum(state.count() for state in at.states) / at.w.shape[-1]
        fewer = np.minimum(1, _MOST_PER_SLOT / per_slot)
        least = self.tolerance * _MU_PER_TOLERANCE * control.steepness * fewer
        adaptive = np.fmin(control.mu, keep * now)
        near = _SOLVED_TURNING if self.turning else _SOLVED
        solved = slope * control.steepness < near * control.mu
        solved |= self.turning & (slope < self.tolerance)
        monotone = np.where(solved, _MONOTONE_FALL, 1.0) * control.mu
        hugged = queued & (control.centrings >= _MONOTONE_AFTER)
        waits = hugged | self.turning | self.bilinear | self.curved
        control.mu = np.fmax(np.where(waits, monotone, adaptive), least)
        direction = newton.corrector(control.mu, ahead, share)
        share = np.minimum(1, _TO_BOUNDARY * direction.reach(at))
        fastest = np.sqrt((direction.move.v**2).sum(axis=0).max(axis=-1, keepdims=True))
        wild = self.curved & (fastest > _WIDEST)
        share = np.where(wild, np.minimum(share, _WIDEST / fastest), share)
        sound = newton.factors.sound
        moved = self._accept(newton, direction, share, sound)
        if not moved.all():
            share = np.where(moved, share, share / 2)
            moved = moved | self._accept(newton, direction, share, sound & ~moved)

        lower = np.where(control.proximal > _FIRST_PROXIMAL, control.proximal / 4, 0)
        higher = np.maximum(8 * control.proximal, _FIRST_PROXIMAL)
        short = moved & (share < (_SHORT_BILINEAR if self.bilinear else _SHORT_STEP))
        eased = moved & ~(short & self.bilinear | wild)
        control.proximal = np.where(eased, np.where(fresh, lower, control.proximal), higher)
        control.attempts = np.where(moved, 0, control.attempts + 1)
        failed = (control.attempts >= _MAX_ATTEMPTS) | ~sound
        short |= failed
        control.short = np.where(short, control.short + 1, np.where(moved, 0, control.short))
        patience = _PATIENCE_BILINEAR if self.bilinear else _PATIENCE
        hugging = moved & (control.short >= patience) & (control.centrings < _MAX_CENTRINGS)
        hugging &= not self.curved
        if (failed | hugging).any():
            self._centre(failed | hugging)

    def _newton(self) -> tuple[Newton, Direction]:
        """Factor the systems, with the true curvature where that will do, else with it cut.

        Return also the predictor, the direction for mu = 0.
        """
        control = self.control
        # the signs that tell a minimum by are those of the border: without one, do not try;
        # where limits are curved, as much of it counts as leaves the model concave
        cut = (control.cut_left > 0) | (len(self.at.total) == 0) | self.curved
        control.cut_left = np.maximum(0, control.cut_left - 1)
        while True:
            newton = Newton.factored(
                self.flight,
                self.at,
                barrier_share=self.barrier_share,
                proximal=control.proximal,
                cut=cut,
            )
            ahead = newton.predictor()
            will_do = cut | newton.looks_convex(ahead)
            if will_do.all():
                return newton, ahead
            control.cut_left = np.where(will_do, control.cut_left, _STEPS_CUT)
            cut = cut | ~will_do

    def _accept(self, newton: Newton, direction: Direction, share: Real, asked: Flags) -> Flags:
        """Move those of the flights `asked` whose rewards do not fall short of the model."""
        at, control, move = newton.at, self.control, direction.move
        asked = asked & np.isfinite(largest(move.w) + largest(move.v))
        w = np.where(asked, at.w + share * move.w, at.w)  # rewards are not asked for nowhere
        v = np.where(asked, at.v + share * move.v, at.v)
        total, gradient, hessian = self.rewards(w)
        finite = np.isfinite(total.sum(axis=0) + summed(gradient) + summed(hessian))
        weights = at.weights + share * direction.weights
        missing = (weights * (at.total + share * direction.total - total)).sum(axis=0)
        states = tuple(
            state.moved(w, v, share, step)
            for state, step in zip(at.states, direction.steps, strict=True)
        )
        for state, step, then in zip(at.states, direction.steps, states, strict=True):
            missing += state.missing(share, step, then)
        bend = newton.bend(direction)
        missing -= share**2 * bend / 2
        decrease = newton.decrease(direction, bend)
        allowed = _MISFIT * share * np.maximum(decrease, 0) + self.rewards.noise
        taken: Flags = asked & finite & (missing <= allowed)
        if self.bilinear or self.curved:  # the direction to a saddle is refused
            taken = taken & (decrease > 0)
        if not taken.any():
            return taken
        trial = Iterate(
            w=w,
            v=v,
            y=at.y + np.where(control.iterations == 1, 1.0, share) * direction.y,
            states=states,
            weights=weights / weights.sum(axis=0),
            total=total,
            floor=best_floor(total, self.barrier_share * control.mu),
            gradient=gradient * self.flight.matrix.moves_w,
            hessian=hessian,
        )
        self.at = merged(taken, trial, self.at)
        return taken

    def _centre(self, chosen: Flags) -> None:
        """Give the flights `chosen` multipliers from a larger mu: that leads away from limits."""
        control, at = self.control, self.at
        turned = _CENTRING_TURNING if self.turning else _CENTRING_FACTOR
        factor = _CENTRING_BILINEAR if self.bilinear else turned
        larger = np.minimum(COLD_START.mu * control.steepness, factor * at.mean_gap())
        control.mu = np.where(chosen, larger, control.mu)
        self.at = merged(chosen, at.centred(control.mu, self.barrier_share), at)
        control.proximal = np.where(chosen, 0, control.proximal)
        control.attempts, control.short = (
            np.where(chosen, 0, count) for count in (control.attempts, control.short)
        )
        control.centrings = control.centrings + chosen
