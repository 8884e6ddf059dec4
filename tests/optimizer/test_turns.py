"""Turns within what a plane's guidance follows at its speed, whatever its least speed is."""

import math

import numpy as np
import pytest
from conftest import MakePlan
from test_interior import plane, worst

from faao_mav.arrays import Real
from faao_mav.optimizer.kinematics import Kinematics, kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Vector

PLANE = {
    "vehicle.type": "plane",
    "flight.duration": 40,
    "flight.time_step": 1,
    "flight.start_velocity": "free",
    "flight.end_velocity": "free",
}
TURN = math.pi / (1.2 * 0.75 * 17)
"""rad/s: 1.2 look-aheads of ArduPlane's guidance, of NAVL1_DAMPING and NAVL1_PERIOD, a radian."""


def cruiser(duration: float, least: float, wind: Vector = (0.0, 0.0)) -> Kinematics:
    return plane(
        duration,
        time_step=0.5,
        max_speed=25.0 + math.hypot(*wind),
        max_airspeed=25.0,
        min_speed=least,
        wind=wind,
        most_fall=0.8,
        most_power=24.5,
        most_turn=TURN,
    )


def turned(solution: Solution) -> Real:
    """Return the shares of what turns may take, in calm air, (N + 1,)."""
    squares = (solution.v**2).sum(axis=1)
    most = TURN * np.sqrt((squares[1:] + squares[:-1]) / 2)
    return np.asarray(np.linalg.norm(solution.a[:-1], axis=1) / most)


def test_turns_allowed_in_the_air_are_allowed_over_ground() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        wind, least = tuple(rng.uniform(-30, 30, 2).tolist()), float(rng.uniform(1, 25))
        kin, size, theta = cruiser(2, least, wind), rng.uniform(least, 25, 3), rng.uniform(0, 7, 3)
        x = size[:, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)
        allowed = kin.turn_limits(x + wind)
        assert (kin.in_the_air().turn_limits(x) <= allowed * (1 + 1e-9)).all()
        both = np.sqrt((size[1:] ** 2 + size[:-1] ** 2) / 2)
        assert (TURN * both / 2 <= allowed * (1 + 1e-9)).all()


def test_turns_are_as_fast_as_the_guidance_follows_at_the_speed(small_plan: MakePlan) -> None:
    plan = small_plan(PLANE | {"vehicle.min_speed": 9})
    solution = optimize(plan)
    assert turned(solution).max() == pytest.approx(1, abs=1e-3)
    assert np.linalg.norm(solution.a, axis=1).max() > 1.1 * TURN * 9

    lively = small_plan(PLANE | {"vehicle.min_speed": 9, "vehicle.parameters": {"NAVL1_PERIOD": 5}})
    assert not kinematics(lively).turn_binds
    assert kinematics(lively).max_acceleration == lively.vehicle.max_acceleration


def test_algorithm_1_keeps_it_too(paper_plan: MakePlan) -> None:
    plan = paper_plan(PLANE | {"vehicle.min_speed": 9, "optimizer.max_iterations": 2})
    solution = optimize(plan)
    residuals = solution.residuals()
    assert {"turn", "minimum speed", "fall of airspeed"} <= set(residuals)
    assert max(residuals.values()) < 1e-6
    assert solution.rates.R_avg > solution.history[0]
    assert turned(solution).max() > 0.99


@pytest.mark.parametrize("least", [1, 28])
def test_the_published_aircraft_flies_with_any_least_speed(
    small_plan: MakePlan, least: int
) -> None:
    """That of Zeng and Zhang, IEEE TWC 2017: 3 to 100 m/s, 5 m/s^2, 30 m/s at both ends."""
    changes = {
        "vehicle.max_speed": 100,
        "vehicle.min_speed": least,
        "flight.end": [1000, 0],
        "flight.start_velocity": [30, 0],
        "flight.end_velocity": [30, 0],
        "radio.ground_user.position": [500, 500],
    }
    solution = optimize(small_plan(PLANE | changes))
    assert solution.converged
    assert worst(kinematics(solution.plan), solution.trajectory) < 1e-6
