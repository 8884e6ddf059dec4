"""Flights inside a fence: shapely says how far the continuous path stays from the edge."""

from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
import shapely
from conftest import MakePlan
from fenced import dense_path, fenced
from hypothesis import given

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.fence_geometry import ConvexObstacles, FenceGeometry
from faao_mav.optimizer.interior.limits import fence_constraints
from faao_mav.optimizer.kinematics import LENGTH, Kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.starts import starts
from faao_mav.optimizer.solution import Solution, load_solution, save_solution

places = st.tuples(*[st.floats(-100, 100, allow_subnormal=False)] * 2)
outlines = (
    st.lists(places, min_size=3, max_size=9)
    .map(lambda points: shapely.MultiPoint(points).convex_hull)
    .filter(lambda hull: hull.geom_type == "Polygon" and hull.area >= 1)
)


def clearance(solution: Solution) -> float:
    """The least distance of the path from the edge, by shapely, at 20 points a slot."""
    area = solution.plan.keep_in
    assert area is not None
    step = solution.plan.flight.time_step
    return area.clearance(dense_path(solution.w, solution.v, solution.a, step))


@given(outline=outlines, radius=st.floats(0, 50), a=places, b=places)
def test_separation_is_the_distance_of_shapely(
    outline: shapely.Polygon, radius: float, a: tuple[float, float], b: tuple[float, float]
) -> None:
    corners = shapely.get_coordinates(shapely.orient_polygons(outline))[:-1]
    obstacles = ConvexObstacles.of([(corners, radius)])
    u, h = obstacles.separation(np.array([a]).T, np.array([b]).T)
    apart = min(float(u[:, 0, 0] @ end) for end in (a, b)) - float(h[0, 0])
    distance = outline.distance(shapely.LineString([a, b])) - radius
    assert np.hypot(*u[:, 0, 0]) == pytest.approx(1)
    if distance <= -radius:
        assert apart <= distance + 1e-9
    else:
        assert apart == pytest.approx(distance, abs=1e-9)


@given(outline=outlines, way=st.lists(places, min_size=4, max_size=8), speed=st.floats(1, 50))
def test_clearance_is_that_of_the_continuous_path(
    outline: shapely.Polygon, way: list[tuple[float, float]], speed: float
) -> None:
    """A parabola from sample to sample, however large the steps."""
    n = len(way)
    kin = Kinematics(np.array(way[0]), np.array(way[-1]), n, 1.0, speed, speed, None, None, True)
    flight = kin.follow(np.array(way) * 0.3)
    corners = shapely.get_coordinates(shapely.orient_polygons(outline))[:-1]
    east, obstacles = np.array([[1.0, 0.0]]), ConvexObstacles.of([(corners, 0.0)])
    fence = FenceGeometry(obstacles, east, np.array([20.0]), 5.0)
    path = dense_path(flight.w, flight.v, flight.a, 1.0, 200)
    told = fence.clearance(flight, 1.0)
    true = min(shapely.LineString(path).distance(outline), 20 - path[:, 0].max())
    assert told <= true + 1e-6
    if true == 0:
        assert told <= 0
    for constraint in fence_constraints(fence, kin):
        assert LENGTH * constraint.excess(kin, flight) == pytest.approx(max(0, 5 - told))


QUICK = {
    "flight.time_step": 2.5,
    "radio.fading": "none",
    "optimizer.starts": ["straight"],
    "optimizer.max_iterations": 20,
}


@pytest.mark.parametrize(
    "name", ["a gap 15 m wide", "inclusion with a bay", "zones that touch", "forty random polygons"]
)
def test_the_whole_path_keeps_the_margin(name: str) -> None:
    few = {"optimizer.max_iterations": 2} if name.startswith("forty") else {}
    plan = fenced(name, **(QUICK | few))
    solution = optimize(plan)
    assert clearance(solution) >= plan.margin - 1e-6
    assert solution.is_feasible()
    assert plan.margin - 1e-6 <= (solution.clearance() or 0) <= clearance(solution) + 1e-6


def test_a_fenced_solution_is_the_best_known_and_kept(tmp_path: Path) -> None:
    changes = {"flight.time_step": 3.0, "optimizer.max_iterations": 50}
    solution = optimize(fenced("a fence from a file", **{**QUICK, **changes}))
    assert solution.converged
    assert solution.delivered_rate > 2.2682 * (1 - 1e-3)  # a convex program gained nothing on it
    assert clearance(solution) >= solution.plan.margin - 1e-6
    save_solution(solution, tmp_path / "elsewhere.npz")
    again = load_solution(tmp_path / "elsewhere.npz")
    assert again.is_feasible()
    assert again.residuals()["fence"] == 0


def test_a_plan_in_half_duplex_with_free_ends_keeps_out(small_plan: MakePlan) -> None:
    tight = {
        "radio.causal": True,
        "radio.duplex": "half",
        "flight.start_velocity": "free",
        "flight.bound_first_acceleration": False,
        "fence": {"margin": 1, "exclusion": [{"center": [22, 22], "radius": 8}]},
        "optimizer": {"starts": ["straight", "user"], "max_iterations": 20},
    }
    solution = optimize(small_plan(tight))
    assert clearance(solution) >= 1 - 1e-6
    assert solution.is_feasible()


def test_both_ways_round_are_starts() -> None:
    problem = build_problem(fenced("a circle on the straight line", **QUICK))
    assert problem.free_area is not None
    kin = problem.kinematics
    flights = starts(kin, ["straight"], {}, problem.free_area, problem.constraints(kin))
    sides = {
        float(np.sign((flight.w.sum(axis=1) - 340)[len(flight.w) // 2]))
        for flight in flights.values()
    }
    assert sides == {-1.0, 1.0}
    for flight in flights.values():
        assert max(kin.residuals(flight).values()) < 1e-6


def test_no_time_for_the_way_round_is_said() -> None:
    hasty = QUICK | {"flight.time_step": 1.5, "flight.duration": 70.5}
    with pytest.raises(InfeasibleError, match="inside the fence"):
        optimize(fenced("two ways round of different worth", **hasty))
