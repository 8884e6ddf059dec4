"""Starts are rejected on a coarse copy of the flight, and never the one that would win."""

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan, edited

from faao_mav.faao.coarse import SLOTS, WORTH_IT, Blocks, rejected
from faao_mav.faao.design import design
from faao_mav.faao.direct import rate_field
from faao_mav.faao.interior import StageValues
from faao_mav.faao.optimize import optimize
from faao_mav.faao.problem import build_problem
from faao_mav.plan import Plan, parse_plan


def long_plan(power: int) -> Plan:
    """Return the paper's plan at T = 100 s: 500 slots, several local optima at low power."""
    powers = {f"radio.{name}.power_dbm": power for name in ("base_station", "relay")}
    text = (MISSIONS / "paper_active.yaml").read_text()
    return parse_plan(edited(text, powers | {"flight.duration": 100, "optimizer.method": "direct"}))


def test_a_block_has_the_mean_of_its_slots() -> None:
    rng = np.random.default_rng(0)
    slope = rng.normal(size=(2, 501, 2))

    def stage(w: np.ndarray) -> StageValues:
        value = np.einsum("jnc,nc->jn", slope, w)
        return StageValues(value, slope, np.zeros((2, 501, 2, 2)))

    w = rng.normal(size=(SLOTS, 2))
    found = Blocks(stage, 501, SLOTS)(w)
    held = w[np.rint(np.arange(501) * (SLOTS - 1) / 500).astype(int)]
    assert found.value.mean(axis=1) == pytest.approx(stage(held).value.mean(axis=1))
    shift = rng.normal(size=w.shape)
    moved = Blocks(stage, 501, SLOTS)(w + shift).value - found.value
    assert moved == pytest.approx(np.einsum("jnc,nc->jn", found.gradient, shift))


@pytest.mark.parametrize("power", [0, 10])
def test_what_is_rejected_would_not_have_won(power: int) -> None:
    plan = long_plan(power)
    solution = optimize(plan)
    names = plan.optimizer.starts
    assert tuple(solution.starts) == names
    alone = {
        name: optimize(parse_plan(edited(plan.text, {"optimizer.starts": [name]}))).rates.R_avg
        for name in names
    }
    assert solution.rates.R_avg == pytest.approx(max(alone.values()), abs=plan.optimizer.tolerance)
    problem = build_problem(plan)
    stations = {"bs": problem.bs_uav.station, "user": problem.uav_user.station}
    dropped = rejected(
        problem.kinematics,
        rate_field(problem, design(plan)),
        names,
        stations,
        tolerance=1e-3,
        max_iterations=50,
    )
    assert 0 < len(dropped) < len(names)
    assert all(solution.starts[name] <= value + 1e-12 for name, value in dropped.items())


def test_short_flights_keep_every_start(small_plan: MakePlan) -> None:
    plan = small_plan()
    problem = build_problem(plan)
    assert problem.kinematics.slots < WORTH_IT
    stations = {"bs": problem.bs_uav.station, "user": problem.uav_user.station}
    field = rate_field(problem, design(plan))
    names = plan.optimizer.starts
    kin = problem.kinematics
    assert rejected(kin, field, names, stations, tolerance=1e-3, max_iterations=9) == {}
