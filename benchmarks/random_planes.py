"""Random plans for planes: does the direct method converge, and does it refuse rightly?

    python benchmarks/random_planes.py [--plans 100] [--first 0] [--jobs 1]

One row for each plan: how the method ended, its rate and the best rate of its starts (bit/s/Hz),
steps, CPU seconds. A plan that is refused is given to CasADi + IPOPT, which looks for a flight that
keeps all limits from `TRIES` random ones. The last line counts: not converged, below a start of
its own, refused, and refused though IPOPT has a flight.
"""

import argparse
import sys
import time
from collections import Counter
from random import Random
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from joblib import Parallel, delayed
from processors import random_radio

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.plan import parse_plan
from faao_mav.plan.yaml_text import dump_yaml

TRIES = 12
"""Random flights that IPOPT starts from."""

_BELOW = 1e-4
"""bit/s/Hz by which a result may be below its starts: `optimizer.tolerance`."""


def random_plan(seed: int) -> str:
    """Return the YAML of a plan for a plane of which little is fixed."""
    random = Random(seed)
    extent = random.choice((200, 500, 1000))
    least = random.choice((8, 12, 15, 18))
    fastest = round(least * random.uniform(1.05, 2.0), 1)

    def place() -> list[int]:
        return [random.randrange(extent), random.randrange(extent)]

    def velocity() -> str | list[float]:
        if random.random() < 0.5:
            return "free"
        speed, angle = random.uniform(1.001 * least, fastest), random.uniform(-np.pi, np.pi)
        return [float(round(speed * x, 3)) for x in (np.cos(angle), np.sin(angle))]

    start = place()
    end = [*start] if random.random() < 0.25 else place()
    shortest = 1.2 * float(np.hypot(*np.subtract(end, start))) / fastest
    causal = random.random() < 0.75
    vehicle = {
        "type": "plane",
        "min_speed": least,
        "max_speed": fastest,
        "max_acceleration": random.choice((2, 3, 5)),
    }
    flight = {
        "start": start,
        "end": end,
        "altitude": random.choice((60, 100)),
        "duration": max(random.choice((30, 60, 120, 180, 240)), round(shortest)),
        "time_step": random.choice((0.2, 0.5, 1.0)),
        "start_velocity": velocity(),
        "end_velocity": velocity(),
    }
    radio = random_radio(
        random, place, causal, lambda: "half" if random.random() < 0.25 else "full"
    )
    site = {"origin": {"latitude": 47.0, "longitude": 8.5}}
    return dump_yaml({"site": site, "vehicle": vehicle, "flight": flight, "radio": radio})


class Row(NamedTuple):
    """How one plan ended; `rate` and `best_start` in bit/s/Hz, `possible` for a refused one."""

    seed: int
    told: str
    seconds: float
    converged: bool = False
    rate: float = 0.0
    best_start: float = 0.0
    possible: bool | None = None


def row(seed: int) -> Row:
    """Solve the plan of `seed`."""
    plan, began = parse_plan(random_plan(seed), f"random {seed}"), time.process_time()
    try:
        solution = optimize(plan)
    except InfeasibleError:
        flight = any_flight(build_problem(plan).kinematics, np.random.default_rng(seed))
        return Row(seed, "refused", time.process_time() - began, possible=flight is not None)
    seconds = time.process_time() - began
    assert solution.is_feasible(), solution.residuals()
    rate = solution.delivered_rate if plan.radio.causal else solution.rates.R_avg
    best = max(solution.starts.values())
    return Row(seed, solution.ending, seconds, solution.converged, rate, best)


def any_flight(kin: Kinematics, rng: np.random.Generator) -> Trajectory | None:
    """Return a flight that IPOPT finds in `kin` from random ones, which turn at random rates."""
    n, dt, opti = kin.slots, kin.time_step, ca.Opti()
    v = opti.variable(2, n)
    given = opti.parameter(2, n)
    opti.minimize(ca.sumsqr(v - given) / n)
    opti.subject_to(dt * ca.sum2(v[:, 1:] + v[:, :-1]) / 2 == kin.end - kin.start)
    speeds = ca.sum1(v**2)
    opti.subject_to(opti.bounded(kin.min_speed**2 * (1 + 1e-9), speeds, kin.max_speed**2))
    steps = (v[:, 1:] - v[:, :-1])[:, kin.first_bounded_acceleration :]
    opti.subject_to(ca.sum1(steps**2) <= (kin.max_acceleration * dt) ** 2)
    size, first = ca.sqrt(speeds), kin.first_bounded_acceleration
    opti.subject_to((size[:-1] - size[1:])[first:] <= kin.most_fall * dt)
    opti.subject_to((speeds[1:] - speeds[:-1])[first:] <= 2 * kin.most_power * dt)
    if kin.turn_binds:
        turned = (speeds[:-1] + speeds[1:])[first:] / 2 + kin.wind_in_turns**2
        opti.subject_to(ca.sum1(steps**2).T <= (kin.most_turn * dt) ** 2 * turned)
    for end, velocity in ((0, kin.start_velocity), (n - 1, kin.end_velocity)):
        if velocity is not None:
            opti.subject_to(v[:, end] == velocity)
    quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "max_iter": 500}
    silent: dict[str, Any] = {"print_time": False, "ipopt": quiet}
    opti.solver("ipopt", silent)
    for _ in range(TRIES):
        guess = _wandering(kin, rng)
        opti.set_initial(v, guess.T)
        opti.set_value(given, guess.T)
        try:
            found = opti.solve().value(v)
        except RuntimeError:
            continue
        flight = kin.follow(np.asarray(found).T)
        if max(kin.residuals(flight).values()) < 1e-6:
            return flight
    return None


def _wandering(kin: Kinematics, rng: np.random.Generator) -> Real:
    """Return velocities (n, 2) at one speed whose rate of turn changes a few times."""
    speed = rng.uniform(kin.min_speed, kin.max_speed)
    knots = np.linspace(0, kin.slots - 1, int(rng.integers(2, 6)))
    fastest = kin.max_acceleration * kin.time_step / speed
    rates = np.interp(np.arange(kin.slots), knots, rng.uniform(-fastest, fastest, len(knots)))
    begin = kin.start_velocity
    first = rng.uniform(-np.pi, np.pi) if begin is None else np.arctan2(begin[1], begin[0])
    theta = first + np.cumsum(rates)
    return np.asarray(speed * np.stack([np.cos(theta), np.sin(theta)], axis=1))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.plans)
    counts = Counter[str]()
    for each in Parallel(asked.jobs, return_as="generator")(delayed(row)(seed) for seed in seeds):
        solved = each.possible is None
        marks = {
            "NOT CONVERGED": solved and not each.converged,
            "BELOW A START": solved and each.rate < each.best_start - _BELOW,
            "REFUSED": not solved,
            "POSSIBLE": bool(each.possible),
        }
        counts.update({mark: int(here) for mark, here in marks.items()})
        ends = f"{each.rate:.4f} of {each.best_start:.4f}" if solved else ""
        told = " ".join(mark for mark, here in marks.items() if here)
        print(f"{each.seed:4} {each.seconds:6.1f} s  {ends:17}  {each.told} {told}", flush=True)
    print(", ".join(f"{count} {mark.lower()}" for mark, count in counts.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
