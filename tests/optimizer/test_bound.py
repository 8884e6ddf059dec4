"""What no flight can exceed: never below anything that can be flown, and not far above the best."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, MakePlan, changes_in
from hypothesis import given, settings
from hypothesis import strategies as st
from random_flights import random_flight, with_maps

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.kinematics import Kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import RateField, rate_field
from faao_mav.optimizer.search.axis_bound import AxisBound
from faao_mav.optimizer.search.best_rates import BestRates, best_at, best_rates
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.search.map_bound import MapBound, map_bound
from faao_mav.optimizer.search.sweep import Cells, cells_of, disc, largest_near
from faao_mav.plan import Plan, read_plan

KINDS = changes_in(MISSIONS.parent / "tests" / "data" / "bounded.yaml")
BY_THE_AXIS = [*KINDS][: [*KINDS].index("half duplex")]
FAINT = {
    "radio.fading": "realization",
    "radio.base_station.power_dbm": 0,
    "radio.relay.power_dbm": 0,
}


@dataclass(frozen=True)
class Bounded:
    """A problem, the cells of its bound by the axis, and its bounds in coarse cells."""

    plan: Plan
    kind: str

    @cached_property
    def problem(self) -> Problem:
        problem = build_problem(self.plan)
        return with_maps(problem, 0) if self.kind == "maps" else problem

    @cached_property
    def best(self) -> BestRates:
        return best_rates(self.problem)

    @cached_property
    def field(self) -> RateField:
        return rate_field(self.problem, design(self.plan))

    @cached_property
    def axis(self) -> AxisBound:
        return AxisBound(self.problem, self.best, 6, 4)

    @cached_property
    def bounds(self) -> list[float]:
        fenced = self.problem.free_area is not None
        found = [map_bound(self.problem, self.best, cells=2000 if fenced else 300)]
        return found + ([self.axis.bound([0.4, 0.5, 0.6])] if self.kind in BY_THE_AXIS else [])

    @cached_property
    def reached(self) -> float:
        """What the optimised flight reaches, which keeps its limits."""
        solution = optimize(self.plan)
        assert solution.converged
        assert solution.is_feasible(1e-6)
        airspeed = np.linalg.norm(solution.v - self.plan.wind, axis=1)
        assert airspeed.max() <= self.plan.max_airspeed * (1 + 1e-8)
        return self.value(solution.w)

    def value(self, w: Real) -> float:
        """What the best precoders make of the positions w (n, 2): the rate that is maximised."""
        rates = self.field.value(w.T)
        return objective(rates, self.problem.kinematics, self.problem.maximised_queue)


@pytest.fixture(scope="module")
def bounded(small_plan: MakePlan) -> Callable[[str], Bounded]:
    faint = {"radio.base_station.power_dbm": 3, "radio.fading": "none"}
    kinds = {kind: Bounded(small_plan(faint | changes), kind) for kind, changes in KINDS.items()}
    return kinds.__getitem__


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=20)
@given(seed=st.integers(0, 2**31))
def test_no_flight_is_above_the_bounds(
    bounded: Callable[[str], Bounded], kind: str, seed: int
) -> None:
    one = bounded(kind)
    flight, free = random_flight(one.problem.kinematics, seed), one.problem.free_area
    if free is None or free.clearance(flight.w) >= 0:
        assert one.value(flight.w) <= min(one.bounds)
    if kind not in ("fence", "maps"):
        assert one.reached <= min(one.bounds) <= 1.6 * one.reached


def test_a_zone_over_a_station_lowers_the_bound(bounded: Callable[[str], Bounded]) -> None:
    free = bounded("delivered")
    zone = {"fence.exclusion": [{"center": [0, 0], "radius": 30}]}
    fenced = build_problem(free.plan.changed(zone))
    found, most = (map_bound(each, free.best, cells=1000) for each in (fenced, free.problem))
    assert found < most - 1e-2


def test_instants_of_a_flight_may_be_few(
    bounded: Callable[[str], Bounded], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = bounded("free ends")
    for instants in (1, 2, 3):
        monkeypatch.setattr("faao_mav.optimizer.search.axis_bound.MOST_INSTANTS", instants)
        cells = AxisBound(one.problem, one.best, 6, 4)
        assert len(cells.t) == instants
        for seed in range(3):
            assert one.value(random_flight(one.problem.kinematics, seed).w) <= cells.bound([0.5])


@pytest.mark.parametrize("kind", ["R_avg", "free ends", "fast"])
@settings(max_examples=6)
@given(seed=st.integers(0, 2**31))
def test_every_step_of_a_flight_is_in_reach_along_the_axis(
    bounded: Callable[[str], Bounded], kind: str, seed: int
) -> None:
    cells, rng = bounded(kind).axis, np.random.default_rng(seed)
    kin = cells.problem.kinematics
    flight = random_flight(kin, seed)
    instants = cells.t
    n = np.minimum((instants / kin.time_step).astype(int), kin.slots - 2)
    tau = (instants - kin.time_step * n)[:, None]
    first, second = (link.gains.station for link in cells.problem.links)
    axis = (second - first) / np.hypot(*(second - first))
    x = (flight.w[n] + tau * flight.v[n] + tau**2 / 2 * flight.a[n] - first) @ axis
    v = (flight.v[n] + tau * flight.a[n]) @ axis
    rows = np.clip(np.rint((x - cells.x[0]) / cells.side), 0, len(cells.x) - 1).astype(int)
    columns = np.rint(v / cells.gap).astype(int) - int(cells.columns[0])
    for k in rng.permutation(len(instants) - 1)[:4]:
        for here, there, sign in ((k, k + 1, 1), (k + 1, k, -1)):
            values = np.full((1, len(cells.columns), len(cells.x)), -np.inf)
            values[0, columns[there], rows[there]] = 1.0
            assert cells.reached(values, sign)[0, columns[here], rows[here]] == 1.0
            worth = cells.rewards(here, np.array([0.5]), cells.across[None])
            assert worth[0, 0, columns[here], rows[here]] > -np.inf
    away = np.abs((flight.w - first) @ np.array([-axis[1], axis[0]]))
    for parts in cells.passed[1]:
        assert (parts <= away + 1e-6).all(axis=1).any()


def cells_about(kin: Kinematics) -> Cells:
    return cells_of(kin, np.array([[0.0, 0.0], [60.0, 60.0]]), 150, 2.5)


def test_a_step_over_the_map_reaches_every_cell_that_v_max_does(small_plan: MakePlan) -> None:
    kin = build_problem(small_plan()).kinematics
    cells = cells_about(kin)
    values = np.random.default_rng(0).random((2, *cells.x.shape[1:]))
    step = kin.max_speed * float(np.diff(cells.instants).max())
    flat = cells.x.reshape(2, -1)
    apart = np.maximum(0.0, np.abs(flat[:, :, None] - flat[:, None]) - cells.side)
    reached = np.hypot(*apart) <= step * (1 + 1e-12)
    best = np.where(reached, values.reshape(2, 1, -1), -np.inf).max(axis=-1)
    assert largest_near(values, disc(cells.step)).reshape(2, -1) == pytest.approx(best)


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
        for row, most in disc(sweep.step)
        for s in (1, -1)
        for column in range(-most, most + 1)
    }
    assert {tuple(step) for step in np.diff(cell, axis=0).tolist()} <= reached


@pytest.mark.parametrize("causal", [True, False])
def test_several_prices_part_flights_that_never_meet(small_plan: MakePlan, causal: bool) -> None:
    """What one flight takes in near one station another cannot forward near the other."""
    faint = {"radio.base_station.power_dbm": -20, "radio.relay.power_dbm": -20}
    changes = {"radio.causal": causal, "radio.fading": "none", "radio.gain": {"exponent": 3}}
    problem = build_problem(small_plan(faint | changes))
    cells = MapBound(problem, best_rates(problem), 2000)
    prices = np.linspace(0, 1, 21).tolist()
    assert cells.bound(prices) < 0.95 * min(cells.bound([price]) for price in prices)


@pytest.mark.usefixtures("coarse_map")
@pytest.mark.parametrize(
    ("changes", "exact"),
    [
        ({"radio.line_of_sight": "all_ones"}, True),
        ({"radio.fading": "ergodic", "radio.fading_samples": 4}, False),
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
    assert tightened.value <= 2 * problem.bs_uav.transmit


def test_samples_are_close_to_their_bounds() -> None:
    """The copter's by the map within three hundredths, the paper's by the axis in a thirtieth."""
    copter = read_plan(MISSIONS / "copter_relay.yaml")
    problem, reached = build_problem(copter), optimize(copter).delivered_rate
    assert reached < map_bound(problem, best_rates(problem), cells=15_000) < 1.03 * reached
    short = {"flight.duration": 20, "flight.time_step": 0.5, "optimizer.method": "direct"}
    paper = read_plan(MISSIONS / "paper_active.yaml").changed(short)
    problem, reached = build_problem(paper), optimize(paper).rates.R_avg
    cells = AxisBound(problem, best_rates(problem), 8, 4)
    assert reached < cells.bound([0.4, 0.45, 0.5, 0.55, 0.6]) < 1.03 * reached


def test_best_rates_are_those_of_the_channel_or_above(small_plan: MakePlan) -> None:
    alone = {"radio.base_station.antennas": 1, "radio.relay.antennas": 1}
    for changes in ({}, {"radio.line_of_sight": "all_ones"}, alone):
        problem = build_problem(small_plan(FAINT | changes))
        link = problem.uav_user
        w = link.gains.station + np.random.default_rng(0).uniform(-80, 80, (20, 2))
        values = best_at(problem, link, link.gains.log(w.T)[:, None])
        H = link.channel(w)
        true = link.draw_rates(H, link.best(H[:, None]))
        assert (values[:, 0] >= true - 1e-6).all()
        if "radio.line_of_sight" in changes:
            assert values[:, 0] == pytest.approx(true, abs=1e-6)
