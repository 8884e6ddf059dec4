"""Rates as functions of the position and their tables; what arrives under shadowing."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.arrays import Real
from faao_mav.optimizer.design import Design, Link, design
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates import RateModel, by_position, link_coordinates
from faao_mav.optimizer.rates.field import SlotRate, rate_field
from faao_mav.optimizer.rates.table_rate import TableRate, kind_of, table_rates
from faao_mav.optimizer.shadowing import outcomes, shaded, shadowed, shadows
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.gain import PER_DB

FARTHEST = 400.0


def gradient_by_differences(f: Callable[[Real], Real], w: Real, h: float = 0.02) -> Real:
    return np.stack([(f(w + h * e) - f(w - h * e)) / (2 * h) for e in np.eye(2)], axis=1)


def hessian_by_differences(f: Callable[[Real], Real], w: Real) -> Real:
    return gradient_by_differences(lambda at: gradient_by_differences(f, at), w, 0.05)


def places(link: Link, seed: int = 3) -> Real:
    rng = np.random.default_rng(seed)
    return link.gains.station + rng.uniform(-150, 150, (20, 2))


def derivatives(link: Link, rate: RateModel, w: Real) -> tuple[Real, Real]:
    at = by_position(link, w.T, rate.partials(*link_coordinates(link, w.T)))
    return at.gradient.T, at.hessian[[0, 1, 1, 2]].T.reshape(-1, 2, 2)


def value_of(link: Link, rate: RateModel) -> Callable[[Real], Real]:
    return lambda w: rate.value(*link_coordinates(link, w.T))


def exactly(link: Link, wanted: Design, w: Real) -> Real:
    H = link.channel(w)
    return wanted.rate(link, H, wanted.precoders(link, H))


def differs(link: Link, rate: RateModel, w: Real, *, curvature: float = 1e-2) -> None:
    """Assert that slopes and curvatures at w (n, 2) are those of differences."""
    value = value_of(link, rate)
    gradient, hessian = derivatives(link, rate, w)
    assert gradient == pytest.approx(gradient_by_differences(value, w), rel=1e-3, abs=1e-5)
    assert hessian == pytest.approx(hessian_by_differences(value, w), rel=curvature, abs=1e-4)


def test_the_envelope_theorem(small_plan: MakePlan) -> None:
    """At the best precoders: the exact slope, and a curvature that is never too high."""
    plan = small_plan({"radio.fading": "realization"})
    link = build_problem(plan).bs_uav
    w, rate = places(link), SlotRate(link, design(plan))
    best = value_of(link, rate)
    gradient, hessian = derivatives(link, rate, w)
    assert gradient == pytest.approx(gradient_by_differences(best, w), rel=1e-4, abs=1e-7)
    excess = hessian - hessian_by_differences(best, w)
    assert np.linalg.eigvalsh(excess).max() < 1e-5


def rate_of(link: Link, wanted: Design) -> RateModel:
    if not kind_of(link, wanted):
        return SlotRate(link, wanted)
    return table_rates([(link, np.array(link.gains.extremes(FARTHEST)))], wanted)[0]


def test_tables_of_mutual_information(small_plan: MakePlan) -> None:
    """The curves are smooth, and nowhere above what precoders of the place itself carry."""
    for_it = {"optimizer.rate": "mutual_information", "radio.line_of_sight": "all_ones"}
    plan = small_plan(for_it | {"radio.fading_samples": 2})
    wanted, link = design(plan), build_problem(plan).bs_uav
    table, w = rate_of(link, wanted), places(link)
    assert isinstance(table, TableRate)
    at = link_coordinates(link, w.T)
    H = link.channel(w)
    P = table.initial_precoders(*at)
    assert table.value(*at) == pytest.approx(wanted.rate(link, H, P), abs=3e-3)
    differs(link, table, w)


STEPS = {"snr_db": [2, 6, 11, 15], "bit_per_s_per_hz": [0.5, 1, 2, 3.5]}
KINDS: dict[str, dict[str, Any]] = {
    "best": {},
    "zf": {"optimizer.precoder": "zf"},
    "gaussian": {"optimizer.inputs": "gaussian", "radio.line_of_sight": "all_ones"},
    "mrt, gaussian": {"optimizer.precoder": "mrt", "optimizer.inputs": "gaussian"},
    "another law": {
        "radio.gain": {"exponent": 2.6, "elevation_db": [20, -60, 20]},
        "radio.ground_user.gain": {"exponent": 2.2},
    },
    "steps": {"radio.rates": STEPS},
    "three antennas": {"radio.rates": STEPS, "radio.relay.antennas": 3},
}
FADINGS: dict[str, dict[str, Any]] = {
    "none": {"radio.fading": "none"},
    "known": {"radio.fading": "realization"},
    "statistical": {"radio.fading_samples": 4},
    "instantaneous": {"radio.fading_samples": 4, "radio.csi": "instantaneous"},
}


@pytest.mark.parametrize(
    ("kind", "fading"),
    [
        *(("best", fading) for fading in FADINGS),
        *(("zf", fading) for fading in ("known", "statistical")),
        ("gaussian", "instantaneous"),
        ("mrt, gaussian", "statistical"),
        ("another law", "known"),
        *(("steps", fading) for fading in ("none", "statistical")),
        ("three antennas", "known"),
    ],
)
def test_models_have_the_rate_of_every_place_and_its_slopes(
    small_plan: MakePlan, kind: str, fading: str
) -> None:
    plan = small_plan(KINDS[kind] | FADINGS[fading])
    wanted = design(plan)
    for link in build_problem(plan).links:
        within = 2e-4
        if link.steps is not None:
            link, within = replace(link, steps=link.steps.widened(3.0)), 1e-3
        rate, w = rate_of(link, wanted), places(link)
        exact = exactly(link, wanted, w)
        assert value_of(link, rate)(w) == pytest.approx(exact, abs=within)
        if wanted.optimal and link.steps is None:
            P = rate.initial_precoders(*link_coordinates(link, w.T))
            assert P is not None
            P *= np.sqrt(link.power) / np.linalg.norm(P, axis=(-2, -1), keepdims=True)
            assert link.mean_rates(link.channel(w), P) == pytest.approx(exact, abs=2e-3)
        differs(link, rate, w, curvature=1e-2 if link.steps is None else 2e-2)


def test_a_radio_may_have_one_rate_alone(small_plan: MakePlan) -> None:
    plan = small_plan({"radio.rates": {"snr_db": [8], "bit_per_s_per_hz": [1]}})
    steps = rate_field(build_problem(plan), design(plan)).links[0].steps
    assert steps is not None
    assert steps.most == 1


def test_one_gain_alone_has_a_table(small_plan: MakePlan) -> None:
    plan = small_plan({"radio.fading": "none"})
    link = replace(build_problem(plan).bs_uav, power=1.0, noise=1.0)
    rate = table_rates([(link, np.zeros(2))], design(plan))[0]
    assert np.isfinite(value_of(link, rate)(places(link))).all()


SPREAD: dict[str, Any] = {
    "radio.gain": {"spread_db": 6, "correlation_m": 25},
    "radio.fading": "none",
    "radio.base_station.power_dbm": 0,
    "radio.relay.power_dbm": 0,
    "flight.duration": 60,
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


def test_the_smaller_of_two_normal_rates(small_plan: MakePlan) -> None:
    """At one place with rates 2 + X / 10 the mean of the smaller is 2 - 0.6 / sqrt(pi)."""
    problem = build_problem(small_plan(SPREAD))
    w = np.zeros((problem.kinematics.slots, 2))
    found = outcomes(problem, w, lambda db: np.full((2, len(w)), 2 + db / 10), 3000)
    assert found.shape == (3000, len(w))
    np.testing.assert_allclose(found[:, 0] * len(w), found[:, -1])  # the same in all slots
    found = found[:, -1] / len(w)
    assert found.mean() == pytest.approx(2 - 0.6 / np.sqrt(np.pi), abs=0.04)
    assert np.quantile(found, 0.5) == pytest.approx(2 - 0.6 * 0.5449, abs=0.05)


def test_a_shade_is_the_field_that_is_expected_where_less_arrives(small_plan: MakePlan) -> None:
    """Of fields that are drawn: -z cov(X, S) / sd(S), with S what arrives."""
    plan = small_plan(SPREAD | {"radio.gain": {"spread_db": 0.1, "correlation_m": 25}})
    problem = build_problem(plan)
    field = rate_field(problem, design(plan))
    n = problem.kinematics.slots
    w = np.stack([np.linspace(0, 50, n), 50 - np.linspace(0, 50, n) ** 2 / 50], axis=1)
    X = 10 * np.array(list(shadows(problem, w, 3000)))
    S = outcomes(problem, w, lambda db: field.value(w.T, db), 3000)[:, -1]
    less = shaded(problem, field, w, 1.3)
    for hop, (link, plain) in enumerate(zip(less.links, field.links, strict=True)):
        expected = -1.3 * ((S - S.mean()) @ X[:, hop]) / len(S) / S.std()
        found = 10 * (link.gains.log(w.T) - plain.gains.log(w.T)) / PER_DB
        np.testing.assert_allclose(found, expected, atol=0.2)
        assert (found.min() < -0.6) == (hop == 1)  # the one that limits


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
