"""Least durations, powers and energies: what they cost, and whether one step less could do.

    python benchmarks/goals.py [--starts 20] [CASE ...]

One row for each goal: the answer, flights optimised, CPU seconds over those of one optimisation of
the answer's size and energy from all starts, what is needed (bit/s/Hz), and of one slot, 0.02 dB or
one share of the energy less: what the plan's starts reach, the best of so many random starts, and
the upper bound, which knows no energy and decides where it is below what is needed. For the most
data of an energy it is the answer's own duration and energy, without a step less.
"""

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from faao_mav.optimizer.design import design
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.goal import ENERGY_SHARE
from faao_mav.optimizer.interior.maximize import constraints_of, maximize, nearest_flight
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.search.starts import shortest_by, sparing_starts
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import read_plan
from faao_mav.plan.fields import dbm
from faao_mav.plan.keys import ALIASES, POWER
from faao_mav.power import JOULES_PER_WH

MISSIONS = Path(__file__).parents[1] / "missions"
LESS_DB = 0.02
TRIES = 10
"""Random ways that are tried for each start: of some no flight is found."""

PLANE = {"vehicle.power": {"cruise_w": 120, "at": 15, "mass": 2}}


def least(what: str, rate: float) -> dict[str, Any]:
    """Return the goal of the least of `what` with which a rate, bit/s/Hz, is delivered."""
    return {"goal": {"rate": rate, "minimise": what}}


def most_data(energy: float) -> dict[str, Any]:
    """Return the goal of the most data that so many Wh deliver."""
    return {"goal": {"maximise": "data", "energy_wh": energy}}


CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "500 megabytes, 20 MHz": ("quickest_delivery", {}),
    "2 bit/s/Hz, least duration": ("copter_relay", least("duration", 2.0)),
    "2 bit/s/Hz, least power": ("copter_relay", least("power", 2.0)),
    "1 bit/s/Hz, least power": ("copter_relay", least("power", 1.0)),
    "half duplex, least duration": (
        "copter_relay",
        least("duration", 1.3) | {"radio.duplex": "half"},
    ),
    "fence, least duration": ("fenced_relay", least("duration", 2.1)),
    "800 megabytes, least energy": (
        "battery",
        {"goal": {"deliver_mbytes": 800, "minimise": "energy"}},
    ),
    "most data of 19 Wh": ("battery", most_data(19)),
    "plane, 1.2 bit/s/Hz, duration": ("plane_relay", least("duration", 1.2)),
    "plane, 1 bit/s/Hz, power": ("plane_relay", least("power", 1.0)),
    "plane, 1.2 bit/s/Hz, energy": ("plane_relay", least("energy", 1.2) | PLANE),
    "plane, most data of 4.3 Wh": ("plane_relay", most_data(4.3) | PLANE),
}


def less(found: Solution) -> Problem:
    """Return the problem of `found` with one slot, 0.02 dB or one share of the energy less."""
    plan, goal = found.plan, found.plan.goal.minimise
    assert found.least is not None
    if goal == "duration":
        step = plan.flight.time_step
        return build_problem(plan.changed({"flight.duration": plan.flight.duration - step}))
    if goal == "power":
        powers = zip(ALIASES[POWER], plan.powers, strict=True)
        changes = {key: round(dbm(power) - LESS_DB, 6) for key, power in powers}
        return build_problem(plan.changed(changes))
    share = ENERGY_SHARE * found.least.limit * JOULES_PER_WH if goal == "energy" else 0.0
    return replace(found.problem, energy=found.problem.energy - share)


def from_random(problem: Problem, count: int) -> float:
    """Return the best delivered rate from `count` flights near to random ways, bit/s/Hz."""
    rng, kin, area = np.random.default_rng(1), problem.kinematics, problem.free_area
    fenced, kept = problem.fenced(kin), problem.constraints(kin)
    straight, field = straight_flight(kin), rate_field(problem, design(problem.plan))
    reach, reached = float(np.linalg.norm(kin.end - kin.start)), list[float]()
    for _ in range(TRIES * count):
        places = list((kin.start + kin.end) / 2 + rng.uniform(-reach, reach, (2, 2)))
        if area is not None:
            places = [area.nearest(place, kin.start) for place in places]
        way = shortest_by(area, [kin.start, *places, kin.end])
        if way is None:
            continue
        share = np.sort(np.append(rng.uniform(0, 1, len(way) - 2), (0.0, 1.0)))
        at = np.linspace(0, 1, kin.slots)
        path = np.stack([np.interp(at, share, x) for x in way.T], axis=1)
        flight = nearest_flight(kin, path, straight, fenced)
        if flight is not None and problem.energy < math.inf:
            flight = sparing_starts(kin, {"": flight}, (*constraints_of(kin), *kept)).get("")
        if flight is not None:
            found = maximize(
                kin, field, flight, constraints=kept, tolerance=1e-4, max_iterations=300,
                relay=problem.relay,
            )  # fmt: skip
            reached.append(found.value)
        if len(reached) == count:
            break
    return max(reached, default=math.nan)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    options = parser.parse_args()
    print(f"{'goal':28}    answer  flights  CPU  needed  less: plan  random   bound", flush=True)
    for name in options.cases:
        sample, changes = CASES[name]
        plan = read_plan(MISSIONS / f"{sample}.yaml").changed(changes)
        started = time.process_time()
        found = optimize(plan)
        taken = time.process_time() - started
        assert found.least is not None
        started = time.process_time()
        direct(found.problem)
        ratio = taken / (time.process_time() - started)
        shorter = less(found)
        reached = direct(shorter).delivered_rate
        bound = upper_bound(shorter, reached).value
        answer, unit = {
            "duration": (found.plan.flight.duration, "s  "),
            "power": (dbm(found.plan.powers[1]), "dBm"),
        }.get(plan.goal.minimise or "", (found.problem.energy / JOULES_PER_WH, "Wh "))
        print(
            f"{name:30}  {answer:6.2f} {unit}  {found.least.optimizations:5} {ratio:5.1f}  "
            f"{shorter.plan.needed_rate:.4f}      {reached:.4f}  "
            f"{from_random(shorter, options.starts):.4f}  {bound:.4f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
