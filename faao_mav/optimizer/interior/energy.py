"""The energy that a flight may take: sum_n P(v_n, a_n) delta_t <= E, one inequality for it all.

P is smooth but not convex: a copter that hovers takes more than one that flies slowly. The Newton
matrix has the positive part of P's Hessians by v and by a, and where limits are `curved` the rest
too, with what couples both. The gradient of the sum couples all slots. So that the matrix stays
banded the sum runs along: with g_n the gradient by v_n and two unknowns per slot, the change e_n of
the sum before slot n and a copy lambda_n of the multiplier,

    e_0 = 0,  e_n - e_{n+1} + g_n dv_n = 0,  lambda_n = lambda_{n-1}

and the last slot, with e + g dv - s / z lambda = -s / z target - margin, closes the balance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.banded import Entry, V
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    Move,
    ScaledFlight,
    Start,
    Stiffness,
    positive_part,
    quadratic,
)
from faao_mav.optimizer.interior.half_planes import Slacks
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.plan import Vector
from faao_mav.power import PowerModel, PowerPartials

_INSIDE = 1e-5
"""The share of the energy that the method does not use, so that its result ends within the limit.

Chosen: ten times the margin that a search to a tolerance of 1e-4 may leave."""

_HEADROOM = 0.1
"""The slack of a cold start that has less, in shares of the energy; less of a warm one. Chosen."""

_LEAST_MARGIN = 0.01
"""The least share of `_HEADROOM`, for searches that widen no other limit. Chosen."""


@dataclass(frozen=True)
class EnergyLimit(Constraint):
    """At most `most` J for flying at the speeds v_n through air that moves with `wind`, m/s."""

    model: PowerModel
    most: float
    time_step: float
    max_speed: float
    wind: Vector = (0.0, 0.0)
    curved: bool = False

    @property
    def unknowns(self) -> int:
        """Return 2: e_n and lambda_n."""
        return 2

    def entries(self, slots: int, first: int) -> Sequence[Entry]:
        """Return what the running sum has of its neighbours."""
        begins, room = np.eye(slots)[0], Entry(V.stop - 1, V.start, np.zeros(slots - 1), ahead=1)
        return (
            *([room] if self.curved else []),  # for what couples neighbouring speeds
            Entry(first + 1, first, 1 - begins),
            Entry(first, first + 1, -np.ones(slots - 1), ahead=1),
            Entry(first, first, begins),
        )

    def begin(self, flight: ScaledFlight, start: Start) -> "EnergyState":
        """Return the centred state at `start`, widened where little of the energy is left."""
        on, none = np.ones((start.w.shape[1], 1)), np.zeros((1, 1))
        state = EnergyState(
            on, on, on, on, self, flight, start.own, none, none, none, none, none, none
        )
        state = state.at(start.v)
        headroom = _HEADROOM * min(1.0, max(start.margin, _LEAST_MARGIN))
        s = np.maximum(state.left, headroom * state.slots)
        return replace(state, s=s, margin=s - state.left).centred(start.mu)

    def partials(self, v: Real, a: Real) -> PowerPartials:
        """Return the power, W, at v over ground and a, (2, ...), m/s, m/s^2, with derivatives."""
        return self.model.partials(v - np.reshape(self.wind, (2, *[1] * (v.ndim - 1))), a)

    def used(self, flight: Trajectory) -> float:
        """Return what `flight` takes, J."""
        return self.time_step * float(self.partials(flight.v.T, flight.a.T).value.sum())

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:  # noqa: ARG002
        """Return the share by which `flight` takes more."""
        return max(0.0, self.used(flight) / self.most - 1)


@dataclass(frozen=True)
class EnergyState(Slacks):
    """The limit at an iterate, in units of a slot's even share of the energy.

    on, s, z and margin are (flights, 1), and so is `left`, what is left of the energy, of which s
    is larger by the margin. What is used has the gradient `by_v` (2, flights, n) by the scaled
    speeds, and the curvatures `on_v` (3, flights, n) and `on_a` (3, flights, n - 1). Where limits
    are curved `turning` (3, flights, n) and `across` (2, 2, flights, n - 1) are the rest.
    """

    constraint: EnergyLimit
    flight: ScaledFlight
    own: slice
    left: Real
    by_v: Real
    on_v: Real
    on_a: Real
    turning: Real
    across: Real

    @property
    def slots(self) -> int:
        """Number of time slots."""
        return self.flight.matrix.slots

    def at(self, v: Real) -> "EnergyState":
        """Return the state with what is used at the scaled speeds `v` (2, flights, n)."""
        limit, flight = self.constraint, self.flight
        per_dv, dt = limit.max_speed / limit.time_step, limit.time_step
        a = np.zeros_like(v)
        a[..., :-1] = per_dv * (v[..., 1:] - v[..., :-1])
        power = limit.partials(limit.max_speed * v, a)
        unit = limit.most / self.slots
        by_v, by_a = power.by_v * limit.max_speed, power.by_a[..., :-1] * per_dv
        by_v[..., :-1] -= by_a
        by_v[..., 1:] += by_a
        kept, across = positive_part(power.by_vv), power.by_va[..., :-1] * limit.max_speed * per_dv
        turning = (power.by_vv - kept) * limit.max_speed**2
        turning[0, :, :-1] -= 2 * across[0, 0]
        turning[1, :, :-1] -= across[0, 1] + across[1, 0]
        turning[2, :, :-1] -= 2 * across[1, 1]
        return replace(
            self,
            left=(1 - _INSIDE) * self.slots - power.value.sum(axis=-1, keepdims=True) * dt / unit,
            by_v=by_v * (dt / unit * flight.matrix.moves_v),
            turning=turning * dt / unit,
            across=across * dt / unit,
            on_v=kept * (dt / unit * limit.max_speed**2),
            on_a=power.by_aa[..., :-1] * (dt / unit * (per_dv / flight.gain) ** 2),
        )

    def violation(self) -> Real:
        """Return the margin in tenths of the energy."""
        return np.asarray(10 / self.slots * np.abs(self.margin))

    def forces(self) -> Forces:
        """Return minus the gradient of what is used, times z."""
        return Forces(v=-self.z * self.by_v)

    def stiffness(self) -> Stiffness:
        """Return the curvatures times z, and what the running sum has of the speeds."""
        multiplier, z = self.own.start + 1, self.z
        closes = np.zeros((len(z), self.slots))
        closes[:, -1:] = -self.s / z
        entries = [Entry(multiplier, V.start + axis, self.by_v[axis]) for axis in (0, 1)]
        return Stiffness(
            v=z * self.on_v,
            a=z * self.on_a if self.on_a.any() else 0.0,
            entries=[*entries, Entry(multiplier, multiplier, closes)],
            turning=z * self.turning if self.constraint.curved else 0.0,
            across=z * self.across if self.constraint.curved else 0.0,
        )

    def push(self, target: Real | None) -> Forces:
        """Return the right-hand side of the last slot."""
        own = np.zeros((len(self.z), self.slots, 2))
        own[:, -1, 1:] = -self.margin if target is None else -self.s / self.z * target
        return Forces(own=own)

    def solved(self, move: Move, target: Real | None, rest: Forces) -> tuple[Any, Forces]:  # noqa: ARG002
        """Return the changes of slack and multiplier along `move`, and its curvature."""
        z = move.unknowns[:, -1:, self.own.start + 1]
        ds = -np.einsum("cbn,cbn->b", self.by_v, move.v)[:, None] - self.margin
        da = self.flight.accelerations(move.v)
        bent = self.z * (quadratic(self.on_v, move.v) + quadratic(self.on_a, da))
        supplied = Forces(
            v=-z * self.by_v - self.z * _times(self.on_v, move.v),
            a=-self.z * _times(self.on_a, da),
        )
        rest_bent = np.zeros_like(bent)
        if self.constraint.curved:
            both = np.einsum("ijbn,ibn,jbn->b", self.across, move.v[..., :-1], move.v[..., 1:])
            rest_bent = self.z * (quadratic(self.turning, move.v) + 2 * both[:, None])
        return (ds, z - self.z, bent, rest_bent), supplied

    def curvature(self, step: Any) -> Real:
        """Return z / s ds^2, the margin left out, and the curvature along the step."""
        return np.asarray(super().curvature(step[:2]) + step[2])

    def moved(self, w: Real, v: Real, share: Real, step: Any) -> "EnergyState":  # noqa: ARG002
        """Return the state after `share` of `step`, with what is used at v."""
        then = replace(self, s=self.s + share * step[0], z=self.z + share * step[1]).at(v)
        return replace(then, margin=then.s - then.left)

    def missing(self, share: Real, step: Any, then: "EnergyState") -> Real:
        """Return by how much more is used than the model says, weighted."""
        return np.asarray(
            then.z * (then.margin - (1 - share) * self.margin) - share**2 / 2 * (step[2] + step[3])
        )

    def centred(self, mu: Real) -> "EnergyState":
        """Return the same slack with the multiplier mu / s."""
        return replace(self, z=mu / self.s)


def _times(packed: Real, x: Real) -> Real:
    """Return M x (2, flights, n) of M (3, flights, n) and x (2, flights, n)."""
    xx, xy, yy = packed
    return np.stack([xx * x[0] + xy * x[1], xy * x[0] + yy * x[1]])
