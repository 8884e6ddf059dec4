"""Constraints g(x_n) >= 0 on the position, the speed or the acceleration of every slot.

g need not be linear: about x_n the method sees the half-plane u^T x >= u^T x_n - g(x_n) with u the
gradient of g. Where g is convex that half-plane lies inside the true set, as for "faster than" and
"outside a disc": a step that keeps the linear slack keeps the true one, which is larger. The
half-planes turn with every step (successive convex approximation, one Newton step each), and the
curvature of g is left out, for it misleads. Where x_n is fixed the slot is off: s = 1, z = 0, no
force.

A g whose Hessian is `bend` times the identity may say so: then its curvature counts. Its slacks
follow g to first order only, and what is missed in second order is its margin.

A new constraint of this kind is one class with two members:

    class NorthOf(HalfPlanes):
        quantity: ClassVar = "w"
        def slack(self, x):
            return x[1] - self.northing / LENGTH, np.array([0.0, 1.0])[:, None, None]
"""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.cones import TINY
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    Move,
    ScaledFlight,
    Start,
    State,
    Stiffness,
    largest,
    summed,
)
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory

MOST_MISSED = 0.3
"""What a step may miss of a g with curvature in second order, where its slack is less.

In squares of v_max or a_max. Measured on seven plans for planes that are hard, from 35 starts in
300 steps: 31 converge, with 0.1 28; without this limit 29."""

_LEFT = 0.1
"""The share of a linear slack that a half-plane which turns leaves at least, by a wider margin:
where an obstacle's nearest side changes, g may be below 0 after a step that ends above. Chosen."""


@dataclass(frozen=True)
class Slacks(State):
    """Scalar slacks s > 0 and multipliers z of inequalities, some per slot, with their margins.

    `on` is one where the inequality holds and zero where there is none, s, z, margin alike
    (..., flights, n). A step is (ds, dz), a target what z + z / s ds has to be, shaped as s.
    """

    on: Real
    s: Real
    z: Real
    margin: Real

    def count(self) -> Real:
        """Return in how many slots the inequality holds, (flights, 1)."""
        return summed(self.on)

    def gap(self, share: Real | float = 0.0, step: Any = None) -> Real:
        """Return the sum of s z after `share` of `step`, (flights, 1)."""
        ds, dz = (0.0, 0.0) if step is None else step[:2]
        both = (self.s + share * ds * self.on) * (self.z + share * dz)
        return summed(both)

    def size(self) -> Real:
        """Return the sum of the multipliers, (flights, 1)."""
        return summed(self.z)

    def violation(self) -> Real:
        """Return the largest margin, (flights, 1)."""
        return largest(self.margin)

    def target(self, mu: Real, ahead: tuple[Real, ...], share: Real) -> Real:
        """Return (mu - ds dz) / s at `share` of the step `ahead`."""
        return np.asarray((self.on * mu - ahead[0] * ahead[1] * share**2) / self.s)

    def raised(self, ds: Real, target: Real | None) -> Real:
        """Return the new multipliers `target` - z / s ds, (flights, n)."""
        change = -self.z * ds / self.s
        return np.asarray(change if target is None else target + change)

    def curvature(self, step: tuple[Real, Real]) -> Real:
        """Return the sum of z / s ds^2, the margins left out, (flights, 1)."""
        ds = step[0] + self.margin
        return summed(self.z / self.s * ds * ds)

    def reach(self, step: tuple[Real, ...]) -> Real:
        """Return the share of `step` at which a slack or a multiplier vanishes, (flights, 1)."""
        falls = np.maximum(
            -step[0] * self.on / self.s, -step[1] * self.on / np.maximum(self.z, TINY)
        )
        falls = falls.reshape(-1, *falls.shape[-2:]).max(axis=(0, 2))[:, None]
        return np.asarray(1 / np.maximum(falls, TINY))


@dataclass(frozen=True)
class HalfPlanesState(Slacks):
    """A constraint g(x_n) >= 0 at an iterate: s = g + margin, its gradient u, shaped (2, *s)."""

    constraint: "HalfPlanes"
    flight: ScaledFlight
    u: Real

    def forces(self) -> Forces:
        """Return u z."""
        return self._on_quantity(self.z)

    def stiffness(self) -> Stiffness:
        """Return z / s u u^T - `bend` z I."""
        x, y = self.u
        packed: Any = _per_slot(self.z / self.s * np.stack([x * x, x * y, y * y]))
        curved = -self.constraint.bend * self.z.reshape(-1, *self.z.shape[-2:]).sum(axis=0)
        if self.constraint.bend > 0:
            turning = np.stack([curved, 0 * curved, curved])
            return Stiffness(**{self.constraint.quantity: packed}, turning=turning)
        packed[::2] += curved
        return Stiffness(**{self.constraint.quantity: packed})

    def push(self, target: Real | None) -> Forces:
        """Return the forces u z+ where x stays: those of the margins, or of `target`."""
        return self._on_quantity(self.raised(-self.margin, None) if target is None else target)

    def solved(
        self,
        move: Move,
        target: Real | None,
        rest: Forces,
    ) -> tuple[tuple[Real, Real, Real | float], Forces]:
        """Return the change of the linear slack along `move`, with that of its multiplier.

        With curvature the last of the changes is the squared length of that of x, else 0.
        """
        dx = self.constraint.bounded(self.flight, move.w, move.v)
        ds = np.asarray(self.u[0] * dx[0] + self.u[1] * dx[1] - self.margin)
        z, square = self.raised(ds, target), 0.0
        if self.constraint.bend:
            square = dx[0] * dx[0] + dx[1] * dx[1]
            if self.constraint.quantity == "a":
                # the forces asked for: z / s ds loses every digit where the limit is active
                left = self.u * (rest.a - self.constraint.bend * self.z * dx)
                size = self.u[0] * self.u[0] + self.u[1] * self.u[1]
                active = self.on * self.z > self.s
                z = np.where(active, left.sum(axis=0) / np.maximum(size, TINY), z)
        return (ds, z - self.z, square), self._on_quantity(z)

    def curvature(self, step: Any) -> Real:
        """Return the sum of z / s ds^2 and of what g curves towards a maximum, (flights, 1)."""
        bent = max(0.0, -self.constraint.bend)
        return super().curvature(step[:2]) + (bent * summed(self.z * step[2]) if bent else 0.0)

    def reach(self, step: Any) -> Real:
        """Return the share at which a slack or a multiplier vanishes, or too much is missed."""
        share = super().reach(step)
        if self.constraint.bend:
            missed = self.on * step[2] / 2 / np.maximum(self.s, MOST_MISSED)
            share = np.minimum(share, 1 / np.sqrt(np.maximum(largest(missed), TINY)))
        return share

    def violation(self) -> Real:
        """Return the largest margin; what is missed in second order counts tenfold."""
        return super().violation() * (10 if self.constraint.bend else 1)

    def moved(
        self, w: Real, v: Real, share: Real | float, step: tuple[Real, ...]
    ) -> "HalfPlanesState":
        """Return the state after `share` of `step`, with g and u at w and v."""
        g, u = self.constraint.slack(self.constraint.bounded(self.flight, w, v))
        linear = self.s + share * step[0] * self.on
        if self.constraint.bend:
            s = linear
            margin = (s - g + self.constraint.inside) * self.on
        else:
            short = self.on * (_LEFT * linear - g + self.constraint.inside)
            margin = np.maximum(self.margin * (1 - share), short)
            s = np.where(self.on > 0, g - self.constraint.inside + margin, 1.0)
        return replace(self, s=s, z=self.z + share * step[1], margin=margin, u=u * self.on)

    def centred(self, mu: Real) -> "HalfPlanesState":
        """Return the same slacks with z = mu / s."""
        return replace(self, z=mu * self.on / self.s)

    def _on_quantity(self, z: Real) -> Forces:
        forces = _per_slot(self.u * z)
        return Forces(**{self.constraint.quantity: forces})


def _per_slot(parts: Real) -> Real:
    """Return the sum of `parts` (k, [rows,] flights, n) over the rows, (k, flights, n)."""
    return parts if parts.ndim == 3 else np.asarray(parts.sum(axis=1))


class HalfPlanes(Constraint):
    """A constraint g(x_n) >= 0 in solver units; subclasses say what x and g are."""

    quantity: ClassVar[Literal["w", "v", "a"]]
    """What x is: the scaled position w, speed v or acceleration a."""

    @property
    def inside(self) -> float:
        """By how much the method's g is smaller, so that its result ends inside the true set.

        Chosen: ten times the margin that a search to a tolerance of 1e-6 may leave.
        """
        return 1e-6

    @property
    def headroom(self) -> float:
        """The slack that starts are given where they have less. Chosen, as 10 m or v_max / 10.

        Warm starts have less where g has curvature.
        """
        return 0.1

    @property
    def bend(self) -> float:
        """The curvature of g, in multiples of the identity, where it is to count; 0 if not."""
        return 0.0

    @property
    def curved(self) -> bool:
        """Return whether the curvature of g counts."""
        return self.bend != 0

    @abstractmethod
    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return g (flights, n) and its gradient (2, flights, n) at x (2, flights, n).

        With several inequalities per slot g is (rows, flights, n) and its gradient (2, *g).
        """

    def bounded(self, flight: ScaledFlight, w: Real, v: Real) -> Real:
        """Return x (2, flights, n) at scaled w and v, or its change at changes of them."""
        return {"w": w, "v": v}[self.quantity] if self.quantity != "a" else flight.accelerations(v)

    def held(self, flight: ScaledFlight, shape: tuple[int, ...]) -> Real:
        """Return one where the inequalities, in the `shape` of g, hold: where x is free; else 0."""
        matrix = flight.matrix
        free = {"w": matrix.moves_w, "v": matrix.moves_v, "a": 1.0 * (flight.gains > 0)}
        return np.broadcast_to(free[self.quantity], shape)

    def begin(self, flight: ScaledFlight, start: Start) -> HalfPlanesState:
        """Return the centred state at `start`, widened where g is less than `headroom`."""
        x = self.bounded(flight, start.w, start.v)
        g, u = self.slack(x)
        on, none = self.held(flight, g.shape), np.zeros(g.shape)
        headroom = self.headroom * (min(1.0, start.margin) if self.curved else 1.0)
        margin = on * np.maximum(0, self.inside + headroom - g)
        s = np.where(on > 0, g - self.inside + margin, 1.0)
        unset = HalfPlanesState(on, s, none, margin, self, flight, u * on)
        return unset.centred(start.mu)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest -g of the flight, 0 where there is none."""
        x = {
            "w": flight.w / LENGTH,
            "v": flight.v / kin.max_speed,
            "a": flight.a[kin.first_bounded_acceleration : -1] / kin.max_acceleration,
        }[self.quantity]
        return max(0.0, -float(self.slack(x.T[:, None])[0].min()))
