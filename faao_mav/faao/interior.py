"""The best flight for a max-min of smooth stage rewards: a structured interior-point method.

    maximise  min_j F_j(w),  F_j(w) = (1 / n) sum_n f_jn(w_n)  under (11), (12), (13d)-(13f)

f may be non-concave: the method finds a local optimum near its start. A least speed is kept by
the half-planes of `slow`, which turn with every step. The limits on ||v_n|| and
||a_n|| are second-order cones with Nesterov-Todd scaling, a predictor and a corrector. t <= F_j
is the barrier -mu c sum_j log(F_j - t), t at its optimum at every point. A start on the limits
is widened by a margin that is driven to zero. A Newton step is one banded LU (`newton`). Where the
curvature of sum_j lambda_j f_j has the wrong sign for a maximum it is cut to zero; where the
rewards are then worse than modelled, a proximal term shortens the step. Repeated short steps
mean that the iterates hug the limits: then the multipliers are centred anew.

Inside, lengths are in 100 m, speeds in v_max, accelerations in a_max, rewards summed over the
slots and divided by the largest gradient at the start.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.faao import cones
from faao_mav.faao.kinematics import Kinematics, Trajectory
from faao_mav.faao.newton import FlightScale, Newton, Point, Step, best_floor
from faao_mav.faao.rewards import LENGTH, ScaledRewards, Stage, StageValues
from faao_mav.faao.slow import Slow

__all__ = ["Optimum", "Stage", "StageValues", "maximize"]

_BARRIER = 10.0  # the first mu: smaller follows the start, larger the middle of the limits
_MARGIN = 1.0  # by which the limits are first widened beyond the start
_SHARE = 0.1  # c / n: how much of the barrier keeps the F_j apart
_BOUNDARY = 0.99
_MISFIT = 0.25  # how much worse than modelled a step may be, relative to the model's decrease
_SHORT, _PATIENCE = 0.2, 2
_CENTRINGS, _CENTRING = 8, 1000.0
_PROXIMALS, _PROXIMAL = 6, 1e-3
_CUT = 2  # steps for which the curvature stays cut once it had to be


@dataclass(frozen=True, slots=True)
class Optimum:
    """A feasible flight, its min_j F_j, and the multipliers of t <= F_j, which sum to one.

    `residual` is the largest of: the scaled gradient of the Lagrangian, the violation of a
    limit, and the complementarity gap per slot; `converged` tells that it met the tolerance.
    """

    trajectory: Trajectory
    value: float
    weights: Real
    iterations: int
    residual: float
    converged: bool


def maximize(
    kin: Kinematics,
    stage: Stage,
    start: Trajectory,
    *,
    tolerance: float = 1e-6,
    max_iterations: int = 100,
) -> Optimum:
    """Return a local optimum that is never worse than the feasible `start`.

    Where no gain is to be had, as in saturation, or none was found, that is the start itself.
    `stage` is called once for the start, once per trial step and once for the result.
    """
    rewards = ScaledRewards(stage, start.w)
    if rewards.flat:
        lowest = rewards.first.min() == rewards.first
        return Optimum(start, float(rewards.first.min()), lowest / lowest.sum(), 0, 0.0, True)
    search = _Search(kin, rewards, start, tolerance)
    with np.errstate(all="ignore"):  # a step into the unknown is refused, not warned of
        converged = search.run(max_iterations)
    flight, value = _settle(kin, stage, start, search.best_flight(), float(rewards.first.min()))
    return Optimum(
        flight, value, search.point.weights, search.iterations, search.residual, converged
    )


@dataclass
class _Search:
    """The state of the iteration."""

    kin: Kinematics
    rewards: ScaledRewards
    start: Trajectory
    tolerance: float
    iterations: int = 0
    residual: float = np.inf
    proximal: float = 0.0
    centrings: int = 0
    short: int = 0
    skip: int = 0
    steep: float = 1.0
    point: Point = field(init=False)
    best: tuple[float, Point] | None = None

    def __post_init__(self) -> None:
        self.scale = FlightScale(self.kin)
        self.mu, self.share = _BARRIER, _SHARE * self.kin.slots
        w, v = self.start.w / LENGTH, self.start.v / self.kin.max_speed
        total, gradient, hessian = self.rewards.at_start
        limited = self.scale.limited(v)
        widened = np.maximum(1, np.hypot(*limited) + _MARGIN)
        s = np.vstack([widened, limited])
        weights = 1 / (total - best_floor(total, self.share * self.mu))
        self.point = Point(
            w=w,
            v=v,
            y=np.zeros((self.kin.slots - 1, 2)),
            s=s,
            z=self.mu * cones.inverse(s),
            margin=widened - 1,
            slow=Slow.begin(
                v, self.kin.min_speed / self.kin.max_speed, self.scale.matrix.moves_v[:, 0], self.mu
            ),
            weights=weights / weights.sum(),
            total=total,
            floor=best_floor(total, self.share * self.mu),
            gradient=gradient * self.scale.matrix.moves_w,
            hessian=hessian,
        )

    def run(self, max_iterations: int) -> bool:
        """Iterate; tell whether the tolerance was met."""
        while True:
            slope, self.residual = self._measure()
            if self.residual < self.tolerance:
                return True
            if not np.isfinite(self.residual):  # the limits have no interior left
                self.residual = np.inf
                return False
            if self.iterations >= max_iterations or self.centrings > _CENTRINGS:
                return False
            self.iterations += 1
            length = self._advance(slope)
            self.short = self.short + 1 if length < _SHORT else 0
            if length == 0 or (self.short >= _PATIENCE and self.centrings < _CENTRINGS):
                self._centre()

    def best_flight(self) -> Trajectory:
        """Return the best flight within the limits so far, else the last one, in SI units."""
        point = self.best[1] if self.best else self.point
        v = point.v * self.kin.max_speed
        a = np.vstack([np.diff(v, axis=0) / self.kin.time_step, np.zeros(2)])
        return self.kin.integrate(v[0], a)

    def _measure(self) -> tuple[float, float]:
        """Return the scaled gradient of the Lagrangian and the residual; keep the best point."""
        point, matrix = self.point, self.scale.matrix
        force_w, force_v = matrix.pull(point.y)
        force_w -= np.tensordot(point.weights, point.gradient, 1)
        force_v -= self.scale.spread(point.z[1:]) + point.slow.forces()
        size = (np.abs(point.z).sum() + point.slow.z.sum() + np.abs(point.y).sum()) / (
            8 * point.w.shape[0]
        )
        slope = max(np.abs(force_w).max(), np.abs(force_v).max()) / max(1.0, size / 10)
        margin = max(point.margin.max(), point.slow.margin.max())
        broken = max(margin, np.abs(matrix.dynamics(point.w, point.v)).max())
        gap = (point.s * point.z).sum() + (point.slow.s * point.slow.z).sum()
        gap += point.weights @ (point.total - point.floor)
        worth = float(point.total.min())
        if broken < self.tolerance / 10 and (self.best is None or worth > self.best[0]):
            self.best = worth, point
        # where the rewards are steeper than at the start, their unit is larger
        self.steep = max(1.0, float(np.abs(point.gradient).max(axis=(1, 2)) @ point.weights))
        slope, gap = slope / self.steep, gap / self.steep
        return float(slope), float(np.max([slope, broken, gap / point.w.shape[0]]))

    def _advance(self, slope: float) -> float:
        """Take one step; return the share of the Newton step taken, 0 if none was possible."""
        for attempt in range(_PROXIMALS):
            newton = self._newton()
            if newton is None:
                return 0.0
            ahead = newton.step(0.0)
            length = min(1.0, ahead.reach(self.point))
            now = self.point.gap()
            left = replace(
                self.point,
                s=self.point.s + length * ahead.ds,
                z=self.point.z + length * ahead.dz,
                slow=self.point.slow.linear(length, *ahead.slow),
            ).gap()
            keep = max((left / now) ** 3, 0.01 if slope < 1 else 0.1)
            self.mu = max(min(self.mu, keep * now), self.tolerance / 20 * self.steep)
            second = newton.scaling.second_order(ahead.ds, ahead.dz) * length**2
            step = newton.step(self.mu, second, ahead.slow[0] * ahead.slow[1] * length**2)
            length = min(1.0, _BOUNDARY * step.reach(self.point))
            for _ in range(2):
                if self._accept(newton, step, length):
                    if attempt == 0:
                        self.proximal = self.proximal / 4 if self.proximal > _PROXIMAL else 0.0
                    return length
                length /= 2
            self.proximal = max(8 * self.proximal, _PROXIMAL)
        return 0.0

    def _newton(self) -> Newton | None:
        """Factor the system: with the true curvature where that will do, else with it cut."""
        scaling = cones.Scaling(self.point.s, self.point.z)
        tries = (False,) if self.skip > 0 else (True, False)
        self.skip = max(0, self.skip - 1)
        for exact in tries:
            newton = Newton.at(
                self.scale,
                self.point,
                scaling,
                share=self.share,
                proximal=self.proximal,
                exact=exact,
            )
            if newton is not None:
                return newton
            self.skip = _CUT
        return None

    def _accept(self, newton: Newton, step: Step, length: float) -> bool:
        """Move if the rewards do not fall too far short of the model along `step`."""
        point = self.point
        w, v = point.w + length * step.dw, point.v + length * step.dv
        total, gradient, hessian = self.rewards(w)
        if not np.isfinite(total.sum() + gradient.sum() + hessian.sum()):
            return False
        weights = point.weights + length * step.dweights
        short = float(weights @ (point.total + length * step.dtotal - total))
        short -= length**2 * newton.bend(step) / 2
        if short > _MISFIT * length * max(newton.decrease(step), 0) + self.rewards.noise:
            return False
        margin = point.margin * (1 - length)
        self.point = Point(
            w=w,
            v=v,
            y=point.y + (1.0 if self.iterations == 1 else length) * step.dy,
            s=np.vstack([1 + margin, self.scale.limited(v)]),
            z=point.z + length * step.dz,
            margin=margin,
            slow=point.slow.moved(v, length, point.slow.z + length * step.slow[1]),
            weights=weights / weights.sum(),
            total=total,
            floor=best_floor(total, self.share * self.mu),
            gradient=gradient * self.scale.matrix.moves_w,
            hessian=hessian,
        )
        return True

    def _centre(self) -> None:
        """Start the multipliers anew from a larger mu: that leads away from the limits."""
        self.mu = min(_BARRIER * self.steep, _CENTRING * self.point.gap())
        self.point = self.point.centred(self.mu, self.share)
        self.proximal, self.short = 0.0, 0
        self.centrings += 1


def _settle(
    kin: Kinematics, stage: Stage, start: Trajectory, found: Trajectory, floor: float
) -> tuple[Trajectory, float]:
    """Draw `found` towards the start until it keeps the limits; return the better of the two."""
    allowed = max(1e-9, _excess(kin, start))
    for share in (0.0, *10.0 ** np.arange(-9, 0)):
        flight = Trajectory(
            *(
                (1 - share) * own + share * other
                for own, other in (
                    (found.w, start.w),
                    (found.v, start.v),
                    (found.a, start.a),
                )
            )
        )
        if _excess(kin, flight) <= allowed:
            value = float(stage(flight.w).value.mean(axis=1).min())
            return (flight, value) if value >= floor else (start, floor)
    return start, floor


def _excess(kin: Kinematics, flight: Trajectory) -> float:
    """Return the largest violation of a limit, relative to it."""
    found = kin.residuals(flight)
    slow = found.get("minimum speed", 0.0)
    return max(
        found["(13e) speed"] / kin.max_speed,
        found["(13f) acceleration"] / kin.max_acceleration,
        slow / kin.min_speed if slow else 0.0,
    )
