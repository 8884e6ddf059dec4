"""What a flight has to keep: the interface between constraints and the interior-point method.

A `Constraint` describes a limit and `begin`s its `State` at the starts. A state holds slacks s > 0
and multipliers z > 0 of several flights side by side, and answers everything that the method asks;
`search`, `newton` and `iterate` name no constraint. Linearised at an iterate, each asks for

    z+ + K ds = target,    target = mu / s - correction,    ds = J (dw, dv) - margin

with z+ the new multipliers, J the gradient of its slacks and K its stiffness. A state reports K
and the forces of z+ at a direction of zero; once the direction is known, it returns its changes
(ds, dz).

The states of a search are asked from the last to the first. The first one, the limits on speed and
acceleration, closes the balance: it takes the forces on v and a that the equations of motion ask
for and no other state supplies, because K ds loses every digit where its own limit is active.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, Protocol

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.banded import SIZE, Entry, FlightMatrix
from faao_mav.optimizer.interior.cones import TINY
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory


@dataclass(frozen=True, slots=True)
class Forces:
    """What multipliers do to w, v (2, flights, n) and a (2, flights, n - 1), scaled; 0 if nothing.

    `own` (flights, n, k) is what they do to the k unknowns per slot that the constraint brings.
    """

    w: Real | float = 0.0
    v: Real | float = 0.0
    a: Real | float = 0.0
    own: Real | float = 0.0

    @classmethod
    def total(cls, forces: "Sequence[Forces]") -> "Forces":
        """Return the sum of `forces` on w, v and a."""
        if len(forces) == 1:
            return forces[0]
        return cls(*(added(getattr(each, part) for each in forces) for part in "wva"))

    def less(self, other: "Forces") -> "Forces":
        """Return the forces on v and a without those of `other`."""
        return Forces(v=self.v - other.v, a=self.a - other.a)


@dataclass(frozen=True, slots=True)
class Stiffness:
    """The symmetric 2x2 blocks of K on w, v (3, flights, n) and a (3, flights, n - 1), 0 if none.

    `compliance` is the inverse of `a`, for a constraint that knows it better than by inversion.
    `entries` are those of the constraint's own unknowns, of which the proximal term holds the
    places `held` as it does w. `curvature` (3, flights, n) is that of its functions of w, weighted
    by their multipliers, which is cut where it has the wrong sign. `turning` (3, flights, n) is
    more of K on v, `across` (2, 2, flights, n - 1) between v_n and v_{n+1}: of both, and of what is
    cut elsewhere, as large a share counts as leaves the model concave. The first constraint is then
    no `FlightLimits`. `between`, shaped as `across`, is what K itself has there.
    """

    w: Real | float = 0.0
    v: Real | float = 0.0
    a: Real | float = 0.0
    compliance: Real | None = None
    entries: Sequence[Entry] = ()
    curvature: Real | float = 0.0
    held: Sequence[int] = ()
    turning: Real | float = 0.0
    across: Real | float = 0.0
    between: Real | float = 0.0


@dataclass(frozen=True, slots=True)
class Move:
    """Changes of w and v (2, flights, n), and of all unknowns per slot, (flights, n, size)."""

    w: Real
    v: Real
    unknowns: Real


class State(Protocol):
    """A constraint at an iterate: a frozen dataclass, derived from this, of (..., flights, slots).

    Sums and extremes over a flight are (flights, 1). `target`, and the changes `step` that
    `solved` returns, are the state's own records; no one else looks into them.
    """

    def count(self) -> Real | int:
        """Return how many inequalities the constraint is."""

    def gap(self, share: Real | float = 0.0, step: Any = None) -> Real:
        """Return the sum of s^T z after `share` of `step`."""

    def size(self) -> Real:
        """Return the sum of the moduli of the multipliers."""

    def violation(self) -> Real:
        """Return by how much the constraint is still widened, or an equation of its own missed."""

    def forces(self) -> Forces:
        """Return the forces of the multipliers z; `own` is the gradient by its own unknowns."""

    def stiffness(self) -> Stiffness:
        """Return K."""

    def push(self, target: Any) -> Forces:
        """Return the forces of z+ at a direction of zero.

        With `target` None those for mu = 0, which come from the margins; else those that `target`
        adds to them. `own` are the right-hand sides of its own equations.
        """

    def target(self, mu: Real, ahead: Any, share: Real) -> Any:
        """Return mu s^-1 less Mehrotra's correction by the `share` of the step `ahead`."""

    def solved(self, move: Move, target: Any, rest: Forces) -> tuple[Any, Forces]:
        """Return the constraint's changes along `move`, and the forces of its new multipliers.

        `rest` are the forces on v and a that are asked for and not yet supplied.
        """

    def curvature(self, step: Any) -> Real:
        """Return ds^T K ds of the direction that `step` belongs to, the margins left out."""

    def reach(self, step: Any) -> Real:
        """Return the share of `step` at which a slack or a multiplier vanishes."""

    def moved(self, w: Real, v: Real, share: Real, step: Any) -> "State":
        """Return the state after `share` of `step`, which has led to w and v."""

    def centred(self, mu: Real) -> "State":
        """Return the same slacks with the multipliers z = mu s^-1."""

    def missing(self, share: Real, step: Any, then: Any) -> Real | float:  # noqa: ARG002
        """Return by how much its functions fall short of the model after `share` of `step`.

        Weighted by the new multipliers; `then` is the state there. 0 where they are linear.
        """
        return 0.0

    def reward(self) -> Real | float:
        """Return what the constraint's own unknowns add to the objective, (flights, 1)."""
        return 0.0

    def steepness(self) -> Real | float:
        """Return the largest gradient of its functions of w, weighted as in `missing`."""
        return 0.0


@dataclass(frozen=True, slots=True)
class Start:
    """Where a search begins: scaled w and v (2, flights, n), the barrier parameter mu (flights, 1).

    `margin` is by how much limits are widened beyond w and v; `own` is where the unknowns of the
    constraint are in a slot.
    """

    w: Real
    v: Real
    mu: Real
    margin: float
    own: slice


class Constraint(ABC):
    """A limit on flights, apart from any iterate."""

    @property
    def unknowns(self) -> int:
        """How many unknowns per slot it brings into the Newton system."""
        return 0

    @property
    def turns(self) -> bool:
        """Whether its half-planes turn so fast that mu has to wait for the iterates."""
        return False

    @property
    def curved(self) -> bool:
        """Whether the curvature of its functions of v or a counts."""
        return False

    @property
    def bilinear(self) -> bool:
        """Whether its functions are products of w and unknowns of its own."""
        return False

    def entries(self, slots: int, first: int) -> Sequence[Entry]:  # noqa: ARG002
        """Return what never changes of the rows of its own unknowns, which count from `first`."""
        return ()

    @abstractmethod
    def begin(self, flight: "ScaledFlight", start: Start) -> State:
        """Return the centred state at `start`, widened where `start` is not inside the limit."""

    @abstractmethod
    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest violation by `flight`, in solver units; 0 where the limit holds."""


class ScaledFlight:
    """The flight in solver units, with its Newton matrix and the constraints' places in it.

    `gains` (n - 1,) are k of a_n = k (v_{n+1} - v_n), 0 where the acceleration is not bounded;
    `per_gain` (n - 1,) are -1 / k, or 0: they turn q into the multipliers of the accelerations.
    `own` are the places of the constraints' unknowns in a slot.
    """

    def __init__(self, kin: Kinematics, constraints: Sequence[Constraint]) -> None:
        self.constraints = constraints
        ends = SIZE + np.cumsum([constraint.unknowns for constraint in constraints])
        self.own = [
            slice(int(end) - constraint.unknowns, int(end))
            for constraint, end in zip(constraints, ends, strict=True)
        ]
        self.matrix = FlightMatrix(
            kin.slots,
            kin.max_speed * kin.time_step / LENGTH / 2,
            (kin.start_velocity is not None, kin.end_velocity is not None),
            int(ends[-1]) - SIZE,
            [
                entry
                for constraint, own in zip(constraints, self.own, strict=True)
                for entry in constraint.entries(kin.slots, own.start)
            ],
        )
        self.gain = kin.max_speed / (kin.max_acceleration * kin.time_step)
        bounded = np.arange(kin.slots - 1) >= kin.first_bounded_acceleration
        self.gains = self.gain * bounded
        self.per_gain = bounded / -self.gain

    def begin(self, w: Real, v: Real, mu: Real, margin: float) -> tuple[State, ...]:
        """Return the states of all constraints, with what `Start` has."""
        return tuple(
            constraint.begin(self, Start(w, v, mu, margin, own))
            for constraint, own in zip(self.constraints, self.own, strict=True)
        )

    def accelerations(self, v: Real) -> Real:
        """Return the bounded accelerations (2, flights, n - 1) at the speeds v, the others zero."""
        return np.asarray(self.gains * (v[..., 1:] - v[..., :-1]))

    def forces_asked(self, y: Real, on_a: Real) -> Real:
        """Return A_v^T y less D^T `on_a`, (2, flights, n): what the forces on v have to be.

        y and the forces on the accelerations `on_a` are (2, flights, n - 1).
        """
        of_motion, of_limits = -self.matrix.half_step * y, self.gains * on_a
        asked = np.zeros((*y.shape[:-1], self.matrix.slots))
        asked[..., 1:] = of_motion - of_limits
        asked[..., :-1] += of_motion + of_limits
        asked *= self.matrix.moves_v
        return asked


def quadratic(packed: Real, x: Real) -> Real:
    """Return sum_n x_n^T M_n x_n, (flights, 1), of M (3, flights, n) and x (2, flights, n)."""
    xx, xy, yy = packed
    east, north = x
    each = xx * east * east + 2 * xy * east * north + yy * north * north
    return np.asarray(each.sum(axis=-1, keepdims=True))


def positive_part(packed: Real) -> Real:
    """Return the nearest positive semidefinite matrices, (3, flights, n)."""
    xx, xy, yy = packed
    middle, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    low = np.minimum(middle - radius, 0)
    # with eigenvalues low < 0 <= high: high (M - low I) / (high - low); with both < 0: zero
    share = np.where(low < 0, np.maximum(middle + radius, 0) / np.maximum(2 * radius, TINY), 1)
    return np.stack([share * (xx - low), share * xy, share * (yy - low)])


def summed(values: Real) -> Real:
    """Return the sum over everything but the flights, (flights, 1)."""
    return np.asarray(values.reshape(-1, *values.shape[-2:]).sum(axis=(0, 2))[:, None])


def largest(values: Real) -> Real:
    """Return the largest modulus over everything but the flights, (flights, 1)."""
    each = np.abs(values).max(axis=-1, keepdims=True)
    return np.asarray(each.max(axis=0) if each.ndim == 3 else each)


def added(parts: Iterable[Real | float]) -> Real | float:
    """Return the sum of `parts`, of which those that are plain zeros cost nothing."""
    arrays = [part for part in parts if isinstance(part, np.ndarray)]
    return reduce(np.add, arrays) if arrays else 0.0
