"""Energy in the optimiser: against sums of its own, against SLSQP, and as goals."""

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from random_flights import random_flight

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer import goal
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.goal import ENERGY_SHARE
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan, parse_plan
from faao_mav.report.summary import result_lines
from faao_mav.workflow import Result

COPTER = parse_plan("""
site: {origin: {latitude: 47, longitude: 8}}
vehicle: {max_speed: 14, max_acceleration: 4, power: {}}
flight: {start: [0, 60], end: [60, 0], altitude: 40, duration: 24, time_step: 1}
radio:
  fading: none
  bandwidth_mhz: 10
  base_station: {position: [0, 0], power_dbm: 1}
  relay: {power_dbm: 20, noise_dbm: -80}
  ground_user: {position: [80, 60], noise_dbm: -80}
optimizer: {starts: [bs-user], max_iterations: 25}
""")
PLANE = COPTER.changed(
    {
        "vehicle": {
            "type": "plane",
            "min_speed": 9,
            "max_speed": 16,
            "max_acceleration": 5,
            "power": {"cruise_w": 90, "at": 12, "mass": 2.5},
        },
        "flight.start_velocity": "free",
        "flight.end_velocity": "free",
    },
)


def integrated(plan: Plan, flight: Trajectory) -> float:
    """What a flight takes, J, by the formulas of the papers."""
    v, a, g = flight.v - np.array(plan.wind), flight.a, 9.80665
    s = np.hypot(*v.T)
    if plan.vehicle.type == "copter":
        swept = 1.225 * 0.503
        r = s**2 / (20 / swept)
        power = 0.012 / 8 * swept * 0.05 * 120**3 * (1 + 3 * s**2 / 120**2)
        power += 1.1 * 20**1.5 / math.sqrt(2 * swept) * np.sqrt(np.sqrt(1 + r**2) - r)
        power += 0.6 * 0.05 * swept * s**3 / 2
    else:
        along, across = (a * v).sum(axis=1), a[:, 0] * v[:, 1] - a[:, 1] * v[:, 0]
        power = 90 / (2 * 12**3) * s**3 + 90 * 12 / 2 / s * (1 + (across / s / g) ** 2)
        power += 2.5 * np.maximum(0.0, along)
    return plan.flight.time_step * float((power + plan.radio.relay.power).sum())


@pytest.mark.parametrize(("plan", "wind"), [(COPTER, 0), (COPTER, 5), (PLANE, 0)])
def test_the_energy_is_that_of_direct_integration(plan: Plan, wind: float) -> None:
    plan = plan.changed({"site.wind": {"speed": wind, "from": 250}})
    problem = build_problem(plan)
    for seed in range(3):
        flight = random_flight(problem.kinematics, seed)
        assert problem.energy_of(flight) == pytest.approx(integrated(plan, flight), rel=1e-9)


def within(energy_wh: float) -> Solution:
    return optimize(COPTER.changed({"goal": {"maximise": "data", "energy_wh": energy_wh}}))


def used(found: Solution) -> float:
    assert found.energy_wh is not None
    return found.energy_wh


@pytest.fixture(scope="module")
def whole() -> Solution:
    """The flight that may take what it will."""
    return direct(build_problem(COPTER))


def test_less_energy_never_delivers_more(whole: Solution) -> None:
    most = used(whole)
    data = []
    for share in (0.7, 1.01):
        found = within(share * most)
        assert used(found) <= share * most * (1 + 1e-9)
        assert used(found) * 3600 == pytest.approx(integrated(COPTER, found.trajectory), rel=1e-9)
        assert found.is_feasible(1e-5)
        assert found.plan.flight.duration <= COPTER.flight.duration
        data.append(len(found.w) * found.delivered_rate)
    assert np.all(np.diff(data) > 0)
    assert found.plan.flight.duration == COPTER.flight.duration
    assert found.least is not None
    assert found.least.optimizations == 1


def test_the_best_duration_is_that_of_trying_all() -> None:
    found = within(0.5)
    tried = []
    for slots in range(len(found.w) - 1, len(found.w) + 2):
        problem = build_problem(COPTER.changed({"flight.duration": slots}))
        with suppress(InfeasibleError):
            each = direct(replace(problem, energy=0.5 * 3600))
            tried.append(slots * each.delivered_rate)
    assert len(tried) > 1
    assert len(found.w) * found.delivered_rate >= max(tried) * (1 - 1e-3)


def test_the_least_energy_is_below_that_of_other_ways(whole: Solution) -> None:
    asked = 0.7 * (COPTER.megabytes(whole.delivered_rate) or 0.0)
    found, quickest = (
        optimize(COPTER.changed({"goal": {"deliver_mbytes": asked, "minimise": quantity}}))
        for quantity in ("energy", "duration")
    )
    assert found.delivered_rate >= found.plan.needed_rate
    assert used(found) < 0.99 * used(quickest)
    assert used(found) < 0.99 * used(whole)
    assert found.least is not None
    below = found.least.below
    assert below is not None
    assert below.delivered_rate < below.plan.needed_rate
    assert used(below) >= used(found) - 2e-3 * used(whole)
    (label, told), *_ = result_lines(Result(found))
    assert label == "goal"
    assert told.startswith(f"least energy for {asked:.5g} megabytes: {used(found):.4g} Wh in ")
    goal = Result(found).as_dict()["goal"]
    assert goal["energy_wh"] == used(found)


def test_where_no_less_energy_will_do_every_share_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried: list[float] = []

    def none(flights: goal._Flights, number: int) -> Solution:
        tried.append(number * ENERGY_SHARE * flights.taken)
        raise InfeasibleError("none")

    monkeypatch.setattr(goal._Flights, "of_share", none)
    found = optimize(COPTER.changed({"goal": {"rate": 0.1, "minimise": "energy"}}))
    assert len(tried) > 1
    assert max(tried) == pytest.approx((1 - ENERGY_SHARE) * used(found) * 3600)


def test_too_little_energy_says_what_the_straight_flight_takes() -> None:
    with pytest.raises(
        InfeasibleError, match=r"at most 0\.2 Wh .*straight from start to end .* Wh"
    ):
        within(0.2)
