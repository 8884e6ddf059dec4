"""Planes: the least speed, changes of the airspeed and turns, and plans that cannot be."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan
from test_interior import STATIONS, bpsk, gaussian, links, plane, reward, worst

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError, PlanError
from faao_mav.optimizer.interior.maximize import maximize
from faao_mav.optimizer.kinematics import Kinematics, kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.search.starts import starts
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import Solution

NAMES = ["straight", "bs", "user", "bs-user", "user-bs"]
PLACES = {"bs": STATIONS[0], "user": STATIONS[1]}
FREE = {"flight.start_velocity": "free", "flight.end_velocity": "free"}


def cruiser(duration: float, least: float, **changes: Any) -> Kinematics:
    values = {"time_step": 0.5, "max_speed": 25.0, "min_speed": least}
    values |= {"most_fall": 0.8, "most_power": 24.5}  # the plane of ArduPilot's simulator
    return plane(duration, **(values | {"bound_first_acceleration": True} | changes))


def heading(speed: float, degrees: float) -> Any:
    return speed * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])


@pytest.mark.parametrize("closed", [False, True])
def test_every_start_keeps_the_least_speed_and_circles_at_the_stations(closed: bool) -> None:
    for least, slots, first, last in (
        (1.0, 120, None, None),
        (8.0, 300, 30.0, -150.0),
        (10.0, 800, None, None),
        (20.0, 500, 0.0, 0.0),
    ):
        kin = cruiser(
            slots / 2,
            least,
            start_velocity=None if first is None else heading(max(least, 8.0), first),
            end_velocity=None if last is None else heading(max(least, 8.0), last),
        )
        kin = replace(kin, end=kin.start) if closed else kin
        found = starts(kin, NAMES, PLACES)
        assert "straight" in found
        for flight in found.values():
            assert "minimum speed" in kin.residuals(flight)
            assert worst(kin, flight) < 1e-8
        if slots == 800:
            for place in PLACES.values():
                near = np.linalg.norm(found["bs-user"].w - place, axis=1) < 60
                assert near.sum() > 100


def test_refused_is_where_no_flight_keeps_every_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    sides, seconds, speed, limit, step = (0, 1, 1), (7.0, 21.0, 8.0), 12.2, 2.1, 0.5
    time, since = step * np.arange(int(sum(seconds) / step) + 1), np.cumsum([0.0, *seconds[:2]])
    pieces = zip(sides, since, seconds, strict=True)
    theta = sum(side * np.clip(time - t, 0, lasts) for side, t, lasts in pieces)
    theta *= 0.99 * limit / speed
    v = speed * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    end = step * (v[1:] + v[:-1]).sum(axis=0) / 2
    kin = cruiser(0, 11.5, slots=time.size, max_speed=15.0, max_acceleration=limit)
    kin = replace(kin, start=np.zeros(2), end=end, start_velocity=v[0], end_velocity=v[-1])
    assert worst(kin, kin.follow(v)) < 1e-9
    assert worst(kin, straight_flight(kin)) < 1e-9
    monkeypatch.setattr("faao_mav.optimizer.search.straight._REPAIRS", 1)  # more are as hopeless
    monkeypatch.setattr("faao_mav.optimizer.search.straight._TRIES", 1)
    kin = cruiser(5, 20.0)
    kin = replace(kin, end=kin.start)
    with pytest.raises(InfeasibleError, match=r"at least 20 m/s \(vehicle\.min_speed\) for 5 s"):
        straight_flight(kin)


def test_an_airspeed_changes_as_slowly_as_thrust_and_drag_let_it() -> None:
    wind = (3.0, -2.0)
    kin = cruiser(100, 9.0, time_step=1.0, max_speed=20.0 + math.hypot(*wind))
    kin, stage = replace(kin, max_airspeed=20.0, wind=wind), links(bpsk, 4e4, 4e4)
    at_once = replace(kin, most_fall=math.inf, most_power=math.inf)
    start = starts(kin, ["bs-user"], PLACES)["bs-user"]
    free = maximize(at_once, stage, start, tolerance=1e-4, max_iterations=150)
    best = maximize(kin, stage, start, tolerance=1e-4, max_iterations=150)
    assert best.converged
    assert worst(kin, best.trajectory) < 1e-8
    change = np.diff(np.linalg.norm(best.trajectory.v - wind, axis=1))
    assert change.min() == pytest.approx(-0.8, abs=1e-3)
    assert worst(kin, free.trajectory) > 0.5
    assert 0.99 * free.value < best.value < free.value


def test_the_published_flight_is_reached() -> None:
    """Zeng and Zhang, IEEE TWC 2017, Table II: 9.53 Mbit/s at a mean of 8.16 m/s, 4.89 m/s².

    Re-computed by CVXPY: 9.5208, 8.12 and 4.88.
    """
    along = np.array([30.0, -30.0]) / np.sqrt(2)
    kin = plane(400, bound_first_acceleration=True, min_speed=3.0)
    kin = replace(kin, start=np.array([0.0, 1000.0]), end=np.array([1000.0, 0.0]))
    kin = replace(kin, start_velocity=along, end_velocity=along)
    start = straight_flight(kin)
    stage = links(gaussian, 1e7)
    best = maximize(kin, stage, start, tolerance=1e-4, max_iterations=300)
    assert worst(kin, best.trajectory) < 1e-6
    assert reward(stage, start) == pytest.approx(4.01, abs=0.06)
    assert best.value == pytest.approx(9.53, rel=5e-3)
    assert np.linalg.norm(best.trajectory.v, axis=1).mean() == pytest.approx(8.16, rel=0.02)
    assert np.linalg.norm(best.trajectory.a, axis=1).mean() == pytest.approx(4.89, rel=0.04)


TURNING = {
    "vehicle.type": "plane",
    "flight.duration": 40,
    "flight.time_step": 1,
    "flight.start_velocity": "free",
    "flight.end_velocity": "free",
}
TURN = math.pi / (1.2 * 0.75 * 17)
"""rad/s: 1.2 look-aheads of ArduPlane's guidance, of NAVL1_DAMPING and NAVL1_PERIOD, a radian."""


def turned(solution: Solution) -> Real:
    """Return the shares of what turns may take, in calm air, (N + 1,)."""
    squares = (solution.v**2).sum(axis=1)
    most = TURN * np.sqrt((squares[1:] + squares[:-1]) / 2)
    return np.asarray(np.linalg.norm(solution.a[:-1], axis=1) / most)


def test_turns_are_as_fast_as_the_guidance_follows(small_plan: MakePlan) -> None:
    plan = small_plan(TURNING | {"vehicle.min_speed": 9})
    solution = optimize(plan)
    assert solution.is_feasible()
    assert solution.rates.R_avg > 1.05 * solution.history[0]
    assert turned(solution).max() == pytest.approx(1, abs=1e-3)
    assert np.linalg.norm(solution.a, axis=1).max() > 1.1 * TURN * 9

    changes = {"vehicle.parameters": {"AIRSPEED_CRUISE": 22, "NAVL1_PERIOD": 5}}
    faint = {"radio.base_station.power_dbm": 0, "radio.relay.power_dbm": 0, "flight.duration": 20}
    lively = plan.changed(changes | faint)
    assert not kinematics(lively).turn_binds
    assert kinematics(lively).max_acceleration == lively.vehicle.max_acceleration
    residuals = optimize(lively).residuals()
    assert residuals["fall of airspeed"] < 1e-6
    assert residuals["minimum speed"] < 1e-6


def test_turns_allowed_in_the_air_are_allowed_over_ground() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        wind, least = tuple(rng.uniform(-30, 30, 2).tolist()), float(rng.uniform(1, 25))
        kin = cruiser(2, least, max_speed=25.0 + math.hypot(*wind), max_airspeed=25.0)
        kin = replace(kin, wind=wind, most_turn=TURN)
        size, theta = rng.uniform(least, 25, 3), rng.uniform(0, 7, 3)
        x = size[:, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)
        allowed = kin.turn_limits(x + wind)
        assert (kin.in_the_air().turn_limits(x) <= allowed * (1 + 1e-9)).all()
        both = np.sqrt((size[1:] ** 2 + size[:-1] ** 2) / 2)
        assert (TURN * both / 2 <= allowed * (1 + 1e-9)).all()


def test_algorithm_1_is_for_aircraft_that_can_hover(paper_plan: MakePlan) -> None:
    with pytest.raises(PlanError, match=r"vehicle\.min_speed is not for algorithm1"):
        optimize(paper_plan(TURNING | {"vehicle.min_speed": 9}))
