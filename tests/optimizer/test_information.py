"""Plans for the mutual information: `optimizer.rate: mutual_information`."""

from pathlib import Path
from typing import Any

import pytest
from certificate import still_gained
from conftest import MakePlan

from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import fresh_rates, price, saturation
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.solution import Solution, load_solution, save_solution
from faao_mav.plan import Plan

FOR_IT = {"optimizer.rate": "mutual_information", "radio.modulation": "qpsk", "power": 5}
BPSK = {"radio.modulation": "bpsk", "power": 0}


@pytest.fixture(scope="module")
def planned(small_plan: MakePlan) -> Solution:
    return optimize(plan_of(small_plan, BPSK | {"radio.fading_samples": 8, "radio.causal": True}))


def plan_of(small_plan: MakePlan, changes: dict[str, Any]) -> Plan:
    """The small plan for the mutual information of QPSK, at a power where it matters."""
    wanted = FOR_IT | {"optimizer.starts": ["straight"]} | changes
    power = wanted.pop("power")
    powers = {"radio.base_station.power_dbm": power, "radio.relay.power_dbm": power}
    return small_plan(powers | wanted)


def maximised(solution: Solution) -> float:
    causal = solution.plan.radio.causal
    return solution.delivered_rate if causal else solution.rates.R_avg


@pytest.mark.parametrize(
    "changes",
    [
        BPSK | {"radio.fading": "none", "radio.causal": True, "radio.duplex": "half"},
        {"radio.fading": "none", "optimizer.inputs": "gaussian"},
    ],
)
def test_it_is_never_below_the_plan_for_the_cutoff_rate(
    small_plan: MakePlan, changes: dict[str, Any]
) -> None:
    plan = plan_of(small_plan, changes)
    solution = optimize(plan)
    assert solution.is_feasible()
    assert solution.history[-1] == pytest.approx(maximised(solution), abs=1e-12)
    if plan.optimizer.inputs == "gaussian":
        assert solution.gain is None
        return
    assert solution.gain is not None
    assert solution.gain > -1e-4
    before = optimize(plan.changed({"optimizer.rate": "cutoff"}))
    assert before.gain is None
    assert solution.rates.R_avg > before.rates.R_avg  # of the same flight it would be above too
    problem = build_problem(plan)
    rates = [
        link.mean_rates(link.channel(before.w, H_r), P)
        for link, H_r, P in zip(
            problem.links, (before.H_rB, before.H_rU), (before.P_B, before.P_U), strict=True
        )
    ]
    reached = before.relay(*rates).rate if plan.radio.causal else min(r.mean() for r in rates)
    assert maximised(solution) - solution.gain == pytest.approx(reached, abs=1e-9)


def test_its_rates_are_those_that_sampling_finds(planned: Solution) -> None:
    """Two ways to average over the noise, and one answer; more than the plan for cutoff rates."""
    information = price(planned)
    assert planned.rates.R_avg == pytest.approx(information.average, abs=0.02)
    assert planned.delivered_rate == pytest.approx(information.delivered, abs=0.02)
    assert information.delivered <= information.average + 1e-9
    assert planned.gain is not None
    assert planned.gain > 0.005
    assert planned.converged
    assert still_gained(planned) < 2e-4


@pytest.mark.usefixtures("coarse_map")
def test_what_surrounds_a_plan_speaks_of_it(planned: Solution, tmp_path: Path) -> None:
    fresh = fresh_rates(planned)
    assert fresh is not None
    assert fresh.delivered == pytest.approx(planned.delivered_rate, abs=0.3)
    assert fresh.delivered_error < 0.1
    assert not saturation(planned).saturated
    bound = upper_bound(planned.problem, planned.rates.R_avg)
    assert planned.rates.R_avg <= bound.value < 1.1 * planned.rates.R_avg
    assert not bound.exact
    save_solution(planned, tmp_path / "result.npz")
    loaded = load_solution(tmp_path / "result.npz")
    assert loaded.gain == planned.gain
    assert loaded.recomputed() == planned.rates
