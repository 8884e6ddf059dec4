"""The rough flight of the planner page: feasible, never better than the optimum, and near it."""

from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited

from faao_mav import parse_plan
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates import table_rate
from faao_mav.optimizer.rough import rough_flight

BASE = edited(FLYABLE.replace("  causal: false\n", ""), {"flight.duration": 14})
FENCED = BASE + "fence: {margin: 1, exclusion: [{center: [25, 25], radius: 4}]}\n"


@pytest.mark.parametrize("text", [BASE, FENCED])
def test_a_rough_flight_keeps_its_limits_and_comes_near_the_finished_one(text: str) -> None:
    plan = parse_plan(text)
    best = optimize(plan)
    moved = parse_plan(edited(text, {"radio.ground_user.position": [80, 50]}))
    for asked, near, finished in (
        (plan, None, best.delivered_rate),
        (plan, best.v, best.delivered_rate),
        (moved, best.v, optimize(moved).delivered_rate),
    ):
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


def test_plans_with_other_stations_share_their_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    table = table_rate._made

    def counted(*args: Any) -> table_rate.Table:
        made.append(args)
        return table(*args)

    monkeypatch.setattr(table_rate, "_made", counted)
    table_rate._tables.clear()
    for east in (60, 61, 62):
        rough_flight(parse_plan(edited(BASE, {"radio.ground_user.position": [east, 60]})))
    assert len(made) == 1  # both links have it
    rough_flight(parse_plan(edited(BASE, {"radio.relay.power_dbm": 30})))
    assert len(made) == 2
