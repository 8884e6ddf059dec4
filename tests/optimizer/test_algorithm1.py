"""Algorithm 1, whole."""

from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.errors import PlanError, SolverError
from faao_mav.optimizer import algorithm1 as module
from faao_mav.optimizer.algorithm1 import optimize_precoders
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Progress
from faao_mav.radio.precoder import SCHEMES

COARSE = {"flight.time_step": 1}
BRIEF = COARSE | {"optimizer.max_iterations": 1}


@pytest.mark.parametrize(
    ("fading", "line_of_sight"), [("realization", "ula"), ("none", "all_ones")]
)
def test_a_solution_proves_itself(paper_plan: MakePlan, fading: str, line_of_sight: str) -> None:
    plan = paper_plan({"radio.line_of_sight": line_of_sight, "radio.fading": fading})
    solution = optimize(plan)
    assert solution.converged
    assert "less than 0.0001" in solution.ending
    residuals = solution.residuals()
    assert {"(11) position", "(12) velocity", "(13d) ends", "(13e) speed"} <= set(residuals)
    assert max(residuals.values()) < 1e-6
    assert solution.rates.R_avg == pytest.approx(solution.history.max(), abs=1e-12)
    assert solution.rates.R_avg > solution.history[0] + 0.1
    assert solution.iterations == len(solution.history) - 1


def test_rates_are_7_to_10_by_brute_force(paper_plan: MakePlan) -> None:
    solution = optimize(paper_plan(BRIEF))
    radio, altitude = solution.plan.radio, solution.plan.flight.altitude
    x = np.array([[a, b] for a in (1, -1) for b in (1, -1)])
    rates = []
    for position, H_r, precoders, noise in (
        (radio.base_station.position, solution.H_rB, solution.P_B, radio.relay.noise),
        (radio.ground_user.position, solution.H_rU, solution.P_U, radio.ground_user.noise),
    ):
        bits = []
        for w, fading, P in zip(solution.w, H_r, precoders, strict=True):
            d2 = np.sum((w - position) ** 2) + altitude**2
            H = np.sqrt(radio.reference_gain / d2) * fading
            total = sum(
                np.exp(-(np.linalg.norm(H @ P @ (m - k)) ** 2) / (4 * noise)) for m in x for k in x
            )
            bits.append(2 * 2 - np.log2(total))
        rates.append(np.sum(bits) / solution.plan.flight.duration)
    assert solution.rates.R_U == pytest.approx(rates[0], abs=1e-9)
    assert solution.rates.R_G == pytest.approx(rates[1], abs=1e-9)
    assert solution.rates.R_avg == min(solution.rates.R_U, solution.rates.R_G)


@pytest.mark.parametrize("scheme", ["mrt", "zf"])
def test_schemes_keep_their_precoder_and_fly_for_it(paper_plan: MakePlan, scheme: str) -> None:
    solution = optimize(paper_plan(COARSE | {"optimizer.precoder": scheme}))
    assert max(solution.residuals().values()) < 1e-6
    radio = solution.plan.radio
    gain = radio.reference_gain / (np.sum(solution.w**2, axis=1) + 40.0**2)
    H = np.sqrt(gain)[:, None, None] * solution.H_rB
    expected = SCHEMES[scheme](H, radio.base_station.power, radio.relay.noise)
    assert solution.P_B == pytest.approx(expected, rel=1e-9)
    assert solution.rates.R_avg > solution.history[0]


@pytest.mark.parametrize(
    "changes",
    [
        {"radio.base_station.antennas": 3, "radio.ground_user.antennas": 1},
        {"radio.modulation": "qpsk"},
        {"flight.start_velocity": "free", "flight.bound_first_acceleration": False},
        {"flight.start_velocity": [0, 6], "flight.end_velocity": [5, -3]},
        {"radio.base_station.power_dbm": -60, "radio.relay.power_dbm": -60},
        {"radio.base_station.power_dbm": 60, "radio.relay.power_dbm": -20},
        {"flight.duration": 1.5, "flight.end": [0.5, 49.5], "flight.time_step": 0.5},
    ],
)
def test_unusual_plans_are_solved(paper_plan: MakePlan, changes: dict[str, Any]) -> None:
    solution = optimize(paper_plan(BRIEF | {"optimizer.max_iterations": 2} | changes))
    assert max(solution.residuals().values()) < 1e-6
    assert np.isfinite(solution.history).all()
    assert solution.rates.R_avg >= solution.history[0]


def test_a_solver_failure_keeps_the_best_so_far(
    paper_plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def failing(*arguments: Any, **options: Any) -> Any:
        calls.append(1)
        if len(calls) > 2:
            raise SolverError("no progress")
        return optimize_precoders(*arguments, **options)

    monkeypatch.setattr(module, "optimize_precoders", failing)
    solution = optimize(paper_plan(COARSE))
    assert not solution.converged
    assert solution.ending == "stopped in iteration 2, the best so far is kept: no progress"
    assert solution.iterations == 1
    assert solution.rates.R_avg == pytest.approx(solution.history[1], abs=1e-12)
    assert max(solution.residuals().values()) < 1e-6


def test_progress_is_told(paper_plan: MakePlan) -> None:
    told: list[Progress] = []
    solution = optimize(paper_plan(COARSE), observe=told.append)
    assert {p.iteration for p in told} == set(range(1, solution.iterations + 1))
    assert {p.stage for p in told} == {"trajectory (27)", "precoders (35)"}
    assert [p.best_rate for p in told] == sorted(p.best_rate for p in told)
    assert told[0].best_rate == solution.history[0]


def test_what_is_too_large_is_refused_before_it_is_tried(paper_plan: MakePlan) -> None:
    with pytest.raises(PlanError, match=r"optimizer\.method: algorithm1 would need .* cones"):
        optimize(paper_plan({"radio.modulation": "64qam"}))
    with pytest.raises(PlanError, match=r"bpsk with 2, 64 and 2 antennas"):
        optimize(paper_plan({"radio.relay.antennas": 64}))
