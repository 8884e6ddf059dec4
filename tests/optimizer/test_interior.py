"""The interior-point method: feasible, never worse than its start, and optimal."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np
import pytest
from certificate import kkt_residual
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from faao_mav.arrays import Real
from faao_mav.optimizer.interior import cones
from faao_mav.optimizer.interior.banded import SIZE, FlightMatrix, Q, V, W, Y
from faao_mav.optimizer.interior.constraint import ScaledFlight
from faao_mav.optimizer.interior.half_planes import HalfPlanes, HalfPlanesState
from faao_mav.optimizer.interior.iterate import Iterate, best_floor
from faao_mav.optimizer.interior.limits import FlightLimits, LimitsState
from faao_mav.optimizer.interior.maximize import maximize, maximize_all
from faao_mav.optimizer.interior.newton import Newton
from faao_mav.optimizer.interior.rewards import Stage, StageValues
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.optimizer.scaled import flight_variables
from faao_mav.optimizer.search.starts import straight_flight

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
    stations: Real

    def __call__(self, w: Real, /) -> StageValues:
        away = w[:, None] - self.stations.T.reshape(2, -1, *(1,) * (w.ndim - 1))
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


def links(law: Law, *constants: float, stations: Real = STATIONS) -> Radial:
    return Radial(law, constants, stations[: len(constants)])


def plane(duration: float, **changes: Any) -> Kinematics:
    """The paper's: free ends, a(0) unbounded."""
    step = changes.pop("time_step", 0.2)
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


HERE = {"start": np.array([100.0, 100.0]), "end": np.array([100.0, 100.0])}
DISTANCE = 350 * np.sqrt(2)
ACTIVE = links(bpsk, 4e4, 4e4)

SCENARIOS: dict[str, tuple[Kinematics, Stage]] = {
    **{f"plane {duration} s": (plane(duration), ACTIVE) for duration in (10, 15, 50, 100)},
    "plane, log": (plane(50), links(gaussian, 1e6, 1e6)),
    "plane, weak": (plane(50), links(bpsk, 4e3, 4e3)),
    "copter": (copter(120), ACTIVE),
    "copter, coarse": (copter(120, time_step=0.5), ACTIVE),
    "copter, weak, tight": (copter(70), links(bpsk, 4e3, 4e3)),
    "copter, closed": (copter(60, **HERE), ACTIVE),
    "plane, closed": (plane(10, **HERE), ACTIVE),
    "given velocities": (
        plane(50, start_velocity=np.array([30.0, 40.0]), end_velocity=np.array([-20.0, 10.0])),
        ACTIVE,
    ),
    "velocities on the limit": (
        copter(80, start_velocity=np.array([8.0, 0.0]), end_velocity=np.array([0.0, -8.0])),
        ACTIVE,
    ),
    "hopeless": (plane(50), links(gaussian, 1e-7, 1e-7)),
    "dominated": (plane(50), links(bpsk, 4e5, 4e2)),
    "one link": (plane(50), links(bpsk, 4e4)),
    "three links": (
        plane(50),
        links(bpsk, 4e4, 4e4, 4e4, stations=np.vstack([STATIONS, [[300.0, 0.0]]])),
    ),
    "far away": (
        plane(300, time_step=0.5, start=np.array([0.0, 3500.0]), end=np.array([3500.0, 0.0])),
        links(gaussian, 1.0, 1.0),
    ),
    "few slots": (plane(0.8, end=np.array([10.0, 350.0])), ACTIVE),
}


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
    assert best.weights.min() >= 0
    assert best.weights.sum() == pytest.approx(1)
    if kin.slots <= 250:
        # no flight within a metre of it gains more than this share of its reward
        assert kkt_residual(kin, stage, best.trajectory) < 2e-6 * best.value


@pytest.mark.parametrize("room", [0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("hover", [False, True])
def test_without_room_the_result_is_still_feasible(room: float, hover: bool) -> None:
    """Durations that barely suffice: the set of flights has next to no interior."""
    if hover:
        fastest = DISTANCE / (50 * 0.5) ** 2 * (1 + room)
        kin = copter(0, slots=101, time_step=0.5, max_speed=100.0, max_acceleration=fastest)
    else:
        kin = plane(0, slots=26, max_speed=DISTANCE / (25 * 0.2) * (1 + room))
    start = straight_flight(kin)
    best = maximize(kin, ACTIVE, start)
    assert worst(kin, best.trajectory) < 1e-6
    assert best.value >= reward(ACTIVE, start)
    if room >= 1e-6:
        assert best.converged


@pytest.mark.parametrize("slots", [2, 3, 4])
def test_flights_of_a_few_slots(slots: int) -> None:
    kin = plane(0, slots=slots, time_step=5.0, max_speed=1e3, max_acceleration=1e3)
    best = maximize(kin, ACTIVE, straight_flight(kin))
    assert best.converged
    assert worst(kin, best.trajectory) < 1e-6


@dataclass
class Level:
    """The same everywhere, but for a slope."""

    slope: float

    def __call__(self, w: Real, /) -> StageValues:
        shape = (2, *w.shape[1:])
        return StageValues(
            np.full(shape, 2.0), np.full((2, *shape), self.slope), np.zeros((3, *shape))
        )


@pytest.mark.parametrize("stage", [Level(0.0), Level(1e-300), links(bpsk, 1e9, 1e9)])
def test_a_flat_reward_returns_the_start(stage: Stage) -> None:
    kin = plane(50)
    start = straight_flight(kin)
    best = maximize(kin, stage, start)
    assert best.trajectory is start
    assert best.converged
    assert best.iterations == 0
    assert best.value == 2
    assert best.weights.sum() == 1


def test_a_reward_that_fails_somewhere_is_avoided() -> None:
    """A reward without a value beyond x + y = 400: the route stays on this side."""

    def stage(w: Real, /) -> StageValues:
        values = ACTIVE(w)
        return StageValues(
            np.where(w.sum(axis=0) > 400, np.nan, values.value), values.gradient, values.hessian
        )

    kin = plane(50)
    best = maximize(kin, stage, straight_flight(kin))
    assert worst(kin, best.trajectory) < 1e-6
    assert best.trajectory.w.sum(axis=1).max() <= 400
    assert best.value > 0.577


def test_rewards_are_not_asked_for_where_a_direction_leads_nowhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kin, stage, corrector = plane(20), links(gaussian, 1e5, 1e5), Newton.corrector
    lost: list[Any] = []

    def finite(w: Real) -> StageValues:
        assert np.isfinite(w).all()
        return stage(w)

    def nowhere(self: Newton, *args: Any) -> Any:
        direction = corrector(self, *args)
        if lost:
            return direction
        lost.append(direction)
        return replace(direction, move=replace(direction.move, w=np.nan * direction.move.w))

    monkeypatch.setattr(Newton, "corrector", nowhere)
    assert maximize(kin, finite, straight_flight(kin)).converged
    assert lost


def test_an_iteration_cut_short_is_feasible_and_no_worse() -> None:
    kin = plane(50)
    start = straight_flight(kin)
    values = []
    for iterations in (0, 1, 3, 6):
        best = maximize(kin, ACTIVE, start, max_iterations=iterations)
        assert not best.converged
        assert best.iterations == iterations
        assert worst(kin, best.trajectory) < 1e-6
        values.append(best.value)
    assert values[0] >= reward(ACTIVE, start) * (1 - 1e-12)
    assert values == sorted(values)


@pytest.mark.parametrize("make", [plane, copter])
def test_concave_rewards_reach_the_global_optimum(make: Callable[..., Kinematics]) -> None:
    """Against CVXPY, from below and from above."""
    kin = make(80, time_step=1.0)
    stage = links(bowl, 1e-5, 3e-5)
    best = maximize(kin, stage, straight_flight(kin), tolerance=1e-8)
    flight = flight_variables(kin)
    gains = [
        -c * (HEIGHT**2 + LENGTH**2 / kin.slots * cp.sum_squares(flight.w - p[None] / LENGTH))
        for c, p in zip(stage.constants, stage.stations, strict=True)
    ]
    problem = cp.Problem(cp.Maximize(cp.minimum(*gains)), flight.constraints)
    problem.solve(solver=cp.CLARABEL)
    assert best.value == pytest.approx(float(problem.value), rel=1e-6)


@pytest.mark.parametrize("law", [bpsk, gaussian])
def test_a_small_problem_agrees_with_slsqp(law: Law) -> None:
    """Ten slots, non-concave: both climb from the same start to the same optimum."""
    stage = links(law, 4e4, 6e4)
    kin = plane(
        0, slots=10, time_step=4.0, max_speed=40.0, max_acceleration=4.0, end_velocity=np.zeros(2)
    )
    start = straight_flight(kin)
    best = maximize(kin, stage, start, tolerance=1e-8)
    n, k = kin.slots, kin.first_bounded_acceleration

    def flown(x: Real) -> Trajectory:
        a = np.vstack([x[2:].reshape(-1, 2), np.zeros(2)])
        v = x[:2] + kin.time_step * np.vstack([np.zeros(2), np.cumsum(a[:-1], axis=0)])
        w = kin.start + kin.time_step * np.vstack(
            [np.zeros(2), np.cumsum((v[:-1] + v[1:]) / 2, axis=0)]
        )
        return Trajectory(w, v, a)

    def room(x: Real) -> Real:
        flight = flown(x[:-1])
        return np.concatenate(
            [
                1 - (flight.v**2).sum(axis=1) / kin.max_speed**2,
                1 - (flight.a[k : n - 1] ** 2).sum(axis=1) / kin.max_acceleration**2,
                stage(flight.w.T).value.mean(axis=1) - x[-1],
            ]
        )

    def ends(x: Real) -> Real:
        flight = flown(x[:-1])
        return np.concatenate([(flight.w[-1] - kin.end) / 100, flight.v[-1]])

    x: Any = np.concatenate([start.v[0], start.a[:-1].ravel(), [reward(stage, start)]])
    limits: Any = [{"type": "ineq", "fun": room}, {"type": "eq", "fun": ends}]
    least: Any = minimize  # its stubs know no constraints of arrays
    how = {"method": "SLSQP", "constraints": limits, "options": {"maxiter": 500}, "tol": 1e-12}
    peer = least(lambda x: float(-x[-1]), x, **how)
    assert peer.success
    assert best.value == pytest.approx(float(peer.x[-1]), rel=1e-5)


@pytest.mark.figures
def test_the_published_rate_is_reached() -> None:
    """Zeng and Zhang, IEEE TWC 2017, Table II: 9.53 Mbit/s; 9.5208 by CVXPY.

    They keep at least 3 m/s over the station; here the aircraft may hover, which is worth little.
    """
    along = np.array([30.0, -30.0]) / np.sqrt(2)
    kin = plane(
        400,
        start=np.array([0.0, 1000.0]),
        end=np.array([1000.0, 0.0]),
        start_velocity=along,
        end_velocity=along,
        bound_first_acceleration=True,
    )
    stage = links(gaussian, 1e7)
    best = maximize(kin, stage, straight_flight(kin))
    assert best.converged
    assert best.value == pytest.approx(9.522, abs=0.002)


def test_symmetric_problems_have_symmetric_optima() -> None:
    kin = copter(40, start=np.array([-100.0, 0.0]), end=np.array([100.0, 0.0]), time_step=0.5)
    one = maximize(kin, links(bpsk, 4e4, stations=np.array([[0.0, 80.0]])), straight_flight(kin))
    mirrored = one.trajectory.w[::-1] * [-1, 1]
    assert one.trajectory.w == pytest.approx(mirrored, abs=1e-2)

    pair = np.array([[0.0, 80.0], [0.0, -80.0]])
    two = maximize(kin, links(bpsk, 4e4, 4e4, stations=pair), straight_flight(kin))
    assert two.weights == pytest.approx([0.5, 0.5], abs=1e-3)
    assert abs(two.trajectory.w[:, 1]).max() < 1e-2

    same = maximize(kin, links(bpsk, 4e4, 4e4, stations=pair[[0, 0]]), straight_flight(kin))
    assert same.value == pytest.approx(one.value, rel=1e-6)


def test_the_unit_of_the_reward_does_not_matter() -> None:
    kin = plane(50)
    start = straight_flight(kin)
    large = maximize(kin, links(bowl, 1e-5, 2e-5), start)
    small = maximize(kin, links(bowl, 1e-17, 2e-17), start)
    assert small.value * 1e12 == pytest.approx(large.value, rel=1e-6)
    assert small.iterations == large.iterations


def test_a_link_far_better_than_the_other_has_no_weight() -> None:
    kin, stage = SCENARIOS["dominated"]
    assert maximize(kin, stage, straight_flight(kin)).weights == pytest.approx([0, 1], abs=1e-5)


def test_the_certificate_sees_what_is_to_be_gained() -> None:
    kin = plane(20)
    start = straight_flight(kin)
    best = maximize(kin, ACTIVE, start)
    assert kkt_residual(kin, ACTIVE, start) > 1e3 * kkt_residual(kin, ACTIVE, best.trajectory)
    assert kkt_residual(kin, Level(0.0), start) == 0
    # the gain is real: the linearised step gains it, to first order
    near = 0.99 * best.trajectory.w + 0.01 * start.w
    early = Trajectory(
        near,
        0.99 * best.trajectory.v + 0.01 * start.v,
        0.99 * best.trajectory.a + 0.01 * start.a,
    )
    gain = kkt_residual(kin, ACTIVE, early, reach=10.0) * 10
    assert gain > best.value - reward(ACTIVE, early) > 0


def symmetric(rng: np.random.Generator, *shape: int) -> tuple[Real, Real]:
    """Random positive definite 2x2 matrices: packed (3, *shape), and as such (*shape, 2, 2)."""
    root = rng.standard_normal((*shape, 2, 2))
    full = root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(2)
    return np.moveaxis(full.reshape(*shape, 4)[..., [0, 1, 3]], -1, 0), full


@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.booleans(), st.booleans())
@settings(max_examples=25)
def test_the_band_matrix_is_the_dense_one(seed: int, n: int, first: bool, last: bool) -> None:
    rng = np.random.default_rng(seed)
    if n == 2:
        first = last = False  # otherwise nothing can move, and K is singular
    h, flights = 0.3, 2
    matrix = FlightMatrix(n, h, (first, last))
    (at_w, full_w), (at_v, full_v), (compliance, full_compliance) = (
        symmetric(rng, flights, n) for _ in range(3)
    )
    factors = matrix.factor(at_w, at_v, compliance)
    assert factors.sound.all()
    right = rng.standard_normal((3, flights, n, SIZE))
    solved = factors.solve(right.copy())
    eye = np.eye(2)
    for k in range(flights):
        dense = np.zeros((n, SIZE, n, SIZE))
        for i in range(n):
            dense[i, W, i, W], dense[i, V, i, V] = full_w[k, i], full_v[k, i]
            if i == n - 1:
                dense[i, Q, i, Q] = dense[i, Y, i, Y] = eye
                continue
            dense[i, Q, i, Q] = -full_compliance[k, i]
            for later, sign in ((i, -1.0), (i + 1, 1.0)):
                for row, column, value in ((Q, V, sign), (Y, V, -h), (Y, W, sign)):
                    dense[i, row, later, column] = value * eye
                    dense[later, column, i, row] = value * eye
        fixed = [(0, W), (n - 1, W)] + [(0, V)] * first + [(n - 1, V)] * last
        for i, part in fixed:
            dense[i, part] = 0
            dense[:, :, i, part] = 0
            dense[i, part, i, part] = eye
        expected = np.linalg.solve(dense.reshape(n * SIZE, -1), right[:, k].reshape(3, -1).T).T
        assert solved[:, k].reshape(3, -1) == pytest.approx(expected, rel=1e-6, abs=1e-8)

    w, y = rng.standard_normal((2, 2, flights, n))
    moved = matrix.dynamics(w * matrix.moves_w, np.zeros_like(w))
    assert (y[..., :-1] * moved).sum() == pytest.approx((matrix.pull(y[..., :-1]) * w).sum())


def discs(flight: ScaledFlight, first: Real | float, v: Real) -> Real:
    """Return s_0 = `first` and D v as one array."""
    x = np.concatenate([v * flight.matrix.moves_v, flight.accelerations(v)], axis=-1)
    return np.concatenate([np.broadcast_to(first, (1, *x.shape[1:])), x])


@pytest.mark.parametrize("make", [plane, copter])
def test_forces_are_the_transpose_of_what_they_act_on(make: Callable[..., Kinematics]) -> None:
    rng, flight = np.random.default_rng(0), ScaledFlight(make(2), [FlightLimits()])
    matrix, n = flight.matrix, flight.matrix.slots
    v, w = rng.standard_normal((2, 2, 3, n))
    v *= matrix.moves_v
    y, on_a = rng.standard_normal((2, 2, 3, n - 1))
    of_motion = (y * (matrix.dynamics(w, v) - matrix.dynamics(w, 0 * v))).sum()
    of_limits = (on_a * discs(flight, 0.0, v)[1:, :, n:]).sum()
    assert (flight.forces_asked(y, on_a) * v).sum() == pytest.approx(of_motion - of_limits)


def test_a_singular_flight_leaves_the_others_alone() -> None:
    rng = np.random.default_rng(0)
    matrix = FlightMatrix(5, 0.5, (True, True))
    at_w, at_v, compliance = (symmetric(rng, 3, 5)[0] for _ in range(3))
    alone = matrix.factor(at_w[:, 2:], at_v[:, 2:], compliance[:, 2:])
    at_w[:, 0] = np.nan
    at_w[:, 1] = at_v[:, 1] = compliance[:, 1] = 0
    factors = matrix.factor(at_w, at_v, compliance)
    assert factors.sound[:, 0].tolist() == [False, False, True]
    right = rng.standard_normal((1, 3, 5, SIZE))
    assert factors.solve(right.copy())[:, 2] == pytest.approx(alone.solve(right[:, 2:])[:, 0])


def inside(rng: np.random.Generator, m: int) -> Real:
    """A point of the cones of one flight."""
    x = rng.standard_normal((2, 1, m))
    return np.concatenate([(np.hypot(*x) + 10.0 ** rng.uniform(-4, 1, m))[None], x])


def product(a: Real, b: Real) -> Real:
    return np.concatenate([(a * b).sum(axis=0)[None], a[0] * b[1:] + b[0] * a[1:]])


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_the_scaling_of_the_cones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = 5
    s, z, (ds, dz) = inside(rng, m), inside(rng, m), rng.standard_normal((2, 3, 1, m))
    scaling = cones.Scaling.between(np.stack([s, z], axis=1))
    one = np.zeros((3, 1, m))
    one[0] = 1
    assert product(s, cones.inverse(s)) == pytest.approx(one, abs=1e-8)
    stiffness, compliance = scaling.stiffness, scaling.compliance()
    coupling = scaling.coupling()
    second = scaling.second_order(ds, dz)
    for i in range(m):
        w, eta = scaling.w[:, 0, i], scaling.per_square[0, i] ** -0.5
        full = eta * np.block(
            [[w[:1], w[1:]], [w[1:, None], np.eye(2) + np.outer(w[1:], w[1:]) / (1 + w[0])]]
        )
        back = np.linalg.inv(full)
        square = back @ back

        def close(expected: Real, size: float = float(np.abs(square).max())) -> Any:
            return pytest.approx(expected, rel=1e-5, abs=1e-7 * size)

        assert full @ z[:, 0, i] == pytest.approx(back @ s[:, 0, i], rel=1e-5, abs=1e-7)
        assert square @ s[:, 0, i] == close(z[:, 0, i])
        xx, xy, yy = stiffness[:, 0, i]
        block = np.array([[xx, xy], [xy, yy]])
        assert block == close(square[1:, 1:])
        xx, xy, yy = compliance[:, 0, i]
        assert block @ [[xx, xy], [xy, yy]] == pytest.approx(np.eye(2), abs=1e-6)
        assert coupling[:, 0, i] == close(square[1:, 0])
        goal = z - np.einsum("ij,j->i", square, ds[:, 0, i])[:, None, None]
        assert scaling.radial(z, ds[0], goal[1:])[0, i] == close(goal[0, 0, i])
        unaimed = goal - z
        assert scaling.radial(None, ds[0], unaimed[1:])[0, i] == close(unaimed[0, 0, i])
        scaled = full @ z[:, :, i]
        wanted = product(back @ ds[:, :, i], full @ dz[:, :, i])
        assert product(scaled, full @ second[:, :, i]) == pytest.approx(
            wanted, rel=1e-5, abs=1e-6 * np.abs(wanted).max()
        )
    longest = float(cones.reach(s, ds)[0, 0])
    assert longest > 0
    if longest < 1e10:
        tip = s + longest * ds
        assert (tip[0] - np.hypot(*tip[1:])).min() == pytest.approx(0, abs=1e-7 * (1 + longest))
        assert (s + 0.999 * longest * ds)[0].min() > 0


@dataclass(frozen=True)
class Faster(HalfPlanes):
    """||v|| >= `least`, in v_max, without its curvature."""

    least: float
    quantity: ClassVar = "v"

    def slack(self, x: Real) -> tuple[Real, Real]:
        speed = np.hypot(*x)
        return speed - self.least, x / np.maximum(speed, 1e-9)


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans(), st.sampled_from([0.0, 0.005, 0.1]))
@settings(max_examples=25)
def test_a_newton_step_solves_the_linearised_conditions(
    seed: int, hover: bool, cut: bool, least: float
) -> None:
    rng = np.random.default_rng(seed)
    kin = copter(1.4) if hover else plane(1.4)
    kept = [FlightLimits(), *([Faster(least)] if least else [])]
    flight, n, mu, share = ScaledFlight(kin, kept), kin.slots, np.array([[0.3]]), 0.7
    m = 2 * n - 1
    w, v = rng.standard_normal((2, 1, n)), 0.01 * rng.standard_normal((2, 1, n))
    x = discs(flight, 0.0, v)[1:]
    total = rng.standard_normal((2, 1, 1))
    concave = -symmetric(rng, 2, 1, n)[0]
    margin = rng.uniform(0, 0.1, (1, m))
    # a limit on what cannot move is there in name only, and pulls at nothing
    real = np.concatenate([np.ones((1, 1, m)), x != 0])
    slacks = np.concatenate([(np.hypot(*x) + 0.1 + margin)[None], x])
    limits = LimitsState(flight, np.stack([slacks, inside(rng, m) * real], axis=1), margin)
    begun = flight.begin(w, v, np.array([[0.2]]), 1.0)
    slow = begun[1] if least else None
    assert slow is None or isinstance(slow, HalfPlanesState)
    at = Iterate(
        w=w,
        v=v,
        y=rng.standard_normal((2, 1, n - 1)),
        states=(limits, *begun[1:]),
        weights=np.array([0.3, 0.7])[:, None, None],
        total=total,
        floor=best_floor(total, share * mu),
        gradient=rng.standard_normal((2, 2, 1, n)) * flight.matrix.moves_w,
        hessian=concave,
    )
    assert (share * mu / (total - at.floor)).sum() == pytest.approx(1)
    newton = Newton.factored(
        flight, at, barrier_share=share, proximal=np.array([[0.01]]), cut=np.array([[cut]])
    )
    assert newton.factors.sound.all()
    correction = 0.01 * rng.standard_normal((3, 1, m)) * real
    target = mu * cones.inverse(limits.pair[:, 0]) - correction
    of_slow = rng.standard_normal((1, n)) * (slow.on if slow else 0)
    for direction, goal, slow_goal, barrier in (
        (newton.predictor(), 0 * target, np.zeros((1, n)), 0 * mu),
        (newton.aimed(mu, (target, of_slow) if least else (target,)), target, of_slow, mu),
    ):
        dw, dv = direction.move.w, direction.move.v
        xx, xy, yy = -(at.weights * concave).sum(axis=1)
        dx, dy = dw
        bent = np.stack([(xx + 0.01) * dx + xy * dy, xy * dx + (yy + 0.01) * dy])
        weights = at.weights + direction.weights
        ds, z = direction.steps[0][:, 0], limits.pair[:, 1] + direction.steps[0][:, 1]
        on_w = flight.matrix.pull(at.y + direction.y)
        force = bent * flight.matrix.moves_w + on_w - (weights * at.gradient).sum(axis=1)
        assert force == pytest.approx(np.zeros((2, 1, n)), abs=1e-7)
        pulled = z[1:, :, :n] * flight.matrix.moves_v
        if slow is not None:
            slow_ds, slow_z = direction.steps[1][0], slow.z + direction.steps[1][1]
            assert slow.s * slow_z + slow.z * slow_ds == pytest.approx(slow.s * slow_goal, abs=1e-7)
            assert slow_ds == pytest.approx((slow.u * dv).sum(axis=0) - slow.margin)
            pulled = pulled + slow.u * slow_z
        on_v = flight.forces_asked(at.y + direction.y, z[1:, :, n:])
        assert on_v == pytest.approx(pulled, abs=1e-7 * (1 + np.abs(pulled).max()))
        assert flight.matrix.dynamics(w + dw, v + dv) == pytest.approx(
            np.zeros((2, 1, n - 1)), abs=1e-9
        )
        assert ds == pytest.approx(discs(flight, -margin, dv))
        assert weights.sum() == pytest.approx(1)
        gains = (at.gradient * dw[:, None]).sum(axis=(0, -1))[..., None]
        assert direction.total == pytest.approx(gains)
        room = (total - at.floor) * weights / at.weights
        assert gains - direction.floor + room == pytest.approx(barrier * share / at.weights)
        scaling = limits.scaling
        for i in range(m):
            axis = scaling.w[:, 0, i] * [1, -1, -1]
            square = scaling.per_square[0, i] * (2 * np.outer(axis, axis) - np.diag([1, -1, -1]))
            assert z[:, 0, i] + square @ ds[:, 0, i] == pytest.approx(
                goal[:, 0, i], rel=1e-5, abs=1e-6 * np.abs(square).max()
            )


def test_flights_side_by_side_do_not_know_of_each_other() -> None:
    """The searches from several starts are those from each alone."""
    kin, stage = SCENARIOS["plane 50 s"]
    others = [maximize(kin, stage, straight_flight(kin), max_iterations=k) for k in (2, 4, 30)]
    begun = [straight_flight(kin), *(other.trajectory for other in others)]
    together = maximize_all(kin, stage, begun)
    for flight, found in zip(begun, together, strict=True):
        alone = maximize(kin, stage, flight)
        assert found.iterations == alone.iterations
        assert found.trajectory.w == pytest.approx(alone.trajectory.w, abs=1e-6)


def test_a_long_flight_takes_time_in_proportion() -> None:
    """4,000 slots in the iterations of 400, all in band storage."""
    short, long = plane(80), plane(800)
    stage = links(bowl, 1e-5, 2e-5)
    few = maximize(short, stage, straight_flight(short))
    many = maximize(long, stage, straight_flight(long))
    assert few.converged
    assert many.converged
    assert many.iterations < 3 * few.iterations
    assert worst(long, many.trajectory) < 1e-6
