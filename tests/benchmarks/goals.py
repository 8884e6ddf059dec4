"""Least durations and powers: what they cost, and whether one step less could do.

    python tests/benchmarks/goals.py [--starts 20] [CASE ...]

One row for each goal: the answer, flights optimised, CPU seconds over those of one optimisation of
the answer's size, what is needed (bit/s/Hz), and of one slot or 0.02 dB less: what the plan's
starts reach, the best of so many random starts, and the upper bound, which decides where it is
below what is needed.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from faao_mav.optimizer.design import design
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.interior.maximize import maximize_all
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.search.starts import straight_flight, with_stops
from faao_mav.optimizer.search.ways import along, shortest_by
from faao_mav.plan import Plan, changed_plan, read_plan
from faao_mav.plan.fields import dbm
from faao_mav.plan.keys import ALIASES, POWER

MISSIONS = Path(__file__).parents[2] / "missions"
LESS_DB = 0.02
TRIES = 10
"""Random ways that are tried for each start inside a fence."""

CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "500 megabytes, 20 MHz": ("quickest_delivery", {}),
    "2 bit/s/Hz, least duration": (
        "copter_relay",
        {"goal": {"rate": 2.0, "minimise": "duration"}},
    ),
    "2 bit/s/Hz, least power": ("copter_relay", {"goal": {"rate": 2.0, "minimise": "power"}}),
    "1 bit/s/Hz, least power": ("copter_relay", {"goal": {"rate": 1.0, "minimise": "power"}}),
    "half duplex, least duration": (
        "copter_relay",
        {"goal": {"rate": 1.3, "minimise": "duration"}, "radio.duplex": "half"},
    ),
    "fence, least duration": (
        "fenced_relay",
        {"goal": {"rate": 2.1, "minimise": "duration"}},
    ),
}


def at_random(kin: Kinematics, rng: np.random.Generator, reach: float) -> Trajectory:
    """Return a flight by two random places, or where time is short the straight one, bent."""
    middle, straight = (kin.start + kin.end) / 2, straight_flight(kin)
    for _ in range(50):
        flight = with_stops(kin, list(middle + rng.uniform(-reach, reach, (2, 2))))
        if flight is not None:
            return flight
        reach *= 0.95
    bend = rng.uniform(0, 3) * rng.standard_normal(2) + rng.standard_normal(straight.a.shape)
    for size in 0.8 ** np.arange(30):
        bent = kin.integrate(straight.v[0], straight.a + size * bend)
        if max(kin.residuals(bent).values()) < 1e-9:
            return bent
    return straight


def less(plan: Plan) -> Plan:
    """Return `plan` with one slot, or with 0.02 dB less."""
    if plan.goal.minimise == "duration":
        return changed_plan(plan, {"flight.duration": plan.flight.duration - plan.flight.time_step})
    powers = zip(ALIASES[POWER], plan.powers, strict=True)
    return changed_plan(plan, {key: round(dbm(power) - LESS_DB, 6) for key, power in powers})


def from_random(plan: Plan, count: int) -> float:
    """Return the best delivered rate from `count` random flights, bit/s/Hz."""
    problem, rng = build_problem(plan), np.random.default_rng(1)
    kin, kept = problem.kinematics, problem.constraints(problem.kinematics)
    reach = float(np.linalg.norm(kin.end - kin.start))
    area, inside = problem.free_area, list[Trajectory]()
    for _ in range(TRIES * count):
        if len(inside) == count:
            break
        if area is None:
            inside.append(at_random(kin, rng, reach))
            continue
        middle = (kin.start + kin.end) / 2
        stops = [
            area.nearest(p, kin.start) for p in middle + rng.uniform(-reach, reach, (2, 2)) / 2
        ]
        way = shortest_by(area, [kin.start, *stops[: rng.integers(3)], kin.end])
        flight = None if way is None else along(kin, way, kept)
        if flight is not None:
            inside.append(flight)
    optima = maximize_all(
        kin,
        rate_field(problem, design(plan)),
        inside,
        constraints=kept,
        tolerance=1e-4,
        max_iterations=300,
        relay=problem.relay,
    )
    return max(optimum.value for optimum in optima)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    options = parser.parse_args()
    print(f"{'goal':28}    answer  flights  CPU  needed  less: plan  random   bound", flush=True)
    for name in options.cases:
        sample, changes = CASES[name]
        plan = changed_plan(read_plan(MISSIONS / f"{sample}.yaml"), changes)
        started = time.process_time()
        found = optimize(plan)
        taken = time.process_time() - started
        started = time.process_time()
        direct(build_problem(found.plan))
        ratio = taken / (time.process_time() - started)
        shorter = less(found.plan)
        reached = direct(build_problem(shorter)).delivered_rate
        bound = upper_bound(build_problem(shorter), reached).value
        duration = plan.goal.minimise == "duration"
        answer = found.plan.flight.duration if duration else dbm(found.plan.powers[1])
        assert found.least is not None
        unit, flights = "s  " if duration else "dBm", found.least.optimizations
        print(
            f"{name:28}  {answer:6.2f} {unit}  {flights:5} {ratio:5.1f}  "
            f"{shorter.needed_rate:.4f}      {reached:.4f}  "
            f"{from_random(shorter, options.starts):.4f}  {bound:.4f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
