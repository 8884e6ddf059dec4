"""What no route can exceed: never below anything that can be flown."""

from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan
from random_flights import random_flight

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.axis_bound import axis_bound
from faao_mav.optimizer.search.best_rates import best_at, best_rates
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.search.map_bound import map_bound
from faao_mav.plan import read_plan

FAINT = {
    "radio.fading": "realization",
    "radio.base_station.power_dbm": 0,
    "radio.relay.power_dbm": 0,
}


def best_rate(problem: Problem, w: Real) -> float:
    means = []
    for link in problem.links:
        H = link.channel(w)
        means.append(link.draw_rates(H, link.best(H[:, None])).mean())
    return float(min(means))


@pytest.mark.parametrize("line_of_sight", ["ula", "all_ones"])
def test_no_flight_is_above_the_bound(small_plan: MakePlan, line_of_sight: str) -> None:
    problem = build_problem(small_plan(FAINT | {"radio.line_of_sight": line_of_sight}))
    bound = upper_bound(problem).value
    for seed in range(30):
        assert best_rate(problem, random_flight(problem.kinematics, seed).w) <= bound


LAWS: tuple[dict[str, Any], ...] = (
    {"exponent": 3.2},
    {"elevation_db": [0, 0, -40]},  # least overhead
    {"exponent": 2.4, "elevation_db": [-8, 12]},
)


@pytest.mark.parametrize("law", LAWS)
def test_no_flight_is_above_the_bounds_under_another_law(
    small_plan: MakePlan, law: dict[str, Any]
) -> None:
    """Of 100 random flights for each law, and the best that is known."""
    faint = {"radio.base_station.power_dbm": 5, "radio.fading": "none", "radio.gain": law}
    plan = small_plan(faint | {"radio.ground_user.gain": {"exponent": 2.2}})
    problem, best = build_problem(plan), optimize(plan)
    flights = [random_flight(problem.kinematics, seed).w.T for seed in range(100)]
    w = np.stack([*flights, best.w.T], axis=1)
    most = rate_field(problem, design(plan)).value(w).mean(axis=-1).min(axis=0).max()
    assert most == pytest.approx(best.rates.R_avg, abs=1e-4)
    rates = best_rates(problem)
    found = map_bound(problem, rates, cells=3_000), axis_bound(problem, rates)
    assert most <= min(found) <= 1.4 * most


@pytest.mark.usefixtures("coarse_map")
@pytest.mark.parametrize(
    ("changes", "exact"),
    [
        ({}, True),
        ({"radio.fading": "ergodic", "radio.fading_samples": 8}, False),
        ({"radio.modulation": "qpsk"}, False),
        ({"radio.base_station.antennas": 1, "radio.relay.antennas": 1}, True),
    ],
)
def test_a_known_plan_tightens_it_and_stays_below(
    small_plan: MakePlan, changes: dict[str, Any], exact: bool
) -> None:
    plan = small_plan(FAINT | {"flight.duration": 9} | changes)
    found, problem = optimize(plan).rates.R_avg, build_problem(plan)
    alone, tightened = upper_bound(problem), upper_bound(problem, found)
    assert alone.exact is tightened.exact is exact
    assert found <= tightened.value <= max(alone.value + 1e-5, 1.03 * found)
    assert tightened.value <= 2 * problem.bs_uav.transmit * (1 if "qpsk" not in str(changes) else 2)


@pytest.mark.usefixtures("coarse_map")
def test_within_a_fortieth_of_the_active_paper_plan() -> None:
    plan = read_plan(MISSIONS / "paper_active.yaml")
    plan = plan.changed(
        {"flight.duration": 20, "flight.time_step": 0.5, "optimizer.method": "direct"}
    )
    found = optimize(plan).rates.R_avg
    limit = upper_bound(build_problem(plan), found)
    assert limit.exact
    assert found <= limit.value <= 1.025 * found


@pytest.mark.parametrize("line_of_sight", ["ula", "all_ones"])
def test_best_rates_are_those_of_the_channel_or_above(
    small_plan: MakePlan, line_of_sight: str
) -> None:
    problem = build_problem(small_plan(FAINT | {"radio.line_of_sight": line_of_sight}))
    link = problem.uav_user
    w = link.gains.station + np.random.default_rng(0).uniform(-80, 80, (20, 2))
    values, exact = best_at(problem, link, link.gains.log(w.T)[:, None])
    H = link.channel(w)
    true = link.draw_rates(H, link.best(H[:, None]))
    assert exact
    assert (values[:, 0] >= true - 1e-6).all()
    if line_of_sight == "all_ones":
        assert values[:, 0] == pytest.approx(true, abs=1e-6)
