"""The interior-point method: feasible, never worse than its start, optimal; new constraints."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from scipy.linalg import block_diag

from faao_mav.arrays import Real
from faao_mav.optimizer.algorithm1 import FlightVariables, minimize
from faao_mav.optimizer.interior.constraint import A, Constraint, Grid, Rows, V, W
from faao_mav.optimizer.interior.limits import Disc, EnergyLimit, SpeedChange, TurnRate
from faao_mav.optimizer.interior.maximize import maximize
from faao_mav.optimizer.interior.newton import Chain
from faao_mav.optimizer.interior.rewards import Goal, Stage, StageValues
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.power import FixedWing, RotaryWing
from faao_mav.radio.relay import RelayQueue

STATIONS = np.array([[0.0, 0.0], [300.0, 300.0]])
HEIGHT = 100.0
Law = Callable[[Real, float], tuple[Real, Real, Real]]


def gaussian(q: Real, c: float) -> tuple[Real, Real, Real]:
    """log2(1 + c / q) and its first two derivatives by q."""
    f = np.log1p(c / q) / np.log(2)
    slope = -c / (q * (q + c)) / np.log(2)
    return f, slope, c * (2 * q + c) / (q * (q + c)) ** 2 / np.log(2)


def bpsk(q: Real, c: float) -> tuple[Real, Real, Real]:
    """2 (1 - log2(1 + e^-x)), x = c / q."""
    x = c / q
    share = np.exp(-x) / (1 + np.exp(-x))
    by_x, by_xx = 2 / np.log(2) * share, -2 / np.log(2) * share * (1 - share)
    f = 2 - 2 * np.log1p(np.exp(-x)) / np.log(2)
    return f, -by_x * c / q**2, by_xx * c**2 / q**4 + by_x * 2 * c / q**3


def bowl(q: Real, c: float) -> tuple[Real, Real, Real]:
    """-c q: concave."""
    return -c * q, np.full_like(q, -c), np.zeros_like(q)


@dataclass
class Radial:
    """f_j of q = H² + ||w - p_j||²."""

    law: Law
    constants: tuple[float, ...]

    def __call__(self, w: Real, /) -> StageValues:
        stations = STATIONS[: len(self.constants)]
        away = w[:, None] - stations.T.reshape(2, -1, *(1,) * (w.ndim - 1))
        q = HEIGHT**2 + (away**2).sum(axis=0)
        found = [self.law(row, c) for row, c in zip(q, self.constants, strict=True)]
        f, slope, bend = (np.array(part) for part in zip(*found, strict=True))
        x, y = away
        level = 2 * slope
        return StageValues(
            f,
            2 * slope * away,
            np.stack([4 * bend * x * x + level, 4 * bend * x * y, 4 * bend * y * y + level]),
        )


def links(law: Law, *constants: float) -> Radial:
    return Radial(law, constants)


def plane(duration: float, **changes: Any) -> Kinematics:
    """The paper's in longer slots: free ends, a(0) unbounded."""
    step = changes.pop("time_step", 0.5)
    values: dict[str, Any] = {
        "start": np.array([0.0, 350.0]),
        "end": np.array([350.0, 0.0]),
        "slots": round(duration / step),
        "time_step": step,
        "max_speed": 100.0,
        "max_acceleration": 5.0,
        "start_velocity": None,
        "end_velocity": None,
        "bound_first_acceleration": False,
    }
    return Kinematics(**(values | changes))


def copter(duration: float, **changes: Any) -> Kinematics:
    """Hover to hover."""
    values: dict[str, Any] = {
        "max_speed": 8.0,
        "max_acceleration": 1.5,
        "start_velocity": np.zeros(2),
        "end_velocity": np.zeros(2),
        "bound_first_acceleration": True,
    }
    return plane(duration, **(values | changes))


def worst(kin: Kinematics, flight: Trajectory) -> float:
    return max(kin.residuals(flight).values())


def reward(stage: Stage, flight: Trajectory) -> float:
    return float(stage(flight.w.T).value.mean(axis=1).min())


HERE = np.array([100.0, 100.0])
DISTANCE = 350 * np.sqrt(2)
ACTIVE = links(bpsk, 4e4, 4e4)

SCENARIOS: dict[str, tuple[Kinematics, Stage]] = {
    "plane 10 s": (plane(10), ACTIVE),
    "copter, weak, tight": (copter(70), links(bpsk, 4e3, 4e3)),
    "copter, closed": (copter(60, start=HERE, end=HERE), ACTIVE),
    "velocities on the limit": (
        copter(80, start_velocity=np.array([8.0, 0.0]), end_velocity=np.array([0.0, -8.0])),
        ACTIVE,
    ),
    "hopeless": (plane(50), links(gaussian, 1e-7, 1e-7)),
    "dominated": (plane(50), links(bpsk, 4e5, 4e2)),
    "few slots": (plane(0.8, time_step=0.2, end=np.array([10.0, 350.0])), ACTIVE),
}


def still_gained(kin: Kinematics, stage: Stage, flight: Trajectory) -> float:
    """Return what the best feasible flight within a metre of this one gains to first order.

    A convex program of Clarabel's has it from the flight alone, without the multipliers of the
    method that made it: it is zero exactly where the conditions of Karush, Kuhn and Tucker hold.
    """
    rewards = stage(flight.w.T)
    total, unit = rewards.value.mean(axis=1), float(np.abs(rewards.gradient).max())
    near, gain = FlightVariables(kin), cp.Variable()
    shift = LENGTH * near.w - flight.w
    limits = [*near.constraints, cp.abs(shift) <= 1]
    for each, slope in zip(total, np.moveaxis(rewards.gradient, 1, 0), strict=True):
        grown = cp.sum(cp.multiply(slope.T / unit, shift)) / kin.slots
        limits.append(gain <= (each - total.min()) / unit + grown)
    return max(0.0, -float(minimize(-gain, limits).value)) * unit


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_optimum_is_feasible_better_and_stationary(name: str) -> None:
    kin, stage = SCENARIOS[name]
    start = straight_flight(kin)
    best = maximize(kin, stage, start)
    assert worst(kin, best.trajectory) < 1e-6
    assert best.converged
    assert best.residual < 1e-6
    assert best.iterations <= 60
    assert best.value == reward(stage, best.trajectory)
    assert best.value > reward(stage, start)
    assert still_gained(kin, stage, best.trajectory) < 1e-5 * best.value


@pytest.mark.parametrize("room", [0, 1e-3])
def test_without_room_the_result_is_still_feasible(room: float) -> None:
    """Durations that barely suffice: the set of flights has next to no interior."""
    fastest = DISTANCE / (50 * 0.5) ** 2 * (1 + room)
    for kin in (
        copter(0, slots=101, max_speed=100.0, max_acceleration=fastest),
        plane(0, slots=26, max_speed=DISTANCE / (25 * 0.5) * (1 + room)),
    ):
        start = straight_flight(kin)
        best = maximize(kin, ACTIVE, start)
        assert worst(kin, best.trajectory) < 1e-6
        assert best.value >= reward(ACTIVE, start)
        assert best.converged or room == 0


@dataclass
class Level:
    """The same everywhere, but for a slope."""

    slope: float

    def __call__(self, w: Real, /) -> StageValues:
        shape = (2, *w.shape[1:])
        return StageValues(
            np.full(shape, 2.0), np.full((2, *shape), self.slope), np.zeros((3, *shape))
        )


def test_flat_rewards_return_the_start() -> None:
    kin = plane(50)
    start = straight_flight(kin)
    for stage in (Level(1e-300), links(bpsk, 1e9, 1e9)):
        best = maximize(kin, stage, start)
        assert best.trajectory is start
        assert best.converged
        assert best.iterations == 0
        assert best.value == 2


WINDY = plane(60, time_step=1.0, max_speed=17.0, max_airspeed=9.0, wind=(4.0, -6.0))


@pytest.mark.parametrize("kin", [plane(80, time_step=1.0), copter(80, time_step=1.0), WINDY])
def test_concave_rewards_reach_the_global_optimum(kin: Kinematics) -> None:
    """Against CVXPY, from below and from above."""
    best = maximize(kin, STAGE, straight_flight(kin), tolerance=1e-8)
    assert worst(kin, best.trajectory) < 1e-6
    expected = global_optimum(kin, FlightVariables(kin), [])
    assert best.value == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize("kin", [plane(24, time_step=4.0), copter(24, time_step=4.0)])
def test_the_sign_of_the_curvature_is_that_of_dense_eigenvalues(kin: Kinematics) -> None:
    rng = np.random.default_rng(0)
    grid, n = Grid.of(kin), kin.slots
    free = np.concatenate([grid.free, np.ones((3, n), dtype=np.bool_)])
    goal = Goal(ACTIVE, np.full((2, n), 80.0), RelayQueue(), kin.time_step)
    chain, kept = Chain(grid, goal, free), free.T.ravel()
    A = np.stack([chain.missed(x.reshape(n, 9).T).T.ravel() for x in np.eye(9 * n)], axis=1)
    A = A[:, kept]
    null = np.linalg.svd(A)[2][np.linalg.matrix_rank(A) :].T
    for _ in range(4):
        root = rng.standard_normal((n, 9, 9))
        H = (root + root.swapaxes(1, 2)).transpose(1, 2, 0)
        dense = block_diag(*H.transpose(2, 0, 1))[np.ix_(kept, kept)]
        least = float(np.linalg.eigvalsh(null.T @ dense @ null).min())
        for room in (0.5, -0.5):  # just on either side of zero
            assert chain.convex(H + (room - least) * np.eye(9)[..., None]) == (room > 0)


CONSTRAINTS: list[Constraint] = [
    Disc(V),
    Disc(V, 0.4, (0.1, -0.3), 1.0),
    SpeedChange(0.3, 0.2, 0.5, (0.1, -0.3)),
    TurnRate(0.3, 2.0, 0.1),
    EnergyLimit(RotaryWing(80.0, 90.0, 120.0, 4.0, 0.01, 20.0), 1e4, plane(20, wind=(1.0, 2.0))),
    EnergyLimit(FixedWing.fitted(90.0, 15.0, 2.5), 1e4, plane(20, wind=(1.0, 2.0))),
    *(
        Goal(ACTIVE, np.full((2, 4), 80.0), relay, 0.5)
        for relay in (None, RelayQueue(buffer=30.0), RelayQueue(half=True, buffer=30.0))
    ),
    Goal(links(bpsk, 4e4), np.full((2, 4), 80.0)),
]


@pytest.mark.parametrize("constraint", CONSTRAINTS)
def test_gradients_and_hessians_are_those_of_differences(constraint: Constraint) -> None:
    rng, h = np.random.default_rng(0), 1e-6
    own = constraint.own if isinstance(constraint, Goal) else 0
    x = rng.uniform(0.3, 0.7, (len(constraint.of) + own, 4))
    at = constraint.rows(x)
    assert at.bend is not None
    for place in range(len(x)):
        step = np.zeros_like(x)
        step[place] = h
        above, below = constraint.rows(x + step), constraint.rows(x - step)
        slope = (above.value - below.value) / (2 * h)
        assert at.slope[:, place] == pytest.approx(slope, rel=1e-6, abs=1e-6)
        bend = (above.slope - below.slope) / (2 * h)
        assert at.bend[:, place] == pytest.approx(bend, rel=1e-5, abs=1e-5)


STAGE = links(bowl, 1e-5, 3e-5)


def global_optimum(kin: Kinematics, flight: FlightVariables, more: list[Any]) -> float:
    """The best min_j F_j of `STAGE`, which is concave, under `more` convex constraints."""
    gains = [
        -c * (HEIGHT**2 + LENGTH**2 / kin.slots * cp.sum_squares(flight.w - p[None] / LENGTH))
        for c, p in zip(STAGE.constants, STATIONS, strict=True)
    ]
    problem = cp.Problem(cp.Maximize(cp.minimum(*gains)), [*flight.constraints, *more])
    options: dict[str, Any] = {"solver": cp.CLARABEL, "canon_backend": cp.SCIPY_CANON_BACKEND}
    with suppress(cp.error.SolverError):  # Clarabel stalls on some of these
        problem.solve(max_step_fraction=0.95, **options)
        return float(problem.value)
    problem.solve(equilibrate_enable=False, max_step_fraction=0.6, **options)
    return float(problem.value)


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


@pytest.mark.parametrize("side", [Side(A, (0.0, 1.0), 0.3), Side(W, (1.0, 1.0), 3.7, True)])
def test_a_half_plane_is_kept_at_the_global_optimum(side: Side) -> None:
    kin = plane(80, time_step=1.0, max_speed=10.0)
    start = straight_flight(replace(kin, max_acceleration=kin.max_acceleration / 4))
    best = maximize(kin, STAGE, start, constraints=[side], tolerance=1e-7)
    assert best.converged
    assert worst(kin, best.trajectory) < 1e-6
    assert side.excess(kin, best.trajectory) <= 1e-9
    flight = FlightVariables(kin)
    bounded = flight.a[kin.first_bounded_acceleration : -1]
    along = (flight.w if side.of == W else bounded) @ np.array(side.normal)
    kept = (cp.sum(along) / kin.slots if side.total else along) <= side.most
    assert best.value == pytest.approx(global_optimum(kin, flight, [kept]), rel=1e-4)
    unconstrained = maximize(kin, STAGE, straight_flight(kin), tolerance=1e-8).value
    assert best.value < unconstrained - 1e-7  # it is active
