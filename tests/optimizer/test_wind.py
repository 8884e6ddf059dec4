"""Flights in wind: the airspeed v - u is limited, and that is all that changes."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.interior.maximize import Closeness, maximize
from faao_mav.optimizer.kinematics import LENGTH, Kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.scaled import flight_variables, minimize
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.search.starts import starts
from faao_mav.optimizer.search.straight import even_speed, straight_flight
from faao_mav.plan import Wind
from missions import plan_of

STATIONS = {"bs": np.array([0.0, 0.0]), "user": np.array([80.0, 90.0])}


COPTER = Kinematics(
    start=np.zeros(2),
    end=np.array([100.0, 50.0]),
    slots=81,
    time_step=0.5,
    max_speed=8.0,
    max_acceleration=2.0,
    start_velocity=np.zeros(2),
    end_velocity=np.zeros(2),
    bound_first_acceleration=True,
    max_airspeed=9.0,
)
FREE = replace(COPTER, start_velocity=None, end_velocity=None)


@pytest.mark.parametrize("kin", [COPTER, FREE])
@pytest.mark.parametrize(("speed", "degrees"), [(3.0, 135.0), (7.0, 20.0), (8.9, 250.0)])
def test_starts_keep_the_limits_or_there_is_none(
    kin: Kinematics, speed: float, degrees: float
) -> None:
    kin = replace(kin, wind=Wind(speed=speed, from_degrees=degrees).velocity)
    try:
        flights = starts(kin, ["straight", "bs", "user-bs"], STATIONS)
    except InfeasibleError:
        distance = float(np.hypot(*kin.end))
        assert even_speed(kin, kin.end / distance, distance) is None
    else:
        for flight in flights.values():
            assert max(kin.residuals(flight).values()) < 1e-7


def test_the_optimum_of_a_convex_problem_is_clarabels() -> None:
    kin = replace(FREE, wind=(-5.0, -6.0), end=np.array([30.0, 20.0]))
    path = np.tile([-60.0, 70.0], (kin.slots, 1))
    best = maximize(kin, Closeness(path), straight_flight(kin), tolerance=1e-6)
    flight = flight_variables(kin)
    apart = cp.sum_squares(flight.w - path / LENGTH) / kin.slots
    peer = minimize(apart, flight.constraints)
    assert max(kin.residuals(best.trajectory).values()) < 1e-7
    assert -best.value == pytest.approx(float(peer.value), rel=1e-4, abs=1e-6)


def test_the_frame_of_the_air_is_calm() -> None:
    kin = replace(FREE, wind=(4.0, -3.0), min_speed=3.0, max_speed=20.0)
    calm = kin.in_the_air()
    flight = straight_flight(calm)
    assert max(calm.residuals(flight).values()) < 1e-9
    assert max(kin.residuals(kin.over_ground(flight)).values()) < 1e-9


CHANGES = {
    "flight.duration": 70,
    "flight.time_step": 1,
    "vehicle.max_speed": 8,
    "flight.start": [0, 150],
    "flight.end": [150, 0],
    "radio.fading_samples": 4,
}


@pytest.mark.usefixtures("coarse_map")
def test_a_plan_in_wind_is_feasible_and_within_its_bound() -> None:
    plan = plan_of(CHANGES | {"site.wind": {"speed": 6, "from": 250}}, "ardupilot", "keep")
    solution = optimize(plan)
    airspeed = np.linalg.norm(solution.v - plan.wind, axis=1)
    assert solution.converged
    assert max(solution.residuals().values()) < 1e-6
    assert airspeed.max() <= plan.max_airspeed * (1 + 1e-8)
    reached = solution.delivered_rate
    assert reached <= upper_bound(build_problem(plan), reached).value
