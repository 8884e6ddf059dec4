"""Goals and heights: the least duration, power and energy, the most data, the best height."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_flights import random_flight
from test_power import TABLE

from faao_mav.errors import InfeasibleError, PlanError
from faao_mav.optimizer import goal as goal_module
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.goal import least_number
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.optimize import best_height, optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.shadowing import worth
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.fields import dbm
from faao_mav.plan.keys import ALIASES, POWER
from faao_mav.plan.yaml_text import load_yaml
from faao_mav.power import FixedWing
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


def test_the_least_duration_is_that_of_trying_all() -> None:
    by_duration = {slots: delivered({"flight.duration": slots}) for slots in range(12, 19)}
    for amount, share in (("rate", 0.0), ("deliver_mbytes", 0.3)):
        per_slot = {n: 1.0 if amount == "rate" else 10 * n / 8 for n in by_duration}
        amounts = {n: rate * per_slot[n] for n, rate in by_duration.items()}
        low, high = min(amounts.values()), max(amounts.values())
        asked = low + share * (high - low) - 1e-3  # ends differ by the tolerance
        found = optimize(BASE.changed({"goal": {amount: asked, "minimise": "duration"}}))
        least = min(n for n, reached in amounts.items() if reached >= asked)
        assert found.plan.flight.duration == least
        assert found.least is not None
        assert found.least.optimizations <= 9
        below = found.least.below
        assert (below is None) == (least == min(amounts))
        assert below is None or below.delivered_rate < below.plan.needed_rate


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


def test_a_goal_is_met_in_the_share_of_shadowings_that_is_asked_for() -> None:
    sure = {"radio.gain.spread_db": 6, "radio.gain.correlation_m": 20, "radio.reliability": 0.9}
    rate = 0.58 * delivered({})
    found = optimize(BASE.changed(sure | {"goal": {"rate": rate, "minimise": "duration"}}))
    assert found.least is not None
    assert found.least.below is not None
    assert worth(found.least.below) < rate <= worth(found) < found.delivered_rate
    _, text = next(result_lines(Result(found)))
    assert f"{rate:.4f} bit/s/Hz in 0.9 of shadowings: " in text


def test_a_goal_out_of_reach_says_what_is_possible() -> None:
    most = delivered({})
    for goal, *told in (
        (
            {"rate": 9.0, "minimise": "duration"},
            "goal.rate: 9 bit/s/Hz cannot be delivered in 18 s (flight.duration) at 1 and 20 dBm",
            f"at most {most:.4f} bit/s/Hz",
        ),
        ({"deliver_mbytes": 900, "minimise": "power"}, f"{BASE.megabytes(most):.4g} megabytes"),
    ):
        with pytest.raises(InfeasibleError) as caught:
            optimize(BASE.changed({"goal": goal}))
        assert all(part in str(caught.value) for part in told)


@given(
    st.lists(st.integers(0, 1000), min_size=2, max_size=300), st.integers(0, 400), st.floats(0, 1)
)
def test_the_least_number_is_that_of_trying_all(steps: list[int], none: int, share: float) -> None:
    values = np.cumsum(steps)
    left = values - share * values[-1]
    surplus = [-np.inf if n <= none else float(v) for n, v in enumerate(left)]
    high = len(surplus) - 1
    if surplus[high] >= 0:
        least = next(n for n in range(1, high + 1) if surplus[n] >= 0)
        assert least_number(surplus.__getitem__, 0, high, -1.0, surplus[high]) == least


COPTER = BASE.changed({
    "vehicle": {"max_speed": 14, "max_acceleration": 4, "power": {}},
    "flight.duration": 24,
    "optimizer": {"starts": ["bs-user"], "max_iterations": 25},
})  # fmt: skip
WING = """{type: plane, min_speed: 9, max_speed: 16, max_acceleration: 5,
           power: {cruise_w: 90, at: 12, mass: 2.5}}"""
PLANE = COPTER.changed({
    "vehicle": load_yaml(WING, "plane"),
    "flight.start_velocity": "free",
    "flight.end_velocity": "free",
})  # fmt: skip


def integrated(plan: Plan, flight: Trajectory) -> float:
    """What a flight takes, J, by the formulas of `test_power.py`, and the relay's transmitter."""
    model = FixedWing.fitted(90.0, 12.0, 2.5) if plan.vehicle.type == "plane" else TABLE
    through, a = (
        np.column_stack([x, np.zeros(len(x))]) for x in (flight.v - np.array(plan.wind), flight.a)
    )
    power = sum(float(model(*each)) for each in zip(through, a, strict=True))
    return plan.flight.time_step * (power + len(a) * plan.radio.relay.power)


def test_the_energy_is_that_of_direct_integration() -> None:
    for still, wind in ((COPTER, 5), (PLANE, 0)):
        plan = still.changed({"site.wind": {"speed": wind, "from": 250}})
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


def test_less_energy_delivers_less_in_the_best_duration_of_all(whole: Solution) -> None:
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
    found = within(0.5)
    tried = []
    for slots in (len(found.w) - 1, len(found.w) + 1):
        problem = build_problem(COPTER.changed({"flight.duration": slots}))
        with suppress(InfeasibleError):
            each = direct(replace(problem, energy=0.5 * 3600))
            tried.append(slots * each.delivered_rate)
    assert tried
    assert len(found.w) * found.delivered_rate >= max(tried) * (1 - 1e-3)
    told = r"at most 0\.2 Wh .*straight from start to end .* Wh"
    with pytest.raises(InfeasibleError, match=told):
        within(0.2)


def test_the_least_energy_is_below_the_whole_flights_or_refused(
    whole: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("faao_mav.optimizer.goal.ENERGY_SHARE", 0.01)
    asked = 0.7 * (COPTER.megabytes(whole.delivered_rate) or 0.0)
    goal = {"deliver_mbytes": asked, "minimise": "energy"}
    found = optimize(COPTER.changed({"goal": goal}))
    assert found.delivered_rate >= found.plan.needed_rate
    assert used(found) < 0.99 * used(whole)
    assert found.least is not None
    assert (below := found.least.below) is not None
    assert below.delivered_rate < below.plan.needed_rate
    assert used(below) >= used(found) - 0.02 * used(whole)
    (label, told), *_ = result_lines(Result(found))
    assert label == "goal"
    assert told.startswith(f"least energy for {asked:.5g} megabytes: {used(found):.4g} Wh in ")
    assert Result(found).as_dict()["goal"]["energy_wh"] == used(found)
    tried: list[float] = []

    def none(flights: goal_module._Flights, energy: float) -> Solution:
        tried.append(energy / flights.taken / goal_module.ENERGY_SHARE)
        raise InfeasibleError("none")

    monkeypatch.setattr(goal_module._Flights, "within", none)
    found = optimize(COPTER.changed({"goal": {"rate": 0.1, "minimise": "energy"}}))
    assert max(tried) == pytest.approx(round(1 / goal_module.ENERGY_SHARE) - 1)
    assert used(found) == used(whole)


def test_the_least_energy_is_no_more_than_a_short_hover_takes() -> None:
    plan = COPTER.changed({"flight.end": list(COPTER.flight.start), "flight.duration": 30})
    hover = optimize(plan.changed({"flight.duration": 4}))
    goal = {"rate": 0.99 * hover.delivered_rate, "minimise": "energy"}
    assert used(optimize(plan.changed({"goal": goal}))) <= 1.01 * used(hover)


HOVER = """
site: {origin: {latitude: -35.36, longitude: 149.17, elevation: 584}}
vehicle: {max_speed: 1, max_acceleration: 1}
flight: {start: [100, 0], end: [100, 0], altitude: {least: 20, most: 120}, duration: 4,
         time_step: 1}
radio:
  fading: none
  base_station: {position: [0, 0], power_dbm: -20}
  relay: {power_dbm: -20}
  ground_user: {position: [0, 0]}
"""
"""A hover 100 m from both stations, which are at one place."""


def hovering(changes: dict[str, Any] | None = None) -> Plan:
    """Return the hover, with `changes` by dotted keys."""
    return parse_plan(HOVER).changed(changes or {})


def test_the_best_height_is_that_of_the_closed_form() -> None:
    """20 log10(cos e) + c sin(e) is highest where c (1 - s^2) = 20 s / ln 10, s = sin(e)."""
    c = 16.0
    k = 20 / (math.log(10) * c)
    s = (math.sqrt(k * k + 4) - k) / 2
    found = optimize(hovering({"radio.gain.elevation_db": [c]}))
    assert found.plan.flight.altitude == pytest.approx(100 * s / math.sqrt(1 - s * s), abs=0.5)


def test_the_better_of_two_local_optima_is_found() -> None:
    def peaks(candidate: Plan, known: Trajectory | None) -> Solution:
        asked.append(known is not None)
        height = candidate.flight.altitude
        power = max(-abs(height - 35), 15 - abs(height - 93.4))
        return optimize(candidate.changed(dict.fromkeys(ALIASES[POWER], power)))

    asked: list[bool] = []
    found = best_height(hovering(), peaks)
    assert found.plan.flight.altitude == pytest.approx(93.4, abs=0.5)
    assert asked == [False, *[True] * (len(asked) - 1)]  # each begins with a flight nearby


def test_other_heights_are_refused() -> None:
    for height in ({"least": 20}, {"least": 60, "most": 40}, {"least": 0, "most": 40}, "high"):
        with pytest.raises(PlanError, match=r"flight\.altitude[.:].*\{least: metres, most: metre"):
            hovering({"flight.altitude": height})


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three heights and none between, where that is enough."""
    monkeypatch.setattr("faao_mav.optimizer.optimize._EVENLY", 3)
    monkeypatch.setattr("scipy.optimize.minimize_scalar", lambda *_, **__: None)


@pytest.mark.usefixtures("few")
def test_the_ceiling_of_the_vehicles_fence_counts() -> None:
    """Where the highest is the best; without terms over the elevation it is the lowest."""
    for autopilot, parameters, expected in (
        ("ardupilot", {"FENCE_ENABLE": 1, "FENCE_TYPE": 9, "FENCE_ALT_MAX": 60}, 60.0),
        ("ardupilot", {"FENCE_ENABLE": 0, "FENCE_ALT_MAX": 60}, 120.0),
        ("px4", {"GF_MAX_VER_DIST": 50.5}, 50.5),
    ):
        changes = {"vehicle.autopilot": autopilot, "vehicle.parameters": parameters}
        found = optimize(hovering({**changes, "radio.gain.elevation_db": [60]}))
        assert found.plan.flight.altitude == expected
    lowest = optimize(hovering())
    assert lowest.plan.flight.altitude == 20.0
    assert lowest.height is not None
    assert lowest.height.at_most is not None
    assert lowest.height.at_most.delivered_rate < lowest.delivered_rate

    with pytest.raises(PlanError, match=r"flight\.altitude: 20 to 120 m.*-inf to 15 m"):
        optimize(hovering({"vehicle.autopilot": "px4", "vehicle.parameters.GF_MAX_VER_DIST": 15}))


@pytest.mark.usefixtures("few")
def test_a_goal_is_met_at_the_height_where_it_takes_least() -> None:
    """Where gains are 3 dB higher, so much less power does."""
    asked = {"goal": {"minimise": "power", "rate": 0.5}, "radio.gain.elevation_db": [12]}
    found = optimize(hovering({**asked, **dict.fromkeys(ALIASES[POWER], 20)}))
    assert found.height is not None
    assert found.height.at_least is not None
    both = found, found.height.at_least
    powers = [each.plan.powers[0] for each in both]
    gains = [each.problem.bs_uav.gains.gain(each.w.T).mean() for each in both]
    assert powers[1] / powers[0] == pytest.approx(gains[0] / gains[1], rel=0.01)
    assert gains[0] > 1.5 * gains[1]
