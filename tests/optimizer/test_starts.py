"""Flights to start from by way of the stations, and which of them would win."""

from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan
from test_interior import copter

from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import LocalOptimum
from faao_mav.optimizer.interior.rewards import StageValues
from faao_mav.optimizer.kinematics import Kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search import starts as module
from faao_mav.optimizer.search.starts import COARSE_SLOTS, block_stage, improve_starts, starts
from faao_mav.plan import read_plan

STATIONS = {"bs": np.array([0.0, 0.0]), "user": np.array([300.0, 300.0])}
NAMES = ["straight", "bs", "user", "bs-user", "user-bs"]


def kin(seconds: float, **changes: Any) -> Kinematics:
    return copter(seconds, time_step=0.5, **changes)


@pytest.mark.parametrize("free", [{}, {"start_velocity": None, "end_velocity": None}])
def test_every_start_can_be_flown(free: dict[str, None]) -> None:
    for seconds in (68.0, 75.0, 300.0):
        k = kin(seconds, **free)
        found = starts(k, NAMES, STATIONS)
        assert "straight" in found
        for flight in found.values():
            assert max(k.residuals(flight).values()) < 1e-9


def test_with_time_the_stations_are_visited_in_order_and_hovered_at() -> None:
    found = starts(kin(300), NAMES, STATIONS)
    assert list(found) == NAMES
    at = {
        name: [np.linalg.norm(found[name].w - p, axis=1).argmin() for p in STATIONS.values()]
        for name in ("bs-user", "user-bs")
    }
    assert at["bs-user"][0] < at["bs-user"][1]
    assert at["user-bs"][0] > at["user-bs"][1]
    for p in STATIONS.values():
        near = np.linalg.norm(found["bs-user"].w - p, axis=1) < 1e-6
        assert near.sum() > 20


def test_with_less_time_it_goes_as_far_as_it_can() -> None:
    shares = []
    for seconds in (75.0, 80.0, 90.0, 120.0):  # a stop on the way alone takes 5 s
        flight = starts(kin(seconds), ["bs"], STATIONS)["bs"]
        shares.append(np.linalg.norm(flight.w - STATIONS["bs"], axis=1).min())
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 100
    assert shares[-1] < 1e-6


def test_what_cannot_be_had_is_left_out() -> None:
    assert list(starts(kin(68.0), ["bs", "user"], STATIONS)) == ["straight"]
    across = kin(300, start_velocity=np.array([1.0, 1.0]))
    assert list(starts(across, ["bs"], STATIONS)) == ["straight"]


def test_a_block_has_the_mean_of_its_slots() -> None:
    rng = np.random.default_rng(0)
    slope = rng.normal(size=(2, 2, 501))

    def stage(w: np.ndarray) -> StageValues:
        value = np.einsum("cjn,cn->jn", slope, w)
        return StageValues(value, slope, np.zeros((3, 2, 501)))

    w, shift = rng.normal(size=(2, 2, COARSE_SLOTS))
    blocks = block_stage(stage, 501, COARSE_SLOTS)
    found = blocks(w)
    held = w[:, np.rint(np.arange(501) * (COARSE_SLOTS - 1) / 500).astype(int)]
    assert found.value.mean(axis=1) == pytest.approx(stage(held).value.mean(axis=1))
    moved = blocks(w + shift).value - found.value
    assert moved == pytest.approx(np.einsum("cjn,cn->jn", found.gradient, shift))


def test_what_is_rejected_would_not_have_won() -> None:
    """The paper's plan at T = 80 s and 0 dBm, 400 slots: it has several local optima."""
    powers = {f"radio.{name}.power_dbm": 0 for name in ("base_station", "relay")}
    changes = powers | {"flight.duration": 80, "optimizer.method": "direct"}
    plan = read_plan(MISSIONS / "paper_active.yaml").changed(changes)
    solution = optimize(plan)
    assert list(solution.starts) == NAMES
    alone = [optimize(plan.changed({"optimizer.starts": [name]})).rates.R_avg for name in NAMES]
    assert solution.rates.R_avg == pytest.approx(max(alone), abs=plan.optimizer.tolerance)
    problem = build_problem(plan)
    routes = starts(problem.kinematics, NAMES, STATIONS)
    improved, promising = improve_starts(problem, rate_field(problem, design(plan)), routes, 50)
    assert 0 < len(promising) < len(NAMES)
    assert all(value <= solution.rates.R_avg for value in solution.starts.values())
    for flight in improved.values():
        assert max(problem.kinematics.residuals(flight).values()) < 1e-7


def test_of_equal_starts_the_first_is_promising_whatever_rounding_says(
    small_plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = build_problem(small_plan())
    (flight,) = starts(problem.kinematics, ["straight"], {}).values()
    values = iter((0.5, 0.5 + 1e-15))

    def end(*_: object, **__: object) -> LocalOptimum:
        return LocalOptimum(flight, next(values), 1, 0.0, True)

    monkeypatch.setattr(module, "maximize", end)
    flights, field = {"bs": flight, "user": flight}, rate_field(problem, design(problem.plan))
    assert improve_starts(problem, field, flights, 1)[1] == ["bs"]
