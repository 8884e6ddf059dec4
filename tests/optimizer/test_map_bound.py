"""Dynamic programming over the map: against all pairs of cells, and against flights."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan, edited
from hypothesis import given, settings
from hypothesis import strategies as st
from random_flights import random_flight

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.kinematics import Kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import RateField, rate_field
from faao_mav.optimizer.search.best_rates import BestRates, best_rates
from faao_mav.optimizer.search.map_bound import MapBound, map_bound
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.search.sweep import Cells, cells_of, largest_near
from faao_mav.plan import parse_plan

WALL = {
    "fence.margin": 3,
    "fence.exclusion": [{"polygon": [[13, 12], [42, 12], [42, 56], [13, 56]]}],
}
KINDS: dict[str, dict[str, Any]] = {
    "R_avg": {},
    "delivered": {"radio.causal": True},
    "half duplex": {"radio.causal": True, "radio.duplex": "half"},
    "unknown fading": {"radio.fading": "ergodic", "radio.fading_samples": 3},
    "known draws": {"radio.fading": "realization", "radio.causal": True},
    "buffer": {
        "radio.causal": True, "radio.bandwidth_mhz": 1, "radio.relay.buffer_mbytes": 0.2,
    },
    "free ends": {
        "flight.start_velocity": "free",
        "flight.end_velocity": "free",
        "flight.bound_first_acceleration": False,
    },
    "fence": WALL | {"radio.causal": True},
    "moving": {
        "radio.causal": True, "radio.duplex": "half",
        "radio.base_station.velocity": [4, -3], "radio.ground_user.velocity": [-6, 2],
    },
}  # fmt: skip


def cells_about(kin: Kinematics) -> Cells:
    return cells_of(kin, np.array([[0.0, 0.0], [60.0, 60.0]]), 150, 2.5)


def test_a_step_reaches_every_cell_that_v_max_does(small_plan: MakePlan) -> None:
    kin = build_problem(small_plan()).kinematics
    cells = cells_about(kin)
    values = np.random.default_rng(0).random((2, *cells.x.shape[1:]))
    step = kin.max_speed * float(np.diff(cells.instants).max())
    flat = cells.x.reshape(2, -1)
    apart = np.maximum(0.0, np.abs(flat[:, :, None] - flat[:, None]) - cells.side)
    reached = np.hypot(*apart) <= step * (1 + 1e-12)
    best = np.where(reached, values.reshape(2, 1, -1), -np.inf).max(axis=-1)
    assert largest_near(values, cells.rows).reshape(2, -1) == pytest.approx(best)


@pytest.mark.parametrize("causal", [True, False])
def test_several_prices_part_flights_that_never_meet(small_plan: MakePlan, causal: bool) -> None:
    """What one flight takes in near one station another cannot forward near the other."""
    faint = {"radio.base_station.power_dbm": -20, "radio.relay.power_dbm": -20}
    changes = {"radio.causal": causal, "radio.fading": "none", "radio.gain": {"exponent": 3}}
    problem = build_problem(small_plan(faint | changes))
    cells = MapBound.over(problem, best_rates(problem), 2000, 6.0)
    prices = np.linspace(0, 1, 21).tolist()
    assert cells.bound(prices) < 0.95 * min(cells.bound([price]) for price in prices)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_an_outward_map_misses_no_flight(small_plan: MakePlan, seed: int) -> None:
    kin = build_problem(small_plan(KINDS["free ends"] if seed % 2 else {})).kinematics
    sweep = cells_about(kin)
    flight = random_flight(kin, seed)
    t = kin.time_step * np.arange(kin.slots)
    n = np.minimum((sweep.instants / kin.time_step).astype(int), kin.slots - 2)
    tau = (sweep.instants - t[n])[:, None]
    w = flight.w[n] + tau * flight.v[n] + tau**2 / 2 * flight.a[n]
    low, high = sweep.x[:, 0, 0], sweep.x[:, -1, -1]
    cell = np.rint((np.clip(w, low, high) - low) / sweep.side).astype(int)
    assert sweep.alive[np.arange(len(cell)), *cell.T].all()
    reached = {
        (s * row, column)
        for row, most in sweep.rows
        for s in (1, -1)
        for column in range(-most, most + 1)
    }
    assert {tuple(step) for step in np.diff(cell, axis=0).tolist()} <= reached


@dataclass(frozen=True)
class Bounded:
    """A problem, its rates, those of the bound by the gain, and its bound on a coarse map."""

    problem: Problem
    field: RateField
    best: BestRates
    bound: float

    def value(self, w: Real) -> float:
        """What the best precoders make of the positions w (n, 2): the rate that is maximised."""
        rates = self.field.value(w.T)
        return objective(rates, self.problem.kinematics, self.problem.maximised_queue)


@pytest.fixture(scope="module")
def bounded(small_plan: MakePlan) -> dict[str, Bounded]:
    found = {}
    for kind, changes in KINDS.items():
        faint = {"radio.base_station.power_dbm": 3, "radio.fading": "none"}
        problem = build_problem(small_plan(faint | changes))
        best = best_rates(problem)
        field = rate_field(problem, design(problem.plan))
        found[kind] = Bounded(
            problem,
            field,
            best,
            map_bound(problem, best, cells=2000 if kind == "fence" else 300),
        )
    return found


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25)
@given(seed=st.integers(0, 2**31))
def test_no_flight_is_above_the_map_s_bound(
    bounded: dict[str, Bounded], kind: str, seed: int
) -> None:
    one = bounded[kind]
    flight, free = random_flight(one.problem.kinematics, seed), one.problem.free_area
    if free is None or free.clearance(flight.w) >= 0:
        assert one.value(flight.w) <= one.bound


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "fence"])
def test_no_optimised_flight_is_above_the_map_s_bound(
    bounded: dict[str, Bounded], kind: str
) -> None:
    one = bounded[kind]
    for starts in (["straight"], ["user-bs"]):
        plan = parse_plan(edited(one.problem.plan.text, {"optimizer.starts": starts}))
        reached = one.value(optimize(plan).w)
        assert reached <= one.bound <= 1.6 * reached


@pytest.mark.parametrize("kind", ["delivered", "half duplex"])
@settings(max_examples=20)
@given(price=st.floats(0, 1))
def test_every_price_bounds_what_is_delivered(
    bounded: dict[str, Bounded], kind: str, price: float
) -> None:
    one = bounded[kind]
    straight = straight_flight(one.problem.kinematics)
    found = MapBound.over(one.problem, one.best, 200, 5.0).bound([price])
    assert found >= one.value(straight.w)


def test_a_wall_lowers_the_bound(bounded: dict[str, Bounded]) -> None:
    assert bounded["fence"].bound < bounded["delivered"].bound - 1e-3


def test_the_copter_s_plan_is_within_three_hundredths_of_the_bound() -> None:
    plan = parse_plan((MISSIONS / "copter_relay.yaml").read_text())
    problem, reached = build_problem(plan), optimize(plan).delivered_rate
    assert reached < map_bound(problem, best_rates(problem), cells=15_000) < 1.03 * reached
