"""The iteration of `interior`: searches from several starts, side by side but each its own.

A numpy call on one flight of some hundred slots costs more in the call than in the arithmetic, so
that five flights at once take little longer than one. Arrays end in (flights, slots), and what
belongs to a flight as a whole in (flights, 1); flights whose search has ended are left out.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.optimizer.interior import cones
from faao_mav.optimizer.interior.flights import merged, only
from faao_mav.optimizer.interior.iterate import FlightScale, Point, Step, best_floor
from faao_mav.optimizer.interior.min_speed import Slow
from faao_mav.optimizer.interior.newton import Newton
from faao_mav.optimizer.interior.rewards import LENGTH, ScaledRewards
from faao_mav.optimizer.kinematics import Kinematics

_SHARE = 0.1  # c / n: how much of the barrier keeps the F_j apart
_BOUNDARY = 0.99
_MISFIT = 0.25  # how much worse than modelled a step may be, relative to the model's decrease
_SHORT, _PATIENCE = 0.2, 2
_CENTRINGS, _CENTRING = 8, 1000.0
_PROXIMALS, _PROXIMAL = 6, 1e-3
_CUT = 2  # steps for which the curvature stays cut once it had to be


@dataclass(frozen=True, slots=True)
class Opening:
    """How a search begins: the first mu, and by how much the limits are widened beyond the start.

    A smaller mu follows the start, a larger one the middle of the limits.
    """

    mu: float
    margin: float


FAR = Opening(mu=10.0, margin=1.0)
"""For any start: the optimum may be far away."""

NEAR = Opening(mu=0.1, margin=0.03)
"""For starts that are nearly optimal."""


@dataclass(frozen=True, slots=True)
class End:
    """Where a search ended: scaled speeds v (2, n), and the rest as in `Optimum`."""

    v: Real
    weights: Real
    iterations: int
    residual: float
    converged: bool


@dataclass(slots=True)
class _Pace:
    """The state of each search but for its point, (flights, 1).

    `attempts` counts the steps refused at this point, `short` the short ones in a row, `skip` the
    steps for which the curvature stays cut, `steep` how much steeper the rewards are than at the
    start. `worth` and `v` (2, flights, n) are the best min_j F_j within the limits and its speeds.
    """

    mu: Real
    proximal: Real
    steep: Real
    worth: Real
    v: Real
    iterations: Integers
    attempts: Integers
    short: Integers
    skip: Integers
    centrings: Integers


class Search:
    """Searches from starts w, v (2, flights, n) in SI units."""

    def __init__(
        self,
        kin: Kinematics,
        rewards: ScaledRewards,
        w: Real,
        v: Real,
        *,
        tolerance: float,
        opening: Opening,
    ) -> None:
        self.rewards, self.tolerance = rewards, tolerance
        self.scale, self.share = FlightScale(kin), _SHARE * kin.slots
        flights = w.shape[1]
        self.rows = np.arange(flights)
        one, none = np.ones((flights, 1)), np.zeros((flights, 1), dtype=np.int_)
        mu = opening.mu * one
        w, v = w / LENGTH, v / kin.max_speed
        total, gradient, hessian = rewards.scaled(rewards.values)
        pair = np.empty((3, 2, flights, 2 * kin.slots - 1))
        s = pair[:, 0]
        self.scale.enter(s, 0.0, v)
        s[0] = np.maximum(1, np.hypot(s[1], s[2]) + opening.margin)
        pair[:, 1] = mu * cones.inverse(s)
        floor = best_floor(total, self.share * mu)
        weights = 1 / (total - floor)
        least, moves = kin.min_speed / kin.max_speed, self.scale.matrix.moves_v
        self.point = Point(
            w=w,
            v=v,
            y=np.zeros((2, flights, kin.slots - 1)),
            pair=pair,
            margin=s[0] - 1,
            slow=Slow.begin(v, least, moves, mu) if least > 0 else None,
            weights=weights / weights.sum(axis=0),
            total=total,
            floor=floor,
            gradient=gradient * self.scale.matrix.moves_w,
            hessian=hessian,
        )
        self.pace = _Pace(mu, 0 * one, one, -np.inf * one, v, none, none, none, none, none)

    def run(self, max_iterations: int) -> dict[int, End]:
        """Iterate until every search has ended; flat rewards are left out."""
        ends: dict[int, End] = {}
        self._keep(~self.rewards.flat)
        while self.rows.size:
            slope, residual = self._measure()
            converged = residual < self.tolerance
            # not finite: the limits have no interior left
            lost = (self.pace.iterations >= max_iterations) | (self.pace.centrings > _CENTRINGS)
            over = converged | ~np.isfinite(residual) | (lost & (self.pace.attempts == 0))
            for k in np.flatnonzero(over).tolist():
                ends[int(self.rows[k])] = self._end(k, residual[k, 0], converged[k, 0])
            if over.all():
                break
            self._keep(~over)
            self._advance(slope[~over[:, 0]])
        return ends

    def _end(self, k: int, residual: float, converged: bool) -> End:
        """Return the best flight within the limits so far, else the last one."""
        pace, point = self.pace, self.point
        return End(
            v=(pace.v if pace.worth[k, 0] > -np.inf else point.v)[:, k],
            weights=point.weights[:, k, 0],
            iterations=int(pace.iterations[k, 0]),
            residual=float(residual) if np.isfinite(residual) else np.inf,
            converged=bool(converged),
        )

    def _keep(self, flights: Flags) -> None:
        """Go on with these flights (flights, 1) alone."""
        if flights.all():
            return
        chosen = flights[:, 0]
        self.rows = self.rows[chosen]
        self.point, self.pace = only(self.point, chosen), only(self.pace, chosen)
        self.rewards.keep(chosen)

    def _measure(self) -> tuple[Real, Real]:
        """Return the scaled gradient of the Lagrangian and the residual; keep the best point."""
        point, pace, matrix = self.point, self.pace, self.scale.matrix
        slow, n = point.slow, point.w.shape[-1]
        on_w = matrix.pull(point.y) - np.einsum(
            "jb,cjbn->cbn", point.weights[..., 0], point.gradient
        )
        on_v = self.scale.left_over(point.y, point.z[1:, :, n:])
        on_v -= point.z[1:, :, :n] * matrix.moves_v
        size = _sum(np.abs(point.z)) + _sum(np.abs(point.y))
        broken = np.maximum(_largest(point.margin), _largest(matrix.dynamics(point.w, point.v)))
        gap = np.einsum("cbm,cbm->b", point.s, point.z)[:, None]
        gap += (point.weights * (point.total - point.floor)).sum(axis=0)
        if slow is not None:
            on_v -= slow.forces()
            size += _sum(slow.z)
            broken = np.maximum(broken, _largest(slow.margin))
            gap += slow.gap(0.0, 0.0, 0.0)
        slope = np.maximum(_largest(on_w), _largest(on_v)) / np.maximum(1, size / (80 * n))
        worth = point.total.min(axis=0)
        better = (broken < self.tolerance / 10) & (worth > pace.worth)
        pace.worth = np.where(better, worth, pace.worth)
        pace.v = np.where(better, point.v, pace.v)
        # where the rewards are steeper than at the start, their unit is larger
        steepest = np.abs(point.gradient).max(axis=(0, -1))[..., None]
        pace.steep = np.maximum(1, (steepest * point.weights).sum(axis=0))
        slope, gap = slope / pace.steep, gap / pace.steep
        return slope, np.maximum(np.maximum(slope, broken), gap / n)

    def _advance(self, slope: Real) -> None:
        """Try one Newton step of every flight; a refused one is tried anew with a proximal term."""
        pace, point = self.pace, self.point
        fresh = pace.attempts == 0
        pace.iterations = pace.iterations + fresh
        newton, ahead = self._newton()
        length = np.minimum(1, ahead.reach(point))
        now, left = point.gap(), point.gap(length, ahead)
        keep = np.maximum((left / now) ** 3, np.where(slope < 1, 0.01, 0.1))
        pace.mu = np.fmax(np.fmin(pace.mu, keep * now), self.tolerance / 20 * pace.steep)
        second = newton.scaling.second_order(ahead.ds, ahead.dz) * length**2
        step = newton.step(pace.mu, second, ahead.slow[0] * ahead.slow[1] * length**2)
        length = np.minimum(1, _BOUNDARY * step.reach(point))
        moved = self._accept(newton, step, length, newton.factors.sound)
        if not moved.all():
            length = np.where(moved, length, length / 2)
            moved = moved | self._accept(newton, step, length, newton.factors.sound & ~moved)

        lower = np.where(pace.proximal > _PROXIMAL, pace.proximal / 4, 0)
        higher = np.maximum(8 * pace.proximal, _PROXIMAL)
        pace.proximal = np.where(moved, np.where(fresh, lower, pace.proximal), higher)
        pace.attempts = np.where(moved, 0, pace.attempts + 1)
        failed = (pace.attempts >= _PROXIMALS) | ~newton.factors.sound
        short = failed | (moved & (length < _SHORT))
        pace.short = np.where(short, pace.short + 1, np.where(moved, 0, pace.short))
        hugging = moved & (pace.short >= _PATIENCE) & (pace.centrings < _CENTRINGS)
        if (failed | hugging).any():
            self._centre(failed | hugging)

    def _newton(self) -> tuple[Newton, Step]:
        """Factor the systems, with the true curvature where that will do, else with it cut.

        Return also the step for mu = 0.
        """
        pace, point = self.pace, self.point
        scaling = cones.Scaling.between(point.pair)
        cut = pace.skip > 0
        pace.skip = np.maximum(0, pace.skip - 1)
        while True:
            newton = Newton.at(
                self.scale, point, scaling, share=self.share, proximal=pace.proximal, cut=cut
            )
            ahead = newton.step(np.zeros_like(pace.mu))
            will_do = cut | newton.convex(ahead)
            if will_do.all():
                return newton, ahead
            pace.skip = np.where(will_do, pace.skip, _CUT)
            cut = cut | ~will_do

    def _accept(self, newton: Newton, step: Step, length: Real, wanted: Flags) -> Flags:
        """Move the `wanted` flights whose rewards do not fall too far short of the model."""
        point, pace = newton.point, self.pace
        w, v = point.w + length * step.dw, point.v + length * step.dv
        total, gradient, hessian = self.rewards(w)
        finite = np.isfinite(total.sum(axis=0) + _sum(gradient) + _sum(hessian))
        weights = point.weights + length * step.dweights
        missing = (weights * (point.total + length * step.dtotal - total)).sum(axis=0)
        missing -= length**2 * newton.bend(step) / 2
        allowed = _MISFIT * length * np.maximum(newton.decrease(step), 0) + self.rewards.noise
        taken: Flags = wanted & finite & (missing <= allowed)
        if not taken.any():
            return taken
        margin = point.margin * (1 - length)
        pair = point.pair + length * step.moves
        self.scale.enter(pair[:, 0], 1 + margin, v)
        trial = Point(
            w=w,
            v=v,
            y=point.y + np.where(pace.iterations == 1, 1.0, length) * step.dy,
            pair=pair,
            margin=margin,
            slow=point.slow and point.slow.moved(v, length, step.slow[1]),
            weights=weights / weights.sum(axis=0),
            total=total,
            floor=best_floor(total, self.share * pace.mu),
            gradient=gradient * self.scale.matrix.moves_w,
            hessian=hessian,
        )
        self.point = merged(taken, trial, self.point)
        return taken

    def _centre(self, chosen: Flags) -> None:
        """Start the multipliers anew from a larger mu: that leads away from the limits."""
        pace, point = self.pace, self.point
        larger = np.minimum(FAR.mu * pace.steep, _CENTRING * point.gap())
        pace.mu = np.where(chosen, larger, pace.mu)
        self.point = merged(chosen, point.centred(pace.mu, self.share), point)
        pace.proximal = np.where(chosen, 0, pace.proximal)
        pace.attempts, pace.short = (
            np.where(chosen, 0, count) for count in (pace.attempts, pace.short)
        )
        pace.centrings = pace.centrings + chosen


def _sum(values: Real) -> Real:
    """Sum over everything but the flights, (flights, 1)."""
    return np.asarray(values.reshape(-1, *values.shape[-2:]).sum(axis=(0, 2))[:, None])


def _largest(values: Real) -> Real:
    """The largest modulus of all but the flights, (flights, 1)."""
    each = np.abs(values).max(axis=-1, keepdims=True)
    return np.asarray(each.max(axis=0) if each.ndim == 3 else each)
