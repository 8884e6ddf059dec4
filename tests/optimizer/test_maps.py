"""Maps of gains in the optimiser: fields, bounds, flights, and ground."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import SMALL, MakePlan, edited
from hypothesis import given, settings
from hypothesis import strategies as st
from random_flights import random_flight, with_maps

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.errors import PlanError
from faao_mav.mission.fence_area import FreeArea
from faao_mav.optimizer.design import design
from faao_mav.optimizer.direct import direct, rough_flight
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.interior.rewards import Stage
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import Blurred, rate_field
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.search.map_bound import most_gain
from faao_mav.optimizer.search.over_map import QueueSweep
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.search.sweep import cells_of, largest_ahead
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.model import ground_areas, in_ground
from faao_mav.radio.gain import GainField
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.map_file import map_archive
from faao_mav.radio.relay import RelayQueue
from faao_mav.validate.comparison import compare_with_plan

FAINT = {"radio.base_station.power_dbm": 3, "radio.fading": "none", "radio.causal": True}


@settings(max_examples=15)
@given(seed=st.integers(0, 2**31), off=st.floats(0.5, 40.0))
def test_no_gain_within_a_disc_is_above_its_most(
    small_plan: MakePlan, seed: int, off: float
) -> None:
    field = with_maps(build_problem(small_plan(FAINT)), seed).bs_uav
    rng = np.random.default_rng(seed)
    axes: list[Real] = [rng.uniform(-80, 160) + rng.uniform(0.2, 20) * np.arange(3.0)] * 2
    angle, share = rng.uniform(0, 2 * np.pi, (9, 300)), np.sqrt(rng.random((9, 300)))
    w = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(2, 9, 1)
    near = w + off * share * np.stack([np.cos(angle), np.sin(angle)])
    most = most_gain(field.gains, axes, off).reshape(9, 1)
    assert (field.gains.log(near) <= most + 1e-9).all()


@settings(max_examples=8)
@given(seed=st.integers(0, 2**31), blurred=st.booleans())
def test_slopes_over_a_map_are_those_of_differences(
    small_plan: MakePlan, seed: int, blurred: bool
) -> None:
    problem = with_maps(build_problem(small_plan(FAINT)), seed)
    smooth: Stage = rate_field(problem, design(problem.plan)).over(GainField.smoothed)
    stage = Blurred(smooth, 4.0) if blurred else smooth
    w = np.random.default_rng(seed).uniform(-30, 90, (2, 6))
    at, h = stage(w), 0.01
    for axis in (0, 1):
        step = h * np.eye(2)[axis][:, None]
        up, down = stage(w + step), stage(w - step)
        slope = (up.value - down.value) / (2 * h)
        np.testing.assert_allclose(at.gradient[axis], slope, atol=2e-4)
        bent = (up.gradient - down.gradient) / (2 * h)
        np.testing.assert_allclose(at.hessian[axis : axis + 2], bent, atol=2e-4)


@pytest.mark.parametrize("kind", ["queue", "half", "R_avg"])
def test_a_sweep_is_the_best_of_all_paths(small_plan: MakePlan, kind: str) -> None:
    kin = build_problem(small_plan({"flight.duration": 9})).kinematics
    cells = cells_of(kin, np.array([[0.0, 0.0], [60.0, 60.0]]), 12, 1.0)
    relay = None if kind == "R_avg" else RelayQueue(half=kind == "half")
    rng = np.random.default_rng(3)
    count, flat = len(cells.instants), cells.x.reshape(2, -1)
    rates = rng.uniform(0, 4, (2, count, *cells.x.shape[1:])) * rng.integers(
        0, 2, (2, count, *cells.x.shape[1:])
    )
    inside = np.ones(cells.x.shape[1:], dtype=np.bool_)
    sweep = QueueSweep(cells, rates, 400, relay, kin.time_step, inside, 1.5)

    def worth(places: list[int]) -> float:
        I_U, I_G = rates.reshape(2, count, -1)[:, range(count), places]
        return delivered(I_U, I_G, kind)

    paths = [[k] for k in np.flatnonzero(cells.alive[0].ravel()).tolist()]
    for k in range(1, count):
        alive = np.flatnonzero(cells.alive[k].ravel()).tolist()
        paths = [
            [*path, other]
            for path in paths
            for other in alive
            if np.hypot(*(flat[:, other] - flat[:, path[-1]])) <= 1.5 * cells.side
        ]
    found = sweep.path()
    path = [int(np.hypot(*(flat - place[:, None])).argmin()) for place in found]
    assert path in paths
    assert worth(path) == pytest.approx(max(map(worth, paths)), abs=0.05)


def test_steps_lead_around_a_wall_that_is_thinner_than_they_are_long() -> None:
    inside = np.ones((9, 12), dtype=np.bool_)
    inside[:8, 5] = False
    for row, column in np.argwhere(inside).tolist():
        start = np.zeros(inside.shape)
        start[row, column] = 1.0
        reached = largest_ahead(start, inside, 4.4) > 0
        for i, j in np.ndindex(inside.shape):
            way = np.hypot(i - row, j - column)
            if inside[i, j] and (j - 5) * (column - 5) > 0:
                assert reached[i, j] if way <= 4 else way < 4.5 or not reached[i, j]
            elif reached[i, j]:
                assert inside[i, j]
                assert np.hypot(8 - row, 5 - column) + np.hypot(8 - i, 5 - j) < 4.9


def delivered(I_U: Real, I_G: Real, kind: str) -> float:
    """What a relay makes of rates, where what comes in a step can leave in it."""
    if kind == "R_avg":
        return float(min(I_U.sum(), I_G.sum()))
    levels = {0.0: 0.0}
    for come, gone in zip(I_U, I_G, strict=True):
        after: dict[float, float] = {}
        for level, sent in levels.items():
            for share in (0.0, 0.5, 1.0) if kind == "half" else (None,):
                a, b = (come, gone) if share is None else (share * come, (1 - share) * gone)
                out = min(level + a, b)
                left = round(level + a - out, 6)
                after[left] = max(after.get(left, 0.0), sent + out)
        levels = after
    return max(levels.values())


@pytest.mark.usefixtures("coarse_map")
@pytest.mark.parametrize("changes", [{"radio.duplex": "half"}, {"radio.causal": False}])
def test_a_flight_over_maps_is_told_by_the_maps_as_they_are(
    small_plan: MakePlan, changes: dict[str, Any]
) -> None:
    """It is no worse than its starts, than the flight that knows no map, and than 60 others."""
    short = {"flight.duration": 18, "flight.time_step": 1}
    plain = build_problem(small_plan(FAINT | short | changes))
    problem = with_maps(plain, 4)
    field, found = rate_field(problem, design(problem.plan)), direct(problem)

    def value(w: Real) -> float:
        return objective(field.value(w.T), problem.kinematics, problem.maximised_queue)

    reached = found.delivered_rate if problem.maximised_queue else found.rates.R_avg
    assert reached == pytest.approx(value(found.w), abs=1e-4)
    assert found.is_feasible(1e-6)
    assert {name.split(" ")[0] for name in found.starts} == {"map"}
    assert reached >= max(found.starts.values()) - 1e-6
    assert reached > 1.2 * value(direct(plain).w)
    others = [random_flight(problem.kinematics, seed).w for seed in range(60)]
    assert reached > max(map(value, others))
    assert reached <= upper_bound(problem, reached).value


GROUND = {
    "flight.start": [0, 80],
    "flight.end": [80, 0],
    "flight.altitude": 40,
    "flight.duration": 30,
    "flight.time_step": 1.5,
    "mission.path_tolerance": 2,
}


@pytest.fixture(scope="module")
def grounded(tmp_path_factory: pytest.TempPathFactory) -> Callable[[dict[str, Any]], Plan]:
    """The small plan with a ridge of 60 m across its way, which has a gap off the line."""
    folder = tmp_path_factory.mktemp("ground")
    side = np.linspace(-60.0, 140.0, 51)
    x, y = side[None, :], side[:, None]
    ridge = (np.abs(x - y) < 9) & (np.abs(x + y - 160) > 20) & (np.abs(x + y - 80) < 140)
    ground = np.where(ridge, 60.0, 0.0)
    found = GainMap(side, side, np.array([40.0]), np.zeros((1, 51, 51)), True, ground)
    (folder / "map.npz").write_bytes(map_archive(found))

    def make(changes: dict[str, Any]) -> Plan:
        text = edited(SMALL, FAINT | GROUND | {"radio.gain": {"map": "map.npz"}} | changes)
        return parse_plan(text, str(folder / "plan.yaml"))

    return make


def test_no_flight_goes_through_ground(
    grounded: Callable[[dict[str, Any]], Plan], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("faao_mav.optimizer.search.over_map.CELLS", (1_000,))
    plan = grounded({})
    found = optimize(plan)
    between = np.linspace(0, 1, 20)[:, None] * np.diff(found.w, axis=0)[:, None]
    assert not in_ground(plan.maps, 40.0, (found.w[:-1, None] + between).reshape(-1, 2)).any()
    clearance = found.clearance()
    assert clearance is not None
    assert clearance >= plan.margin - 1e-6
    straight = straight_flight(found.problem.kinematics)
    assert in_ground(plan.maps, 40.0, straight.w).any()
    rough = rough_flight(plan)
    assert not in_ground(plan.maps, 40.0, rough.w).any()

    def told(w: Real) -> str:
        """What is told of a predicted flight through these places."""
        position = np.column_stack([w, np.full(len(w), 40.0)])
        item, frame = np.zeros(len(w), dtype=int), plan.origin.frame
        track = Track(found.t, position, 0 * position, item, np.zeros(1), frame)
        return compare_with_plan(found, track)[0].off_map

    assert told(found.w) == ""
    assert told(straight.w).startswith("in the ground under the map of the gain at [")
    with pytest.raises(PlanError, match=r"flight\.start: \[40\.0, 40\.0\] is .* the ground under"):
        grounded({"flight.start": [40, 40]})
    with pytest.raises(PlanError, match=r"mission\.path_tolerance"):
        grounded({"flight.start": [40, 53.2]})
    assert grounded({"flight.start": [40, 40], "flight.altitude": 70}).keep_in is None


@settings(max_examples=10)
@given(seed=st.integers(0, 2**31), share=st.floats(0.001, 0.3), points=st.integers(10, 80))
def test_areas_of_ground_cover_all_that_is_barred(seed: int, share: float, points: int) -> None:
    rng = np.random.default_rng(seed)
    side = np.linspace(0.0, 10.0 * (points - 1), points)
    ground = np.where(rng.random((points, points)) < share, 100.0, 0.0)
    ground[:3, :3] = 0.0
    known = GainMap(side, side, np.array([50.0]), np.zeros((1, points, points)), True, ground)
    areas = ground_areas((known,), 50.0, ((5.0, 5.0),))
    free = FreeArea.of(areas, any_inclusion=False)
    y, x = np.nonzero(ground)
    corners = np.array([[-4.9, -4.9], [4.9, -4.9], [4.9, 4.9], [-4.9, 4.9]])
    inside = (10.0 * np.stack([x, y], axis=1)[:, None] + corners).reshape(-1, 2)
    assert not free.covers(inside).any()
    assert free.covers(np.array([[5.0, 5.0]])).all()
