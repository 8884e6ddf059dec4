"""The rest of a flight, solved again: cut, it delivers what the whole does, within its limits."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited

from faao_mav import optimize, parse_plan
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rest import Rest, solve_rest
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.relay import Relayed

PLANS: dict[str, dict[str, Any]] = {
    "full": {},
    "half": {"radio.duplex": "half"},
    "buffer": {"radio.bandwidth_mhz": 1, "radio.relay.buffer_mbytes": 1.5},
    "draws": {"radio.fading": "realization"},
    "not causal": {"radio.causal": False},
    "mutual information": {"optimizer.rate": "mutual_information"},
}
MOVING = {
    "flight.duration": 20,
    "radio.base_station.power_dbm": -5,
    "radio.relay.power_dbm": -5,
    "optimizer.tolerance": 1e-6,
}


@cache
def planned(name: str) -> Solution:
    return optimize(parse_plan(edited(FLYABLE, MOVING | PLANS[name])))


def cut(solution: Solution, slot: int) -> Rest:
    """Return the rest of a flight that has gone as planned."""
    return Rest(solution, slot, solution.w[:slot], solution.w[slot], solution.v[slot])


def queue_is_right(relayed: Relayed) -> bool:
    change = (relayed.received - relayed.forwarded)[:-1]
    return bool(np.allclose(np.diff(relayed.queue), change, atol=1e-9))


def keeps_limits(again: Solution, rest: Rest) -> bool:
    """Tell whether the flight from `rest` on begins there and keeps the limits of its plan."""
    kin, slots = build_problem(again.plan).kinematics, slice(rest.slot, None)
    limits = replace(
        kin, start=rest.place, start_velocity=rest.velocity, slots=kin.slots - rest.slot
    )
    ahead = Trajectory(again.w[slots], again.v[slots], again.a[slots])
    return max(limits.residuals(ahead).values()) < 1e-6


@pytest.mark.parametrize(
    ("name", "slot"), [("full", 0), *((name, 9) for name in PLANS), ("full", 22), ("half", 22)]
)
def test_a_plan_that_is_cut_delivers_what_the_whole_does(name: str, slot: int) -> None:
    solution = planned(name)
    again = solve_rest(cut(solution, slot))
    assert again.delivered_rate >= solution.delivered_rate - 1e-6
    assert again.t.tolist() == solution.t.tolist()
    assert again.w[:slot].tolist() == solution.w[:slot].tolist()
    assert again.relayed.queue[0] == 0
    assert queue_is_right(again.relayed)
    assert keeps_limits(again, cut(solution, slot))
    missed = again.residuals()  # w alone is recorded of what was flown
    assert max(missed[name] for name in missed if name[:3] in ("(1)", "(2)", "(9)")) < 1e-6


@pytest.mark.parametrize("name", ["full", "half"])
def test_after_a_pause_the_limits_the_time_and_the_queue_are_kept(name: str) -> None:
    solution, begin, slot = planned(name), 6, 10
    flown = np.concatenate([solution.w[:begin], np.repeat(solution.w[begin][None], 4, axis=0)])
    again = solve_rest(Rest(solution, slot, flown, solution.w[begin], np.zeros(2)))
    assert keeps_limits(again, Rest(solution, slot, flown, solution.w[begin], np.zeros(2)))
    assert again.w[-1] == pytest.approx(solution.w[-1])
    assert queue_is_right(again.relayed)
    # what the slots flown have left in the queue is what the rest begins with
    past = solution.relay(
        again.I_U[:slot], again.I_G[:slot], None if again.shares is None else again.shares[:slot]
    )
    assert again.relayed.forwarded[:slot] == pytest.approx(past.forwarded)


def test_where_the_end_is_out_of_reach_there_is_no_flight() -> None:
    solution = planned("full")
    far = np.array([500.0, 500.0])
    with pytest.raises(InfeasibleError):
        solve_rest(Rest(solution, 30, solution.w[:30], far, np.zeros(2)))
    with pytest.raises(InfeasibleError, match="slots are left"):
        solve_rest(cut(solution, len(solution.t) - 2))
