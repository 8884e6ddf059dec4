"""Starts are compared on a coarse copy of the flight, and the one that would win is kept."""

from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan, edited

from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import LocalOptimum
from faao_mav.optimizer.interior.rewards import StageValues
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search import multistart
from faao_mav.optimizer.search.multistart import (
    COARSE_SLOTS,
    block_stage,
    improve_starts,
)
from faao_mav.optimizer.search.starts import starts
from faao_mav.plan import Plan, parse_plan

NAMED = ["straight", "bs", "user", "bs-user", "user-bs"]


def long_plan(power: int, starts: list[str]) -> Plan:
    """Return the paper's plan at T = 100 s: 500 slots, several local optima at low power."""
    changes: dict[str, Any] = {
        f"radio.{name}.power_dbm": power for name in ("base_station", "relay")
    }
    changes["optimizer.starts"] = starts
    text = (MISSIONS / "paper_active.yaml").read_text()
    return parse_plan(
        edited(text, changes | {"flight.duration": 100, "optimizer.method": "direct"})
    )


def starts_of(problem: Problem) -> dict[str, Trajectory]:
    """Return the flights that the plan starts from."""
    stations = {"bs": problem.bs_uav.gains.station, "user": problem.uav_user.gains.station}
    return starts(problem.kinematics, problem.plan.optimizer.starts, stations)


def test_a_block_has_the_mean_of_its_slots() -> None:
    rng = np.random.default_rng(0)
    slope = rng.normal(size=(2, 2, 501))

    def stage(w: np.ndarray) -> StageValues:
        value = np.einsum("cjn,cn->jn", slope, w)
        return StageValues(value, slope, np.zeros((3, 2, 501)))

    w = rng.normal(size=(2, COARSE_SLOTS))
    found = block_stage(stage, 501, COARSE_SLOTS)(w)
    held = w[:, np.rint(np.arange(501) * (COARSE_SLOTS - 1) / 500).astype(int)]
    assert found.value.mean(axis=1) == pytest.approx(stage(held).value.mean(axis=1))
    shift = rng.normal(size=w.shape)
    moved = block_stage(stage, 501, COARSE_SLOTS)(w + shift).value - found.value
    assert moved == pytest.approx(np.einsum("cjn,cn->jn", found.gradient, shift))


@pytest.mark.parametrize("power", [0, pytest.param(10, marks=pytest.mark.slow)])
def test_what_is_rejected_would_not_have_won(power: int) -> None:
    plan = long_plan(power, NAMED)
    solution = optimize(plan)
    names = plan.optimizer.starts
    assert tuple(solution.starts) == names
    alone = {
        name: optimize(parse_plan(edited(plan.text, {"optimizer.starts": [name]}))).rates.R_avg
        for name in names
    }
    assert solution.rates.R_avg == pytest.approx(max(alone.values()), abs=plan.optimizer.tolerance)
    problem = build_problem(plan)
    routes = starts_of(problem)
    improved, promising = improve_starts(problem, rate_field(problem, design(plan)), routes, 50)
    assert 0 < len(promising) < len(names)
    dropped = set(names) - set(promising)
    assert all(solution.starts[name] <= solution.rates.R_avg for name in dropped)
    for flight in improved.values():
        assert max(problem.kinematics.residuals(flight).values()) < 1e-7


def test_of_equal_starts_the_first_is_promising_whatever_rounding_says(
    small_plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = build_problem(small_plan())
    flight = next(iter(starts_of(problem).values()))

    values = iter((0.5, 0.5 + 1e-15))

    def end(*_: object, **__: object) -> LocalOptimum:
        return LocalOptimum(flight, next(values), 1, 0.0, True)

    monkeypatch.setattr(multistart, "maximize", end)
    flights, field = {"bs": flight, "user": flight}, rate_field(problem, design(problem.plan))
    _, promising = improve_starts(problem, field, flights, 1)
    assert promising == ["bs"]
