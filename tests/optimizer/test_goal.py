"""Goals: the least duration and power are those of trying every step, and grow as they must."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.goal import least_number
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
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


@pytest.mark.parametrize(
    ("north", "slots", "more", "db"), [(20, 12, 4, 6.0), (60, 15, 1, 0.5), (100, 18, 2, 3.0)]
)
def test_more_time_and_more_power_never_deliver_less(
    north: int, slots: int, more: int, db: float
) -> None:
    place = {"radio.ground_user.position": [80, north]}
    less = delivered(place | {"flight.duration": slots})
    longer = delivered(place | {"flight.duration": slots + more})
    stronger = place | {"radio.base_station.power_dbm": 1 + db, "radio.relay.power_dbm": 20 + db}
    assert longer > less - 1e-4
    assert (slots + more) * longer > slots * less - 1e-4
    assert delivered(stronger | {"flight.duration": slots}) > less - 1e-4


@pytest.mark.parametrize(
    ("amount", "share"), [("rate", 0.0), ("rate", 0.6), ("deliver_mbytes", 0.3)]
)
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
