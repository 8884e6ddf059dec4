"""How fast an airspeed may change: thrust and drag limit it along the path, not across.

With the airspeed s_n = ||v_n - u|| in the wind u, at most a fall d, m/s^2, and at most a power P
per mass, m^2/s^3, that raises it, each slot keeps

    1 - (s_n - s_{n+1}) / (d delta_t) >= 0,  1 - (s_{n+1}^2 - s_n^2) / (2 P delta_t) >= 0

As `min_speed` says, a flight can turn as a whole, which neither feels: their curvature counts, and
slacks follow them to first order only.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.banded import Entry, V
from faao_mav.optimizer.interior.cones import TINY
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    Move,
    ScaledFlight,
    Start,
    Stiffness,
    largest,
    summed,
)
from faao_mav.optimizer.interior.half_planes import MOST_MISSED, Slacks
from faao_mav.optimizer.interior.min_speed import INSIDE
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.plan import Vector

_HEADROOM = 0.1
"""The slack of a cold start that has less, in shares of the limit; less of a warm one. Chosen."""


@dataclass(frozen=True)
class SpeedChange(Constraint):
    """In a slot the airspeed falls by at most `fall`, and half its square rises by `rise`.

    In v_max and its square; so is `wind`.
    """

    fall: float
    rise: float
    wind: Vector = (0.0, 0.0)

    @property
    def curved(self) -> bool:
        """Return True."""
        return True

    def entries(self, slots: int, first: int) -> Sequence[Entry]:  # noqa: ARG002
        """Return the room for what couples neighbouring speeds."""
        return (Entry(V.stop - 1, V.start, np.zeros(slots - 1), ahead=1),)

    def begin(self, flight: ScaledFlight, start: Start) -> "SpeedChangeState":
        """Return the centred state at `start`, widened where little of a limit is left."""
        on = np.broadcast_to(1.0 * (flight.gains > 0), (2, start.v.shape[1], len(flight.gains)))
        none = 0.0 * on
        state = SpeedChangeState(on, on, none, none, self, flight, *[none] * 5)
        state = state.at(start.v)
        g = state.slack - INSIDE
        margin = on * np.maximum(0, _HEADROOM * min(1.0, start.margin) - g)
        return replace(state, s=np.where(on > 0, g + margin, 1.0), margin=margin).centred(start.mu)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest violation, relative to the limit."""
        missed = kin.residuals(flight)
        fall = missed["fall of airspeed"] / kin.most_fall
        return max(fall, missed["power of airspeed"] / kin.most_power)


@dataclass(frozen=True)
class SpeedChangeState(Slacks):
    """Both limits at an iterate, the fall first: s, z, margin and `slack` are (2, flights, n - 1).

    `ahead` (2, flights, n) is the direction of the airspeed, 0 where it is fixed. Along it the
    limits have the derivatives `slopes` (2, 2, flights, n - 1), by the airspeeds before and after;
    `across` and `along`, of the same shape, are their second derivatives.
    """

    constraint: SpeedChange
    flight: ScaledFlight
    slack: Real
    ahead: Real
    slopes: Real
    across: Real
    along: Real

    def at(self, v: Real) -> "SpeedChangeState":
        """Return the state with the limits at the scaled speeds `v` (2, flights, n)."""
        limit = self.constraint
        x = v - np.reshape(limit.wind, (2, 1, 1))
        speed = np.maximum(np.hypot(*x), TINY)
        before, after = speed[:, :-1], speed[:, 1:]
        per_fall, per_rise = 1 / limit.fall, np.full_like(before, 1 / limit.rise)
        slack = np.stack(
            [1 + per_fall * (after - before), 1 - per_rise * (after**2 - before**2) / 2]
        )
        fall = np.stack([np.full_like(before, -per_fall), np.full_like(before, per_fall)])
        rise = np.stack([per_rise * before, -per_rise * after])
        slopes, bend = np.stack([fall, rise]), np.stack([per_rise, -per_rise])
        return replace(
            self,
            slack=slack,
            ahead=x / speed * self.flight.matrix.moves_v,
            slopes=slopes,
            across=np.stack([fall / np.stack([before, after]), bend]),
            along=np.stack([0 * fall, bend]),
        )

    def forces(self) -> Forces:
        """Return the gradients times z."""
        return self._forces(self.z)

    def stiffness(self) -> Stiffness:
        """Return z / s J^T J, and the curvatures times z."""
        east, north = self.ahead
        outer = np.stack([east * east, east * north, north * north])
        both = self.on * self.z / self.s
        squared = _joined((both[:, None] * self.slopes**2).sum(axis=0))
        coupled = (both * self.slopes[:, 0] * self.slopes[:, 1]).sum(axis=0)
        across, along = (
            -_joined((self.z[:, None] * each).sum(axis=0)) for each in (self.across, self.along)
        )
        turning = (along - across) * outer
        turning[::2] += across * self.flight.matrix.moves_v
        return Stiffness(
            v=squared * outer,
            turning=turning,
            between=coupled * self.ahead[:, None, :, :-1] * self.ahead[None, :, :, 1:],
        )

    def push(self, target: Real | None) -> Forces:
        """Return the forces of the margins, or of `target`, where the speeds stay."""
        return self._forces(self.raised(-self.margin, None) if target is None else target)

    def solved(
        self,
        move: Move,
        target: Real | None,
        rest: Forces,  # noqa: ARG002
    ) -> tuple[tuple[Real, Real, Real], Forces]:
        """Return the changes of linear slack and multiplier, and what is missed of g, doubled."""
        along = (self.ahead * move.v).sum(axis=0)
        square = (move.v * move.v).sum(axis=0)
        ds = (self.slopes * _ends(along)).sum(axis=1) - self.margin
        z = self.raised(ds, target)
        missed = self.along * _ends(along**2) + self.across * _ends(square - along**2)
        return (ds, z - self.z, missed.sum(axis=1)), self._forces(z)

    def curvature(self, step: Any) -> Real:
        """Return the sum of z / s ds^2, the margins left out."""
        return super().curvature(step[:2])

    def reach(self, step: Any) -> Real:
        """Return the share at which a slack or a multiplier vanishes, or too much is missed."""
        missed = self.on * step[2] / 2 / np.maximum(self.s, MOST_MISSED)
        return np.minimum(super().reach(step), 1 / np.sqrt(np.maximum(largest(missed), TINY)))

    def violation(self) -> Real:
        """Return the largest margin, tenfold as it is missed in second order."""
        return 10 * super().violation()

    def moved(self, w: Real, v: Real, share: Real, step: Any) -> "SpeedChangeState":  # noqa: ARG002
        """Return the state after `share` of `step`, with the limits at v."""
        s, z = self.s + share * step[0] * self.on, self.z + share * step[1] * self.on
        then = replace(self, s=s, z=z).at(v)
        return replace(then, margin=(s - then.slack + INSIDE) * self.on)

    def missing(self, share: Real, step: Any, then: "SpeedChangeState") -> Real:  # noqa: ARG002
        """Return by how much more of the limits is missed than in first order, weighted.

        Without it some searches go to and fro: a flight of 25 s with a least speed of 5 m/s.
        """
        return summed(then.z * np.maximum(0, then.margin - (1 - share) * self.margin))

    def centred(self, mu: Real) -> "SpeedChangeState":
        """Return the same slacks with z = mu / s."""
        return replace(self, z=mu * self.on / self.s)

    def _forces(self, z: Real) -> Forces:
        pull = _joined(((self.on * z)[:, None] * self.slopes).sum(axis=0))
        return Forces(v=pull * self.ahead)


def _ends(values: Real) -> Real:
    """Return `values` (flights, n) before and after each slot, (2, flights, n - 1)."""
    return np.stack([values[:, :-1], values[:, 1:]])


def _joined(ends: Real) -> Real:
    """Return the sums (flights, n) of `ends` (2, flights, n - 1), before and after each slot."""
    sums = np.zeros((ends.shape[1], ends.shape[2] + 1))
    sums[:, :-1] += ends[0]
    sums[:, 1:] += ends[1]
    return sums


def speed_change(kin: Kinematics) -> SpeedChange:
    """Return the limits of `kin` on the change of the airspeed."""
    east, north = (part / kin.max_speed for part in kin.wind)
    rise = kin.most_power * kin.time_step / kin.max_speed**2
    return SpeedChange(kin.most_fall * kin.time_step / kin.max_speed, rise, (east, north))
