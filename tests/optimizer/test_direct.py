"""The direct method, whole and rough, and plans too large for it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, MISSIONS, MakePlan, edited

from faao_mav import parse_plan
from faao_mav.errors import PlanError
from faao_mav.optimizer.design import design
from faao_mav.optimizer.direct import rough_flight
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates import table_rate
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.starts import ROUGH
from faao_mav.optimizer.solution import Progress, load_solution, save_solution
from faao_mav.plan import Plan, read_plan

KNOWN = {"radio.fading": "realization"}
FEW: dict[str, Any] = {"flight.time_step": 1, "optimizer.starts": ["straight"]}


POWERS = ("radio.base_station.power_dbm", "radio.relay.power_dbm")


@pytest.fixture(scope="module")
def faint_plan(small_plan: MakePlan) -> MakePlan:
    """The small plan with 10 dB less power: far from saturation even at the best precoders."""

    def make(changes: dict[str, Any] | None = None) -> Plan:
        return small_plan(dict.fromkeys(POWERS, 0) | {"radio.fading_samples": 4} | (changes or {}))

    return make


@pytest.mark.parametrize(
    "changes",
    [
        KNOWN | {"radio.modulation": "qpsk"},
        {"radio.line_of_sight": "all_ones", "radio.modulation": "qpsk"},
        {"radio.csi": "instantaneous"},
    ],
)
def test_a_solution_proves_itself(
    faint_plan: MakePlan, tmp_path: Path, changes: dict[str, Any]
) -> None:
    told: list[Progress] = []
    solution = optimize(faint_plan(changes), observe=told.append)
    assert [p.iteration for p in told] == [0, 1, 2]
    assert [p.stage for p in told] == ["rates over the map", "the starts", "the best start"]
    assert 0 < told[-1].best_rate <= solution.rates.R_avg
    assert solution.converged
    assert max(solution.residuals().values()) < 1e-6
    assert (np.diff(solution.history) >= 0).all()
    assert solution.history[-1] == solution.rates.R_avg
    assert solution.rates.R_avg > solution.history[0] + 0.02
    assert set(solution.starts) <= {"straight", "bs", "user", "bs-user", "user-bs"}
    draws = () if "radio.fading" in changes else (4,)
    assert solution.H_rB.shape == (*draws, 20, 2, 2)
    assert solution.P_B.shape == (*(draws if "radio.csi" in changes else ()), 20, 2, 2)
    if not draws:  # its precoders are as good as a search from all starts
        link = solution.problem.bs_uav
        H = link.channel(solution.w, solution.H_rB)
        found = link.draw_rates(H, link.best(H[:, None]))
        assert (solution.I_U >= found - 1e-6).all()  # the tolerance of either search
    save_solution(solution, tmp_path / "r.npz")
    loaded = load_solution(tmp_path / "r.npz")
    assert loaded.rates == solution.rates
    assert loaded.starts == solution.starts
    assert max(loaded.residuals().values()) < 1e-6


@pytest.mark.figures
def test_floor_and_ceiling_on_a_small_scenario(faint_plan: MakePlan) -> None:
    """0.64235 is what all of many random flights lead to: much more would be a mistake.

    A scheme's own route is better than straight, and below that.
    """
    none = {"radio.fading": "none"}
    solution, again = optimize(faint_plan(none)), optimize(faint_plan(none))
    assert solution.rates.R_avg == pytest.approx(0.64235, rel=1e-3)
    for name in ("w", "v", "a", "P_B", "P_U", "H_rB", "I_U", "history"):
        assert getattr(solution, name).tobytes() == getattr(again, name).tobytes()
    other = optimize(faint_plan(none | {"optimizer.precoder": "mmse"}))
    assert other.history[0] < other.rates.R_avg < solution.rates.R_avg


@pytest.mark.parametrize(
    "changes",
    [
        {"radio.base_station.antennas": 3, "radio.relay.antennas": 3, **KNOWN, **FEW},
        {"radio.base_station.antennas": 1, "flight.duration": 1.5, "flight.end": [0.5, 49.5]},
        {"radio.rician_factor": 0, "flight.start": [0, 0], "flight.end": [0, 0]},
        {POWERS[0]: 60, POWERS[1]: -70, "optimizer.max_iterations": 1},
    ],
)
def test_unusual_plans_are_solved(faint_plan: MakePlan, changes: dict[str, Any]) -> None:
    solution = optimize(faint_plan(changes))
    assert max(solution.residuals().values()) < 1e-6
    assert np.isfinite(solution.history).all()
    assert solution.rates.R_avg >= solution.history[0] - 1e-9


def test_hopeless_links_get_a_sensible_route(faint_plan: MakePlan) -> None:
    powers = dict.fromkeys(POWERS, -55)
    solution = optimize(faint_plan(powers | {"flight.duration": 30, "flight.time_step": 1}))
    assert solution.converged
    assert 1e-8 < solution.rates.R_avg < 1e-4
    assert solution.rates.R_avg > 1.02 * solution.history[0]


def test_saturated_links_get_a_short_route() -> None:
    plan = read_plan(MISSIONS / "paper.yaml")
    solution = optimize(plan.changed({"optimizer.method": "direct"}))
    assert solution.converged
    assert solution.rates.R_avg == pytest.approx(2, abs=1e-9)
    length = np.linalg.norm(np.diff(solution.w, axis=0), axis=1).sum()
    assert length == pytest.approx(np.hypot(350, 350), rel=1e-6)


def test_of_routes_with_equal_R_avg_the_one_that_delivers_most_is_taken() -> None:
    changes = {
        "radio.causal": False,
        "flight.time_step": 1,
        "radio.fading": "none",
        "optimizer.starts": ["bs-user", "user-bs"],
    }
    solution = optimize(read_plan(MISSIONS / "copter_relay.yaml").changed(changes))
    by_station, by_user = solution.starts["bs-user"], solution.starts["user-bs"]
    assert by_station == pytest.approx(by_user, abs=ROUGH)
    mirrored = solution.relay(solution.I_G[::-1], solution.I_U[::-1])
    towards_user = solution.relay(solution.I_U[::-1], solution.I_G[::-1])
    assert solution.delivered_rate == pytest.approx(mirrored.rate, abs=1e-3)
    assert solution.delivered_rate > 1.1 * towards_user.rate


def antennas(base: int, relay: int, user: int) -> dict[str, Any]:
    keys = ("base_station", "relay", "ground_user")
    return {f"radio.{key}.antennas": n for key, n in zip(keys, (base, relay, user), strict=True)}


def test_what_is_too_large_is_refused_by_the_cap_it_exceeds(small_plan: MakePlan) -> None:
    ergodic = {"radio.fading": "ergodic"}
    for changes, what in (
        ({"radio.modulation": "qpsk"} | antennas(7, 7, 7), "1.638e+04 vectors of symbols"),
        (antennas(64, 1, 1), "1.845e+19 vectors of symbols"),
        (ergodic | antennas(12, 12, 12), "terms in its sums"),
        (ergodic | {"radio.fading_samples": 10_000, "flight.duration": 2000}, "in its channels"),
    ):
        with pytest.raises(PlanError, match=r"modulation: .* antennas .* are accepted") as error:
            build_problem(small_plan(changes))
        assert what in str(error.value)
    build_problem(small_plan({"radio.modulation": "16qam"} | antennas(3, 3, 3)))
    build_problem(small_plan({"radio.modulation": "64qam"}))


BASE = edited(FLYABLE.replace("  causal: false\n", ""), {"flight.duration": 14})
FENCE = {"margin": 1, "exclusion": [{"center": [25, 25], "radius": 4}]}
FENCED = edited(BASE, {"flight.time_step": 1, "fence": FENCE})


def test_a_rough_flight_keeps_its_limits_and_comes_near_the_finished_one() -> None:
    cases = []
    for plan in map(parse_plan, (BASE, FENCED)):
        best = optimize(plan)
        cases += [(plan, None, best.delivered_rate), (plan, best.v, best.delivered_rate)]
    moved = parse_plan(edited(BASE, {"radio.ground_user.position": [80, 50]}))
    cases.append((moved, cases[1][1], optimize(moved).delivered_rate))
    for asked, near, finished in cases:
        problem, flight = build_problem(asked), rough_flight(asked, near)
        kin = problem.kinematics
        a = np.diff(flight.v, axis=0) / kin.time_step
        end = kin.start + kin.time_step * ((flight.v[:-1] + flight.v[1:]) / 2).sum(axis=0)
        assert np.hypot(*flight.v.T).max() <= kin.max_speed + 1e-6
        assert np.hypot(*a.T).max() <= kin.max_acceleration + 1e-6
        np.testing.assert_allclose(end, asked.flight.end, atol=1e-6)
        if asked.keep_in is not None:
            assert asked.keep_in.clearance(flight.w) >= 1 - 1e-6
        assert 0.9 * finished < flight.delivered_rate < finished + 1e-3
        assert list(flight.starts) == ["straight" if near is None else "known"]


def test_plans_with_other_stations_share_their_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    made, table = [], table_rate._made

    def counted(*args: Any) -> table_rate.Table:
        made.append(args)
        return table(*args)

    monkeypatch.setattr(table_rate, "_made", counted)
    monkeypatch.setattr(table_rate, "_tables", {})
    for east in (60, 61, 62):
        problem = build_problem(
            parse_plan(BASE).changed({"radio.ground_user.position": [east, 60]})
        )
        rate_field(problem, design(problem.plan))
    assert len(made) == 1  # both links have it
