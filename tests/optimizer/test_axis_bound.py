"""Dynamic programming over place and speed along the axis: it misses no flight."""

from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan, edited
from hypothesis import given, settings
from hypothesis import strategies as st
from random_flights import random_flight

from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.axis_bound import AxisBound
from faao_mav.optimizer.search.best_rates import best_rates
from faao_mav.plan import parse_plan

FREE = {
    "flight.start_velocity": "free",
    "flight.end_velocity": "free",
    "flight.bound_first_acceleration": False,
}
KINDS: dict[str, dict[str, Any]] = {
    "R_avg": {},
    "delivered": {"radio.causal": True},
    "known draws": {"radio.fading": "realization"},
    "free ends": FREE,
    "fast": FREE | {"vehicle.max_speed": 40, "vehicle.max_acceleration": 3},
}


@pytest.fixture(scope="module")
def bounded(small_plan: MakePlan) -> dict[str, AxisBound]:
    faint = {"radio.base_station.power_dbm": 3, "radio.fading": "none"}
    found = {}
    for kind, changes in KINDS.items():
        problem = build_problem(small_plan(faint | changes))
        found[kind] = AxisBound(problem, best_rates(problem), 6, 4)
    return found


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25)
@given(seed=st.integers(0, 2**31))
def test_every_step_of_a_flight_is_in_reach(
    bounded: dict[str, AxisBound], kind: str, seed: int
) -> None:
    cells, rng = bounded[kind], np.random.default_rng(seed)
    kin = cells.problem.kinematics
    flight = random_flight(kin, seed)
    instants, _, _ = cells.times
    n = np.minimum((instants / kin.time_step).astype(int), kin.slots - 2)
    tau = (instants - kin.time_step * n)[:, None]
    first, second = (link.gains.station for link in cells.problem.links)
    axis = (second - first) / np.hypot(*(second - first))
    x = (flight.w[n] + tau * flight.v[n] + tau**2 / 2 * flight.a[n] - first) @ axis
    v = (flight.v[n] + tau * flight.a[n]) @ axis
    rows = np.clip(np.rint((x - cells.x[0]) / cells.side), 0, len(cells.x) - 1).astype(int)
    columns = np.rint(v / cells.gap).astype(int) - int(cells.columns[0])
    for k in rng.permutation(len(instants) - 1)[:4]:
        for here, there, sign in ((k, k + 1, 1), (k + 1, k, -1)):
            values = np.full((1, len(cells.columns), len(cells.x)), -np.inf)
            values[0, columns[there], rows[there]] = 1.0
            assert cells.reached(values, sign)[0, columns[here], rows[here]] == 1.0
            worth = cells.rewards(here, np.array([0.5]), cells.across[None])
            assert worth[0, 0, columns[here], rows[here]] > -np.inf
    away = np.abs((flight.w - first) @ np.array([-axis[1], axis[0]]))
    for parts in cells.passed[1]:
        assert (parts <= away + 1e-6).all(axis=1).any()


@pytest.fixture(scope="module")
def limits(bounded: dict[str, AxisBound]) -> dict[str, float]:
    return {kind: cells.bound([0.4, 0.5, 0.6]) for kind, cells in bounded.items()}


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25)
@given(seed=st.integers(0, 2**31))
def test_no_flight_is_above_the_bound(
    bounded: dict[str, AxisBound], limits: dict[str, float], kind: str, seed: int
) -> None:
    problem = bounded[kind].problem
    flight = random_flight(problem.kinematics, seed)
    rates = rate_field(problem, design(problem.plan)).value(flight.w.T)
    reached = objective(rates, problem.kinematics, problem.maximised_queue)
    assert reached <= limits[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_no_optimised_flight_is_above_it(
    bounded: dict[str, AxisBound], limits: dict[str, float], kind: str
) -> None:
    plan = bounded[kind].problem.plan
    found = optimize(plan)
    reached = found.delivered_rate if plan.radio.causal else found.rates.R_avg
    assert reached <= limits[kind] <= 1.6 * reached


def test_the_paper_s_plan_at_10_dbm_is_within_an_eighth_of_it() -> None:
    powers = {"radio.base_station.power_dbm": 10, "radio.relay.power_dbm": 10}
    changes = powers | {"optimizer.method": "direct", "flight.time_step": 0.5}
    plan = parse_plan(edited((MISSIONS / "paper_active.yaml").read_text(), changes))
    problem, reached = build_problem(plan), optimize(plan).rates.R_avg
    cells = AxisBound(problem, best_rates(problem), 6, 8)
    assert reached < cells.bound([0.45, 0.55]) < 1.125 * reached


@pytest.mark.parametrize("instants", [1, 2, 3])
def test_flights_may_have_few_instants(
    bounded: dict[str, AxisBound], monkeypatch: pytest.MonkeyPatch, instants: int
) -> None:
    monkeypatch.setattr("faao_mav.optimizer.search.axis_bound._MOST_INSTANTS", instants)
    one = bounded["free ends"]
    cells = AxisBound(one.problem, one.rates, one.speeds, one.parts)
    assert len(cells.times[0]) == instants
    assert optimize(one.problem.plan).rates.R_avg <= cells.bound([0.5])
