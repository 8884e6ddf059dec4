"""The limits of (13e), (13f), ||v_n|| <= v_max and ||a_n|| <= a_max, as second-order cones.

Both stand in one array of 2 n - 1 cones, (v_0 .. v_{n-1}, a_0 .. a_{n-2}): a numpy call on some
hundred slots costs more in the call than in the arithmetic. x = D v = (v, k (v_{n+1} - v_n)) is
what they bound, in units of v_max and a_max, zero where it is fixed or not bounded. In wind the
airspeed has n cones of its own.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior import cones
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    Move,
    ScaledFlight,
    Start,
    State,
    Stiffness,
    quadratic,
)
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.plan import Vector


@dataclass(frozen=True)
class FlightLimits(Constraint):
    """The limits on speed and acceleration: always the first constraint of a search."""

    def begin(self, flight: ScaledFlight, start: Start) -> "LimitsState":
        """Return slacks s_0 = ||x|| + `start.margin`, at least 1, and centred multipliers."""
        return LimitsState.centred_at(start, flight, 2 * flight.matrix.slots - 1)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest violation of (13e) or (13f), relative to the limit."""
        missed = kin.residuals(flight)
        return max(
            missed["(13e) speed"] / kin.max_speed,
            missed["(13f) acceleration"] / kin.max_acceleration,
        )


@dataclass(frozen=True)
class LimitsState(State):
    """Slacks and multipliers `pair` (3, 2, flights, m) of the m = 2 n - 1 cones; margin = s_0 - 1.

    A target is (3, flights, m), a step (ds, dz) has the shape of `pair`.
    """

    flight: ScaledFlight
    pair: Real
    margin: Real

    @classmethod
    def centred_at(cls, start: Start, flight: ScaledFlight, count: int, *given: Any) -> Self:
        """Return the state of `count` cones at `start`; `given` are the fields of a subclass."""
        pair = np.empty((3, 2, start.w.shape[1], count))
        state = cls(flight, pair, pair[0, 0], *given)
        s = pair[:, 0]
        state.enter(s, 0.0, start.v)
        s[0] = np.maximum(1, np.hypot(s[1], s[2]) + start.margin)
        pair[:, 1] = start.mu * cones.inverse(s)
        return replace(state, margin=s[0] - 1)

    @cached_property
    def scaling(self) -> cones.Scaling:
        """The scaling between slacks and multipliers."""
        return cones.Scaling.between(self.pair)

    def count(self) -> int:
        """Return m."""
        return int(self.pair.shape[-1])

    def gap(self, share: Real | float = 0.0, step: Any = None) -> Real:
        """Return the sum of s^T z after `share` of `step`, (flights, 1)."""
        pair = self.pair if step is None else self.pair + share * step
        return np.asarray(np.einsum("cbm,cbm->b", pair[:, 0], pair[:, 1])[:, None])

    def size(self) -> Real:
        """Return the sum of the moduli of the multipliers, (flights, 1)."""
        return np.asarray(np.abs(self.pair[:, 1]).sum(axis=(0, 2))[:, None])

    def violation(self) -> Real:
        """Return the largest margin, (flights, 1)."""
        return np.asarray(np.abs(self.margin).max(axis=-1, keepdims=True))

    def forces(self) -> Forces:
        """Return the multipliers of speeds and accelerations."""
        return self.split(self.pair[1:, 1])

    def stiffness(self) -> Stiffness:
        """Return the blocks of W^-2 on x, and their inverse on the accelerations."""
        n = self.flight.matrix.slots
        scaling = self.scaling
        return Stiffness(
            v=scaling.stiffness[..., :n],
            a=scaling.stiffness[..., n:],
            compliance=scaling.compliance(slice(n, None)),
        )

    def push(self, target: Real | None) -> Forces:
        """Return -W^-2 (-margin, 0) for x, or `target` for x."""
        if target is None:
            return self.split(self.scaling.coupling() * self.margin)
        return self.split(target[1:])

    def target(self, mu: Real, ahead: Real, share: Real) -> Real:
        """Return mu s^-1 - W^-1 (l^-1 o (W^-1 ds o W dz)) at `share` of the step `ahead`."""
        correction = self.scaling.second_order(ahead[:, 0], ahead[:, 1]) * share**2
        return np.asarray(mu * cones.inverse(self.pair[:, 0]) - correction)

    def solved(self, move: Move, target: Real | None, rest: Forces) -> tuple[Real, Forces]:
        """Return (ds, dz) with the z_1 that `rest` asks for: W^-2 ds_1 would lose its digits."""
        n = self.flight.matrix.slots
        step = np.empty_like(self.pair)
        z = step[:, 1]
        self.enter(step[:, 0], -self.margin, move.v, change=True)
        z[1:, :, :n] = rest.v
        z[1:, :, n:] = rest.a
        z[0] = self.scaling.radial(target, -self.margin, z[1:])
        z -= self.pair[:, 1]
        return step, rest

    def curvature(self, step: Real) -> Real:
        """Return ds_1^T W^-2 ds_1, (flights, 1)."""
        return quadratic(self.scaling.stiffness, step[1:, 0])

    def reach(self, step: Real) -> Real:
        """Return the share of `step` at which a slack or a multiplier leaves its cone."""
        return np.asarray(cones.reach(self.pair, step).min(axis=0))

    def moved(self, w: Real, v: Real, share: Real, step: Real) -> Self:  # noqa: ARG002
        """Return the state after `share` of `step`, with the slacks of the speeds v themselves."""
        margin, pair = self.margin * (1 - share), self.pair + share * step
        self.enter(pair[:, 0], 1 + margin, v)
        return replace(self, pair=pair, margin=margin)

    def centred(self, mu: Real) -> Self:
        """Return the same slacks with z = mu s^-1."""
        s = self.pair[:, 0]
        return replace(self, pair=np.stack([s, mu * cones.inverse(s)], axis=1))

    def split(self, on_x: Real) -> Forces:
        """Return forces on x (2, flights, m) as forces on speeds and accelerations."""
        n = self.flight.matrix.slots
        return Forces(v=on_x[..., :n], a=on_x[..., n:])

    def enter(self, s: Real, first: Real | float, v: Real, *, change: bool = False) -> None:  # noqa: ARG002
        """Enter s_0 = `first` and s_1 = D v, at free speeds and bounded accelerations, into s.

        v are speeds or, with `change`, changes of speeds.
        """
        n = self.flight.matrix.slots
        s[0] = first
        s[1:, :, :n] = v * self.flight.matrix.moves_v
        s[1:, :, n:] = self.flight.accelerations(v)


@dataclass(frozen=True)
class AirspeedLimit(Constraint):
    """The limit ||v_n - `wind`|| <= `most`, both in v_max."""

    most: float
    wind: Vector

    def begin(self, flight: ScaledFlight, start: Start) -> "AirspeedState":
        """Return slacks and multipliers as those of `FlightLimits` begin."""
        return AirspeedState.centred_at(start, flight, flight.matrix.slots, self)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest violation, relative to the limit."""
        return kin.residuals(flight)["airspeed"] / kin.max_airspeed


@dataclass(frozen=True)
class AirspeedState(LimitsState):
    """As `LimitsState`, of the n cones on x = (v - wind) / most, zero where v is fixed."""

    limit: AirspeedLimit

    def stiffness(self) -> Stiffness:
        """Return the blocks of W^-2 on v."""
        return Stiffness(v=self.scaling.stiffness / self.limit.most**2)

    def solved(self, move: Move, target: Real | None, rest: Forces) -> tuple[Real, Forces]:  # noqa: ARG002
        """Return (ds, dz) with z_1 = target_1 - (W^-2 ds)_1."""
        step = np.empty_like(self.pair)
        ds, z = step[:, 0], step[:, 1]
        self.enter(ds, -self.margin, move.v, change=True)
        xx, xy, yy = self.scaling.stiffness
        z[1:] = self.scaling.coupling() * self.margin
        z[1:] -= np.stack([xx * ds[1] + xy * ds[2], xy * ds[1] + yy * ds[2]])
        if target is not None:
            z[1:] += target[1:]
        z[0] = self.scaling.radial(target, -self.margin, z[1:])
        supplied = self.split(z[1:])
        z -= self.pair[:, 1]
        return step, supplied

    def split(self, on_x: Real) -> Forces:
        """Return forces on x (2, flights, n) as forces on speeds."""
        return Forces(v=on_x / self.limit.most)

    def enter(self, s: Real, first: Real | float, v: Real, *, change: bool = False) -> None:
        """Enter s_0 = `first` and the airspeeds at the speeds v, or at their `change`, into s."""
        wind = np.zeros(2) if change else np.array(self.limit.wind)
        s[0] = first
        s[1:] = (v - wind[:, None, None]) * (self.flight.matrix.moves_v / self.limit.most)
