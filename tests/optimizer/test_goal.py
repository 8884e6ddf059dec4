"""Goals: the least duration, power and energy, and the most data, are those of trying all."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_flights import random_flight

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer import goal as goal_module
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.goal import least_number
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.fields import dbm
from faao_mav.report.summary import result_lines
from faao_mav.workflow import Result

BASE = parse_plan("""
site: {origin: {latitude: 47, longitude: 8}}
vehicle: {max_speed: 12, max_acceleration: 4}
flight: {start: [0, 60], end: [60, 0], altitude: 40, duration: 18, time_step: 1}
radio:
  fading: none
  bandwidth_mhz: 10
  base_station: {position: [0, 0], power_dbm: 1}
  relay: {noise_dbm: -80}
  ground_user: {position: [80, 60], noise_dbm: -80}
optimizer: {starts: [straight, bs-user]}
""")


def delivered(changes: dict[str, Any]) -> float:
    return direct(build_problem(BASE.changed(changes))).delivered_rate


@pytest.fixture(scope="module")
def by_duration() -> dict[int, float]:
    """What flights of every duration deliver, bit/s/Hz."""
    return {slots: delivered({"flight.duration": slots}) for slots in range(12, 19)}


@pytest.mark.parametrize(("amount", "share"), [("rate", 0.0), ("deliver_mbytes", 0.3)])
def test_the_least_duration_is_that_of_trying_all(
    by_duration: dict[int, float], amount: str, share: float
) -> None:
    per_slot = {n: 1.0 if amount == "rate" else 10 * n / 8 for n in by_duration}
    amounts = {n: rate * per_slot[n] for n, rate in by_duration.items()}
    low, high = min(amounts.values()), max(amounts.values())
    asked = low + share * (high - low) - 1e-3  # ends differ by the tolerance
    found = optimize(BASE.changed({"goal": {amount: asked, "minimise": "duration"}}))
    least = min(n for n, reached in amounts.items() if reached >= asked)
    assert found.plan.flight.duration == least
    assert found.least is not None
    assert found.least.optimizations <= 9
    if least == min(amounts):
        assert found.least.below is None
    else:
        assert found.least.below is not None
        assert found.least.below.delivered_rate < found.least.below.plan.needed_rate


def test_the_least_power_is_just_enough() -> None:
    share, full = 0.6, delivered({})
    found = optimize(BASE.changed({"goal": {"rate": share * full, "minimise": "power"}}))
    base, relay = found.plan.radio.base_station.power, found.plan.radio.relay.power
    assert relay / base == pytest.approx(10**1.9, rel=1e-9)  # both by the same dB
    assert found.delivered_rate >= share * full
    assert found.least is not None
    assert found.least.optimizations <= 9
    assert found.least.below is not None
    below = found.least.below
    assert below.plan.radio.relay.power / relay == pytest.approx(10**-0.001, rel=1e-9)
    assert below.delivered_rate < share * full
    powers, less = (f"{dbm(base) - db:.2f} and {dbm(relay) - db:.2f} dBm" for db in (0, 0.01))
    lines = list(result_lines(Result(found)))
    assert lines[0][0] == "goal"
    assert lines[0][1].startswith(f"least power for {share * full:.4f} bit/s/Hz: {powers} (1 dBm ")
    assert lines[1] == ("", f"{less} would deliver {below.delivered_rate:.4f} bit/s/Hz")
    told = Result(found).as_dict()["goal"]
    assert told["power_dbm"] == pytest.approx([dbm(base), dbm(relay)])
    assert told["one_step_less"]["delivered_rate"] == below.delivered_rate


@given(
    st.lists(st.integers(0, 1000), min_size=2, max_size=300),
    st.integers(0, 400),
    st.floats(0, 1),
)
def test_the_least_number_is_that_of_trying_all(
    steps: list[int], without: int, share: float
) -> None:
    values = np.cumsum(steps)
    surplus = [
        -np.inf if n <= without else float(v) for n, v in enumerate(values - share * values[-1])
    ]
    high = len(surplus) - 1
    if surplus[high] >= 0:
        least = next(n for n in range(1, high + 1) if surplus[n] >= 0)
        assert least_number(surplus.__getitem__, 0, high, -1.0, surplus[high]) == least


@pytest.mark.parametrize(
    ("goal", "told"),
    [
        ({"rate": 9.0, "minimise": "duration"},
         "goal.rate: 9 bit/s/Hz cannot be delivered in 18 s (flight.duration) at 1 and 20 dBm"),
        ({"deliver_mbytes": 900, "minimise": "power"}, "at most "),
    ],
)  # fmt: skip
def test_a_goal_out_of_reach_says_what_is_possible(goal: dict[str, Any], told: str) -> None:
    with pytest.raises(InfeasibleError) as caught:
        optimize(BASE.changed({"goal": goal}))
    assert told in str(caught.value)
    assert f"at most {_most(BASE, 'rate' in goal)}" in str(caught.value)


def _most(plan: Plan, rate: bool) -> str:
    R_del = direct(build_problem(plan)).delivered_rate
    return f"{R_del:.4f} bit/s/Hz" if rate else f"{plan.megabytes(R_del):.4g} megabytes"


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


@pytest.mark.parametrize(("plan", "wind"), [(COPTER, 5), (PLANE, 0)])
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
    for slots in (len(found.w) - 1, len(found.w) + 1):
        problem = build_problem(COPTER.changed({"flight.duration": slots}))
        with suppress(InfeasibleError):
            each = direct(replace(problem, energy=0.5 * 3600))
            tried.append(slots * each.delivered_rate)
    assert tried
    assert len(found.w) * found.delivered_rate >= max(tried) * (1 - 1e-3)


def test_the_least_energy_is_below_that_of_the_whole_flight(
    whole: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("faao_mav.optimizer.goal.ENERGY_SHARE", 0.01)
    asked = 0.7 * (COPTER.megabytes(whole.delivered_rate) or 0.0)
    goal = {"deliver_mbytes": asked, "minimise": "energy"}
    found = optimize(COPTER.changed({"goal": goal}))
    assert found.delivered_rate >= found.plan.needed_rate
    assert used(found) < 0.99 * used(whole)
    assert found.least is not None
    below = found.least.below
    assert below is not None
    assert below.delivered_rate < below.plan.needed_rate
    assert used(below) >= used(found) - 0.02 * used(whole)
    (label, told), *_ = result_lines(Result(found))
    assert label == "goal"
    assert told.startswith(f"least energy for {asked:.5g} megabytes: {used(found):.4g} Wh in ")
    assert Result(found).as_dict()["goal"]["energy_wh"] == used(found)


def test_where_no_less_energy_will_do_every_share_is_refused(
    whole: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []

    def none(_: goal_module._Flights, number: int) -> Solution:
        tried.append(number)
        raise InfeasibleError("none")

    monkeypatch.setattr(goal_module._Flights, "of_share", none)
    found = optimize(COPTER.changed({"goal": {"rate": 0.1, "minimise": "energy"}}))
    assert max(tried) == round(1 / goal_module.ENERGY_SHARE) - 1
    assert used(found) == used(whole)


def test_too_little_energy_says_what_the_straight_flight_takes() -> None:
    with pytest.raises(
        InfeasibleError, match=r"at most 0\.2 Wh .*straight from start to end .* Wh"
    ):
        within(0.2)
