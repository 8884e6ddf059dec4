"""The direct method, whole."""

from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan

from faao_mav.errors import PlanError
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Progress, load_solution, save_solution
from faao_mav.plan import Plan, read_plan

KNOWN = {"radio.fading": "realization"}


@pytest.fixture(scope="module")
def faint_plan(small_plan: MakePlan) -> MakePlan:
    """The small plan with 10 dB less power: far from saturation even at the best precoders."""

    def make(changes: dict[str, Any] | None = None) -> Plan:
        powers = {"radio.base_station.power_dbm": 0, "radio.relay.power_dbm": 0}
        return small_plan(powers | (changes or {}))

    return make


@pytest.mark.parametrize(
    ("line_of_sight", "fading", "csi", "modulation"),
    [
        ("ula", "none", "statistical", "bpsk"),
        ("ula", "realization", "statistical", "qpsk"),
        ("all_ones", "ergodic", "statistical", "qpsk"),
        ("ula", "ergodic", "instantaneous", "bpsk"),
    ],
)
def test_a_solution_proves_itself(
    faint_plan: MakePlan, line_of_sight: str, fading: str, csi: str, modulation: str
) -> None:
    plan = faint_plan(
        {
            "radio.line_of_sight": line_of_sight,
            "radio.fading": fading,
            "radio.csi": csi,
            "radio.fading_samples": 6,
            "radio.modulation": modulation,
        }
    )
    solution = optimize(plan)
    assert solution.converged
    assert max(solution.residuals().values()) < 1e-6
    assert (np.diff(solution.history) >= 0).all()
    assert solution.history[-1] == solution.rates.R_avg
    assert solution.rates.R_avg > solution.history[0] + 0.02
    assert set(solution.starts) <= {"straight", "bs", "user", "bs-user", "user-bs"}
    draws = (6,) if fading == "ergodic" else ()
    assert solution.H_rB.shape == (*draws, 20, 2, 2)
    assert solution.P_B.shape == (*(draws if csi == "instantaneous" else ()), 20, 2, 2)


@pytest.mark.parametrize("modulation", ["qpsk", "8psk"])
def test_precoders_are_as_good_as_a_search_from_all_starts(
    faint_plan: MakePlan, modulation: str
) -> None:
    solution = optimize(faint_plan(KNOWN | {"radio.modulation": modulation}))
    link = solution.problem.bs_uav
    H = link.channel(solution.w, solution.H_rB)
    found = link.draw_rates(H, link.best(H[:, None]))
    assert (solution.I_U >= found - 1e-6).all()  # the tolerance of either search


@pytest.mark.parametrize(
    "changes",
    [
        {"radio.line_of_sight": "all_ones"},
        {"flight.start_velocity": "free", "flight.bound_first_acceleration": False},
    ],
)
def test_it_is_never_below_algorithm_1(faint_plan: MakePlan, changes: dict[str, Any]) -> None:
    coarse = KNOWN | {"flight.time_step": 1} | changes
    ours = optimize(faint_plan(coarse))
    paper = optimize(faint_plan(coarse | {"optimizer.method": "algorithm1"}))
    assert ours.rates.R_avg >= paper.rates.R_avg - 1e-4


@pytest.mark.figures
def test_floor_and_ceiling_on_a_small_scenario(faint_plan: MakePlan) -> None:
    """0.64235 is what all of many random flights lead to: much more would be a mistake."""
    solution = optimize(faint_plan({"radio.fading": "none"}))
    assert solution.rates.R_avg == pytest.approx(0.64235, rel=1e-3)


@pytest.mark.parametrize(
    ("scheme", "fading"),
    [
        ("mmse", "realization"),
        ("waterfilling", "ergodic"),
    ],
)
def test_schemes_fly_their_own_route_and_stay_below_faao(
    faint_plan: MakePlan, scheme: str, fading: str
) -> None:
    changes = {"radio.fading": fading, "radio.fading_samples": 6}
    best = optimize(faint_plan(changes))
    other = optimize(faint_plan(changes | {"optimizer.precoder": scheme}))
    assert other.history[0] < other.rates.R_avg < best.rates.R_avg
    assert max(other.residuals().values()) < 1e-6


def test_ergodic_solutions_survive_saving(faint_plan: MakePlan, tmp_path: Any) -> None:
    solution = optimize(faint_plan({"radio.csi": "instantaneous", "radio.fading_samples": 3}))
    save_solution(solution, tmp_path / "r.npz")
    loaded = load_solution(tmp_path / "r.npz")
    assert loaded.rates == solution.rates
    assert loaded.starts == solution.starts
    assert max(loaded.residuals().values()) < 1e-6


@pytest.mark.parametrize(
    "changes",
    [
        {"radio.base_station.antennas": 3, "radio.ground_user.antennas": 1},
        {"radio.base_station.antennas": 3, "radio.relay.antennas": 3, **KNOWN},
        {"radio.base_station.antennas": 1, **KNOWN},
        {"radio.rician_factor": 0, "flight.start": [0, 0], "flight.end": [0, 0]},
        {"flight.duration": 1.5, "flight.end": [0.5, 49.5]},
        {"flight.duration": 8.5},  # hardly time to get there
        {"radio.base_station.power_dbm": -70, "radio.relay.power_dbm": -70},
        {"radio.base_station.power_dbm": 60, "radio.relay.power_dbm": -20},
        {"optimizer.starts": ["user"]},
        {"optimizer.max_iterations": 1},
    ],
)
def test_unusual_plans_are_solved(faint_plan: MakePlan, changes: dict[str, Any]) -> None:
    solution = optimize(faint_plan({"radio.fading_samples": 4} | changes))
    assert max(solution.residuals().values()) < 1e-6
    assert np.isfinite(solution.history).all()
    assert solution.rates.R_avg >= solution.history[0] - 1e-9


def test_hopeless_links_still_get_a_sensible_route(faint_plan: MakePlan) -> None:
    powers = {"radio.base_station.power_dbm": -55, "radio.relay.power_dbm": -55}
    solution = optimize(faint_plan(powers | {"flight.duration": 30}))
    assert solution.converged
    assert 1e-8 < solution.rates.R_avg < 1e-4
    assert solution.rates.R_avg > 1.02 * solution.history[0]


def test_saturated_links_get_a_short_route_at_once() -> None:
    plan = read_plan(MISSIONS / "paper.yaml")
    solution = optimize(plan.changed({"optimizer.method": "direct"}))
    assert solution.converged
    assert solution.rates.R_avg == pytest.approx(2, abs=1e-9)
    length = np.linalg.norm(np.diff(solution.w, axis=0), axis=1).sum()
    assert length == pytest.approx(np.hypot(350, 350), rel=1e-6)


def test_same_seed_same_bytes(faint_plan: MakePlan) -> None:
    first, again = optimize(faint_plan()), optimize(faint_plan())
    for name in ("w", "v", "a", "P_B", "P_U", "H_rB", "I_U", "history"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes()


def test_progress_is_told(faint_plan: MakePlan) -> None:
    told: list[Progress] = []
    solution = optimize(faint_plan(), observe=told.append)
    assert [p.iteration for p in told] == [0, 1, 2]
    assert [p.stage for p in told] == ["rates over the map", "the starts", "the best start"]
    assert 0 < told[-1].best_rate <= solution.rates.R_avg


def test_algorithm_1_refuses_what_it_cannot_do(faint_plan: MakePlan) -> None:
    with pytest.raises(PlanError, match=r"radio\.fading: ergodic is not for algorithm1"):
        optimize(faint_plan({"optimizer.method": "algorithm1"}))
    changes = KNOWN | {"optimizer.method": "algorithm1", "optimizer.inputs": "gaussian"}
    with pytest.raises(PlanError, match=r"optimizer\.inputs: gaussian is not for algorithm1"):
        optimize(faint_plan(changes))


def test_of_routes_with_equal_R_avg_the_one_that_delivers_most_is_taken() -> None:
    changes: dict[str, Any] = {"radio.causal": False, "flight.time_step": 1}
    changes["optimizer.starts"] = ["bs-user", "user-bs"]
    solution = optimize(read_plan(MISSIONS / "copter_relay.yaml").changed(changes))
    by_station, by_user = solution.starts["bs-user"], solution.starts["user-bs"]
    assert by_station == pytest.approx(by_user, abs=1e-6)
    mirrored = solution.relay(solution.I_G[::-1], solution.I_U[::-1])
    towards_user = solution.relay(solution.I_U[::-1], solution.I_G[::-1])
    assert solution.delivered_rate == pytest.approx(mirrored.rate, abs=1e-3)
    assert solution.delivered_rate > 1.1 * towards_user.rate
