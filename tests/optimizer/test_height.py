"""The best of several heights: closed forms, both ends, what the vehicle's fence and a goal ask."""

import math
from typing import Any

import pytest

from faao_mav import optimize, parse_plan
from faao_mav.errors import PlanError
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.optimize import best_height
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.plan.keys import ALIASES, POWER

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


def plan(changes: dict[str, Any] | None = None) -> Plan:
    """Return the hover, with `changes` by dotted keys."""
    return parse_plan(HOVER).changed(changes or {})


def test_the_best_height_is_that_of_the_closed_form() -> None:
    """20 log10(cos e) + c sin(e) is highest where c (1 - s^2) = 20 s / ln 10, s = sin(e)."""
    c = 16.0
    k = 20 / (math.log(10) * c)
    s = (math.sqrt(k * k + 4) - k) / 2
    found = optimize(plan({"radio.gain.elevation_db": [c]}))
    assert found.plan.flight.altitude == pytest.approx(100 * s / math.sqrt(1 - s * s), abs=0.5)


@pytest.mark.usefixtures("few")
def test_without_terms_over_the_elevation_the_lowest_is_the_best() -> None:
    found = optimize(plan())
    assert found.plan.flight.altitude == 20.0
    assert found.height is not None
    assert found.height.at_most is not None
    assert found.height.at_most.delivered_rate < found.delivered_rate


def test_the_better_of_two_local_optima_is_found() -> None:
    def peaks(candidate: Plan, known: Trajectory | None) -> Solution:
        asked.append(known is not None)
        height = candidate.flight.altitude
        power = max(-abs(height - 35), 15 - abs(height - 93.4))
        return optimize(candidate.changed(dict.fromkeys(ALIASES[POWER], power)))

    asked: list[bool] = []
    found = best_height(plan(), peaks)
    assert found.plan.flight.altitude == pytest.approx(93.4, abs=0.5)
    assert asked == [False, *[True] * (len(asked) - 1)]  # each begins with a flight nearby


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three heights and none between, where that is enough."""
    monkeypatch.setattr("faao_mav.optimizer.optimize._EVENLY", 3)
    monkeypatch.setattr("faao_mav.optimizer.optimize._REFINED", 0)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(
    ("autopilot", "parameters", "expected"),
    [
        ("ardupilot", {"FENCE_ENABLE": 1, "FENCE_TYPE": 9, "FENCE_ALT_MAX": 60}, 60.0),
        ("ardupilot", {"FENCE_ENABLE": 0, "FENCE_ALT_MAX": 60}, 120.0),
        ("px4", {"GF_MAX_VER_DIST": 50.5}, 50.5),
    ],
)
def test_the_ceiling_of_the_vehicles_fence_counts(
    autopilot: str, parameters: dict[str, float], expected: float
) -> None:
    changes = {"vehicle.autopilot": autopilot, "vehicle.parameters": parameters}
    found = optimize(plan({**changes, "radio.gain.elevation_db": [60]}))
    assert found.plan.flight.altitude == expected

    with pytest.raises(PlanError, match=r"flight\.altitude: 20 to 120 m.*-inf to 15 m"):
        optimize(plan({"vehicle.autopilot": "px4", "vehicle.parameters.GF_MAX_VER_DIST": 15}))


@pytest.mark.usefixtures("few")
def test_a_goal_is_met_at_the_height_where_it_takes_least() -> None:
    """Where gains are 3 dB higher, so much less power does."""
    asked = {"goal": {"minimise": "power", "rate": 0.5}, "radio.gain.elevation_db": [12]}
    found = optimize(plan({**asked, **dict.fromkeys(ALIASES[POWER], 20)}))
    assert found.height is not None
    assert found.height.at_least is not None
    both = found, found.height.at_least
    powers = [each.plan.powers[0] for each in both]
    gains = [each.problem.bs_uav.gains.gain(each.w.T).mean() for each in both]
    assert powers[1] / powers[0] == pytest.approx(gains[0] / gains[1], rel=0.01)
    assert gains[0] > 1.5 * gains[1]


def test_other_heights_are_refused() -> None:
    for height in ({"least": 20}, {"least": 60, "most": 40}, {"least": 0, "most": 40}, "high"):
        with pytest.raises(PlanError, match=r"flight\.altitude: .*\{least: metres, most: metre"):
            plan({"flight.altitude": height})
