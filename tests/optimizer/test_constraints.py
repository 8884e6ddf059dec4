"""New constraints are one class each: on positions, speeds, accelerations, or a running sum."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import cvxpy as cp
import numpy as np
import pytest
from test_interior import HEIGHT, bowl, copter, links, plane, worst

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.banded import Entry, W
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    Move,
    ScaledFlight,
    Start,
    Stiffness,
)
from faao_mav.optimizer.interior.half_planes import HalfPlanes, Slacks
from faao_mav.optimizer.interior.maximize import LocalOptimum, maximize
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.optimizer.scaled import FlightVariables, flight_variables
from faao_mav.optimizer.search.starts import straight_flight

STAGE = links(bowl, 1e-5, 3e-5)


def global_optimum(kin: Kinematics, flight: FlightVariables, more: list[Any]) -> float:
    """The best min_j F_j of `STAGE`, which is concave, under `more` convex constraints."""
    gains = [
        -c * (HEIGHT**2 + LENGTH**2 / kin.slots * cp.sum_squares(flight.w - p[None] / LENGTH))
        for c, p in zip(STAGE.constants, STAGE.stations, strict=True)
    ]
    problem = cp.Problem(cp.Maximize(cp.minimum(*gains)), [*flight.constraints, *more])
    for fraction in (0.95, 0.8, 0.6):  # Clarabel stalls on some of these
        with suppress(cp.error.SolverError):
            problem.solve(solver=cp.CLARABEL, max_step_fraction=fraction)
            break
    return float(problem.value)


def solved(kin: Kinematics, *constraints: Constraint) -> LocalOptimum:
    start = straight_flight(replace(kin, max_acceleration=kin.max_acceleration / 4))
    best = maximize(kin, STAGE, start, constraints=constraints, tolerance=1e-7)
    assert best.converged
    assert worst(kin, best.trajectory) < 1e-6
    assert max(c.excess(kin, best.trajectory) for c in constraints) <= 1e-9
    return best


@dataclass(frozen=True)
class Side(HalfPlanes):
    """normal . x <= most."""

    normal: tuple[float, float]
    most: float

    def slack(self, x: Real) -> tuple[Real, Real]:
        towards = np.array(self.normal)[:, None, None]
        return self.most - (towards * x).sum(axis=0), np.broadcast_to(-towards, x.shape)


class SideOfMap(Side):
    quantity: ClassVar[Literal["w", "v", "a"]] = "w"


class SideOfSpeeds(Side):
    quantity: ClassVar[Literal["w", "v", "a"]] = "v"


class SideOfAccelerations(Side):
    quantity: ClassVar[Literal["w", "v", "a"]] = "a"


@pytest.mark.parametrize("make", [plane, copter])
@pytest.mark.parametrize(
    "side",
    [
        SideOfMap((0.6, 0.8), 2.83),
        SideOfSpeeds((1.0, 0.0), 0.62),
        SideOfAccelerations((0.0, 1.0), 0.3),
    ],
)
def test_a_half_plane_is_kept_at_the_global_optimum(make: Any, side: Side) -> None:
    kin = make(80, time_step=1.0, max_speed=10.0)
    best, flight = solved(kin, side), flight_variables(kin)
    x = {"w": flight.w, "v": flight.v, "a": flight.a[kin.first_bounded_acceleration : -1]}
    kept = x[side.quantity] @ np.array(side.normal) <= side.most
    assert best.value == pytest.approx(global_optimum(kin, flight, [kept]), rel=1e-5)
    assert best.value < unconstrained(kin) - 1e-7  # it is active


def unconstrained(kin: Kinematics) -> float:
    return maximize(kin, STAGE, straight_flight(kin), tolerance=1e-8).value


@dataclass(frozen=True)
class KeepOut(HalfPlanes):
    """The map but for a disc, m."""

    centre: tuple[float, float]
    radius: float
    quantity: ClassVar[Literal["w", "v", "a"]] = "w"

    def slack(self, x: Real) -> tuple[Real, Real]:
        away = x - np.array(self.centre)[:, None, None] / LENGTH
        distance = np.hypot(*away)
        return distance - self.radius / LENGTH, away / np.maximum(distance, 1e-9)


@pytest.mark.parametrize("make", [plane, copter])
def test_a_disc_is_flown_round(make: Any) -> None:
    """Its optimum is that of the convex problem with half-planes that touch the disc there."""
    kin = make(80, time_step=1.0, max_speed=10.0)
    disc = KeepOut((250.0, 210.0), 60.0)
    free = maximize(kin, STAGE, straight_flight(kin))
    assert np.linalg.norm(free.trajectory.w - disc.centre, axis=1).min() < disc.radius - 10
    best, flight = solved(kin, disc), flight_variables(kin)
    away = best.trajectory.w - np.array(disc.centre)
    distance = np.linalg.norm(away, axis=1)
    assert distance.min() == pytest.approx(disc.radius, abs=1e-3)
    outward = away / distance[:, None]
    touching = cp.sum(cp.multiply(outward, flight.w - np.array(disc.centre)[None] / LENGTH), axis=1)
    expected = global_optimum(kin, flight, [touching >= disc.radius / LENGTH])
    assert best.value == pytest.approx(expected, rel=1e-5)


class NextSide(HalfPlanes):
    """Its half-plane turns at x = 0 m, and is broken beyond."""

    quantity: ClassVar[Literal["w", "v", "a"]] = "w"

    def slack(self, x: Real) -> tuple[Real, Real]:
        return np.where(x[0] > 0, -1.0, 0.5), np.stack([0 * x[0], 1 + 0 * x[0]])


def test_slacks_stay_above_zero_when_a_half_plane_turns() -> None:
    kin, side = copter(6, time_step=1.0, max_speed=10.0), NextSide()
    flight, x, mu = ScaledFlight(kin, (side,)), -np.ones((2, 1, 6)), np.ones((1, 1))
    state = side.begin(flight, Start(x, x, mu, 1.0, slice(0)))
    fallen = -0.25 * state.on
    then = state.moved(-x, x, 1.0, (fallen, 0 * fallen))
    assert then.s == pytest.approx(np.where(state.on > 0, 0.025, 1.0), abs=1e-6)
    assert then.violation() == pytest.approx(1.025, abs=1e-5)


@dataclass(frozen=True)
class Budget(Constraint):
    """The running sum e_{n+1} = e_n + normal . w_n / n of scaled positions never exceeds `most`.

    It brings two unknowns per slot: e_n, and the multiplier of its equation.
    """

    normal: tuple[float, float]
    most: float

    @property
    def unknowns(self) -> int:
        return 2

    def entries(self, slots: int, first: int) -> Sequence[Entry]:
        begins, ends = np.eye(slots)[[0, -1]]
        e, multiplier, one = first, first + 1, np.ones(slots - 1)
        couplings = [
            Entry(multiplier, W.start + axis, -part / slots * one)
            for axis, part in enumerate(self.normal)
        ]
        return (
            *couplings,
            Entry(multiplier, e, -(1 - begins)[:-1]),
            Entry(e, multiplier, one, ahead=1),
            Entry(e, e, begins),
            Entry(multiplier, multiplier, ends),
        )

    def spent(self, w: Real) -> Real:
        """The running sum along scaled w (2, ..., n)."""
        each = (self.normal[0] * w[0] + self.normal[1] * w[1]) / w.shape[-1]
        return np.asarray(np.cumsum(each, axis=-1) - each)

    def begin(self, flight: ScaledFlight, start: Start) -> "BudgetState":  # noqa: ARG002
        e, on = self.spent(start.w), np.ones(start.w.shape[1:])
        on[..., 0] = 0
        margin = on * np.maximum(0, 0.1 - (self.most - e))
        s = np.where(on > 0, self.most - e + margin, 1.0)
        missed = 0 * e[..., 1:]
        return BudgetState(on, s, start.mu * on / s, margin, self, start.own, e, 0 * e, missed)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:  # noqa: ARG002
        return max(0.0, float(self.spent(flight.w.T / LENGTH).max()) - self.most)


@dataclass(frozen=True)
class BudgetState(Slacks):
    constraint: Budget
    own: slice
    e: Real
    multiplier: Real
    missed: Real

    def violation(self) -> Real:
        missed = np.abs(self.missed).max(axis=-1, keepdims=True)
        return np.asarray(np.maximum(super().violation(), missed))

    def _forces(self, z: Real, multiplier: Real) -> Forces:
        """By the multipliers alone, those on w held by the matrix when a direction is sought."""
        on_w = np.stack([part * multiplier for part in self.constraint.normal])
        before = np.concatenate([0 * multiplier[..., :1], multiplier[..., :-1]], axis=-1)
        own = np.stack([self.on * (z + before - multiplier), 0 * multiplier], axis=-1)
        return Forces(w=on_w / multiplier.shape[-1], own=own)

    def forces(self) -> Forces:
        return self._forces(self.z, self.multiplier)

    def stiffness(self) -> Stiffness:
        return Stiffness(entries=[Entry(self.own.start, self.own.start, self.z / self.s * self.on)])

    def push(self, target: Real | None) -> Forces:
        z = self.raised(-self.margin, None) if target is None else target
        missed = np.concatenate([self.missed, 0 * self.z[..., :1]], axis=-1)
        return Forces(own=np.stack([-z * self.on, -missed * (target is None)], axis=-1))

    def solved(self, move: Move, target: Real | None, rest: Forces) -> tuple[Any, Forces]:  # noqa: ARG002
        de, multiplier = move.unknowns[..., self.own].transpose(2, 0, 1)
        ds = -self.on * de - self.margin
        z = self.raised(ds, target)
        return (ds, z - self.z, de, multiplier - self.multiplier), Forces()

    def moved(self, w: Real, v: Real, share: Real, step: Any) -> "BudgetState":  # noqa: ARG002
        e, margin = self.e + share * step[2], self.margin * (1 - share)
        return replace(
            self,
            e=e,
            margin=margin,
            multiplier=self.multiplier + share * step[3],
            s=np.where(self.on > 0, self.constraint.most - e + margin, 1.0),
            z=self.z + share * step[1],
            missed=self.missed * (1 - share),
        )

    def centred(self, mu: Real) -> "BudgetState":
        return replace(self, z=mu * self.on / self.s)


@pytest.mark.parametrize("make", [plane, copter])
def test_a_running_sum_that_is_a_state_of_its_own(make: Any) -> None:
    kin = make(80, time_step=1.0, max_speed=10.0)
    budget = Budget((1.0, 1.0), 3.7)
    best, flight = solved(kin, budget), flight_variables(kin)
    assert budget.spent(best.trajectory.w.T / LENGTH).max() == pytest.approx(3.7, abs=1e-5)
    spent = cp.cumsum(flight.w @ np.array([1.0, 1.0])) / kin.slots
    expected = global_optimum(kin, flight, [spent[:-1] <= 3.7])
    assert best.value == pytest.approx(expected, rel=1e-5)
    assert best.value < unconstrained(kin) - 1e-3
