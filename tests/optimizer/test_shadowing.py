"""What arrives under shadowing, and plans for most of it, beside fields drawn otherwise."""

from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.shadowing import outcomes, shadowed, shadows, tolled
from faao_mav.optimizer.solution import Solution

SPREAD: dict[str, Any] = {
    "radio.gain": {"spread_db": 6, "correlation_m": 25},
    "radio.fading": "none",
    "radio.base_station.power_dbm": 0,
    "radio.relay.power_dbm": 0,
    "flight.duration": 60,
    "flight.time_step": 1,
    "vehicle.max_speed": 8,
    "vehicle.max_acceleration": 2,
}


def test_shadows_are_fields_of_the_spread_and_the_correlation(small_plan: MakePlan) -> None:
    own = {"spread_db": 3, "correlation_m": 100}
    problem = build_problem(small_plan(SPREAD | {"radio.ground_user.gain": own}))
    w = np.array([[0.0, 0.0], [15.0, 20.0], [60.0, 80.0], [900.0, 0.0]])
    X = np.array(list(shadows(problem, w, 3000)))
    for hop, (sigma, D) in enumerate([(6, 25), (3, 100)]):
        expected = sigma**2 * np.exp(-np.hypot(*(w[:, None] - w).T) / D)
        assert np.cov(X[:, hop].T) == pytest.approx(expected, abs=0.1 * sigma**2)
    assert np.corrcoef(X[:, 0, 0], X[:, 1, 0])[0, 1] == pytest.approx(0, abs=0.06)
    again = next(shadows(problem, w))
    np.testing.assert_array_equal(again, X[0])
    # at one place with rates 2 + X / 10 the mean of the smaller is 2 - 0.6 / sqrt(pi)
    problem = build_problem(small_plan(SPREAD))
    w = np.zeros((problem.kinematics.slots, 2))
    found = outcomes(problem, w, lambda db: np.full((2, len(w)), 2 + db / 10), 3000)
    assert found.shape == (3000, len(w))
    np.testing.assert_allclose(found[:, 0] * len(w), found[:, -1])  # the same in all slots
    found = found[:, -1] / len(w)
    assert found.mean() == pytest.approx(2 - 0.6 / np.sqrt(np.pi), abs=0.04)
    assert np.quantile(found, 0.5) == pytest.approx(2 - 0.6 * 0.5449, abs=0.05)


def test_a_toll_is_as_steep_as_the_variance(small_plan: MakePlan) -> None:
    """To first order, of a few slots that move, and with slopes as differences have them."""
    plan = small_plan(SPREAD)
    problem = build_problem(plan)
    field = rate_field(problem, design(plan))
    n = problem.kinematics.slots
    w = np.stack([np.linspace(0, 50, n), 50 - np.linspace(0, 50, n) ** 2 / 50], axis=1)
    stage = tolled(problem, field, w, lambda db: field.value(w.T, db), 1.3)
    base, at, h = field(w.T), stage(w.T), 1e-3
    np.testing.assert_allclose(at.value, base.value, atol=1e-9)
    for axis in (0, 1):
        move = h * np.eye(2)[axis][:, None]
        up, down = stage(w.T + move), stage(w.T - move)
        slope = (up.value - down.value) / (2 * h)
        np.testing.assert_allclose(at.gradient[axis], slope, atol=1e-6)
        bend = (up.gradient[axis] - down.gradient[axis]) / (2 * h)
        np.testing.assert_allclose(at.hessian[2 * axis], bend, atol=1e-5)


def under_drawn_fields(solution: Solution, count: int = 1000) -> Real:
    """What arrives under fields of the same law that are drawn by their covariance."""
    law, w = solution.plan.radio.gain, solution.w
    assert law.spread_db is not None
    C = law.spread_db**2 * np.exp(-np.hypot(*(w[:, None] - w).T) / law.correlation_m)
    values, vectors = np.linalg.eigh(C)
    X = np.random.default_rng(1).standard_normal((count, 2, len(w)))
    X = X @ (vectors * np.sqrt(np.maximum(values, 0))).T
    grid = np.linspace(-4, 4, 33) * law.spread_db
    table = np.array([solution.recomputed_slots(10 ** (db / 10)) for db in grid])
    rates = np.empty_like(X)
    for hop in (0, 1):
        for slot in range(len(w)):
            rates[:, hop, slot] = np.interp(X[:, hop, slot], grid, table[:, hop, slot])
    return np.asarray(rates.mean(axis=-1).min(axis=-1))


def test_a_plan_for_nine_of_ten_beats_that_for_the_mean_there_and_loses_in_the_mean(
    small_plan: MakePlan,
) -> None:
    mean = optimize(small_plan(SPREAD))
    most = optimize(small_plan(SPREAD | {"radio.reliability": 0.9}))
    of_mean, of_most = under_drawn_fields(mean), under_drawn_fields(most)
    assert np.quantile(of_most, 0.1) > 1.05 * np.quantile(of_mean, 0.1)
    assert of_most.mean() < of_mean.mean()
    for solution, drawn in ((mean, of_mean), (most, of_most)):
        told = shadowed(solution)
        assert told is not None
        assert told.mean == pytest.approx(drawn.mean(), rel=0.05)
        assert told.quantiles[0.1] == pytest.approx(np.quantile(drawn, 0.1), rel=0.12)
        assert list(told.quantiles) == [0.1, 0.5, 0.9]
        arrived = np.array(list(told.arrived.values()))
        assert (np.diff(arrived) >= 0).all()
        assert (np.diff(arrived, axis=0) >= 0).all()
        np.testing.assert_allclose(arrived[:, -1] / len(solution.w), list(told.quantiles.values()))
        assert solution.is_feasible(1e-6)
        assert (solution.history <= solution.rates.R_avg).all()


def test_a_spread_of_almost_nothing_changes_nothing(small_plan: MakePlan) -> None:
    plain = SPREAD | {"radio.gain": {}, "flight.duration": 20, "flight.time_step": 1}
    solution = optimize(small_plan(plain))
    assert shadowed(solution) is None
    almost = {"radio.gain": {"spread_db": 1e-3}, "radio.reliability": 0.75}
    under = optimize(small_plan(plain | almost))
    told = shadowed(under)
    assert told is not None
    assert under.rates.R_avg == pytest.approx(solution.rates.R_avg, abs=1e-3)
    assert set(told.quantiles) == {0.1, 0.25, 0.5, 0.9}
    for each in (*told.quantiles.values(), told.mean):
        assert each == pytest.approx(under.rates.R_avg, abs=1e-3)
