"""Maps of gains in the optimiser: fields, bounds and flights."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan
from hypothesis import given, settings
from hypothesis import strategies as st
from random_flights import random_flight

from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.best_rates import best_rates
from faao_mav.optimizer.search.map_bound import map_bound, most_gain
from faao_mav.radio.gain_map import Grid

FAINT = {"radio.base_station.power_dbm": 3, "radio.fading": "none", "radio.causal": True}


def rough_grid(seed: int, cells: int = 12, low: float = -40.0, high: float = 110.0) -> Grid:
    """Return shadows of 20 dB that end within a cell."""
    rng = np.random.default_rng(seed)
    x, y = np.linspace(low, high, cells), np.linspace(low + 7, high - 3, cells + 3)
    return Grid(x, y, np.where(rng.random((cells, cells + 3)) < 0.4, -20.0, 0.0))


def with_maps(problem: Problem, *grids: Grid) -> Problem:
    """Return `problem` with `grids` above the laws of both hops."""
    first, second = (
        replace(link, gains=replace(link.gains, above=grid))
        for link, grid in zip(problem.links, grids, strict=True)
    )
    return replace(problem, bs_uav=first, uav_user=second)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), off=st.floats(0.5, 40.0))
def test_no_gain_within_a_disc_is_above_its_most(
    small_plan: MakePlan, seed: int, off: float
) -> None:
    field = with_maps(build_problem(small_plan(FAINT)), rough_grid(seed), rough_grid(seed)).links[0]
    rng = np.random.default_rng(seed)
    w = rng.uniform(-80, 160, (2, 5, 1))
    angle, share = rng.uniform(0, 2 * np.pi, (5, 300)), np.sqrt(rng.random((5, 300)))
    near = w + off * share * np.stack([np.cos(angle), np.sin(angle)])
    most = most_gain(field.gains, w, off)
    assert (field.gains.log(near) <= most + 1e-9).all()


@pytest.fixture(scope="module")
def mapped(small_plan: MakePlan) -> dict[str, tuple[Problem, float]]:
    kinds: dict[str, dict[str, Any]] = {
        "full": {},
        "half": {"radio.duplex": "half"},
        "known draws": {"radio.fading": "realization"},
    }
    found = {}
    for seed, (kind, changes) in enumerate(kinds.items()):
        plain = build_problem(small_plan(FAINT | changes))
        problem = with_maps(plain, rough_grid(seed), rough_grid(seed + 9))
        found[kind] = problem, map_bound(problem, best_rates(problem), cells=800)
    return found


@pytest.mark.parametrize("kind", ["full", "half", "known draws"])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_no_flight_over_maps_is_above_the_bound(
    mapped: dict[str, tuple[Problem, float]], kind: str, seed: int
) -> None:
    problem, bound = mapped[kind]
    flight = random_flight(problem.kinematics, seed)
    rates = rate_field(problem, design(problem.plan)).value(flight.w.T)
    assert objective(rates, problem.kinematics, problem.maximised_queue) <= bound
