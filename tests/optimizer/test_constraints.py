"""New constraints are one class each: on positions, speeds, accelerations, or a sum."""

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from test_interior import HEIGHT, bowl, copter, links, plane, worst

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import A, Constraint, Rows, V, W
from faao_mav.optimizer.interior.maximize import LocalOptimum, maximize
from faao_mav.optimizer.kinematics import LENGTH, Kinematics
from faao_mav.optimizer.scaled import FlightVariables, flight_variables
from faao_mav.optimizer.search.straight import straight_flight

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
class Side(Constraint):
    """normal . x <= most of the unknowns x of a slot, or of their mean over the slots."""

    of: tuple[int, ...]  # type: ignore[misc]
    normal: tuple[float, float]
    most: float
    total: bool = False  # type: ignore[misc]

    def rows(self, x: Real) -> Rows:
        normal = np.array(self.normal)
        return Rows((self.most - normal @ x)[None], np.repeat(-normal[None, :, None], len(x.T), 2))


@pytest.mark.parametrize(
    ("make", "side"),
    [
        (copter, Side(W, (0.6, 0.8), 2.83)),
        (copter, Side(V, (1.0, 0.0), 0.62)),
        (plane, Side(A, (0.0, 1.0), 0.3)),
        (plane, Side(W, (1.0, 1.0), 3.7, True)),
    ],
)
def test_a_half_plane_is_kept_at_the_global_optimum(make: Any, side: Side) -> None:
    kin = make(80, time_step=1.0, max_speed=10.0)
    best, flight = solved(kin, side), flight_variables(kin)
    bounded = flight.a[kin.first_bounded_acceleration : -1]
    x: dict[tuple[int, ...], Any] = {W: flight.w, V: flight.v, A: bounded}
    along = x[side.of] @ np.array(side.normal)
    kept = (cp.sum(along) / kin.slots if side.total else along) <= side.most
    assert best.value == pytest.approx(global_optimum(kin, flight, [kept]), rel=1e-4)
    unconstrained = maximize(kin, STAGE, straight_flight(kin), tolerance=1e-8).value
    assert best.value < unconstrained - 1e-7  # it is active


@dataclass(frozen=True)
class KeepOut(Constraint):
    """The map but for a disc, m."""

    centre: tuple[float, float]
    radius: float
    of = W
    turns = True

    def rows(self, x: Real) -> Rows:
        away = x - np.array(self.centre)[:, None] / LENGTH
        distance = np.hypot(*away)
        return Rows((distance - self.radius / LENGTH)[None], (away / distance)[None])


def test_a_disc_is_flown_round() -> None:
    """Its optimum is that of the convex problem with half-planes that touch the disc there."""
    kin = copter(80, time_step=1.0, max_speed=10.0)
    disc = KeepOut((250.0, 210.0), 60.0)
    free = maximize(kin, STAGE, straight_flight(kin))
    assert np.linalg.norm(free.trajectory.w - disc.centre, axis=1).min() < disc.radius - 10
    best, flight = solved(kin, disc), flight_variables(kin)
    away = best.trajectory.w - np.array(disc.centre)
    distance = np.linalg.norm(away, axis=1)
    assert distance.min() == pytest.approx(disc.radius, abs=2e-3)
    outward = away / distance[:, None]
    touching = cp.sum(cp.multiply(outward, flight.w - np.array(disc.centre)[None] / LENGTH), axis=1)
    expected = global_optimum(kin, flight, [touching >= disc.radius / LENGTH])
    assert best.value == pytest.approx(expected, rel=1e-4)
