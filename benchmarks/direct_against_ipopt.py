"""The direct method side by side with CasADi + IPOPT and with Algorithm 1, in one run.

    pip install -e '.[bench]'
    python benchmarks/direct_against_ipopt.py [--quick] [--random 20]

Rates are R_avg in bit/s/Hz, measured for all three by the same function; times are seconds, with
the building of the model. Everything printed is measured in the run.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as the command does

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from peer import GAIN, ROUNDS, Model, at_best, at_precoders, peer_starts, sample
from random_flights import random_flight

from faao_mav.arrays import Real
from faao_mav.errors import PlanError
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.plan import Plan

KEYS = (
    {"T": "flight.duration", "dt": "flight.time_step", "W": "power"}
    | {key: f"radio.{key}" for key in ("modulation", "fading", "causal", "duplex", "gain")}
    | {"starts": "optimizer.starts"}
)
PATIENCE = 30.0
"""Seconds that the peer may take for one start."""
FLIGHTS = 10_000
"""Random flights that are held against the bounds, all plans together."""

claims: list[tuple[str, bool, str]] = []


def plan(name: str, **changes: Any) -> Plan:
    """Read a sample plan; the peers maximise R_avg."""
    return sample(name, {"radio.causal": False} | {KEYS.get(k, k): v for k, v in changes.items()})


def timed(work: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """Run `work` and return its result and its time, s."""
    started = time.perf_counter()
    found = work(*arguments)
    return found, time.perf_counter() - started


def best_rate(problem: Problem, w: Real) -> float:
    """R_avg at the positions w with the best precoders."""
    means = []
    for link in problem.links:
        H = link.channel(w)
        means.append(link.draw_rates(H, link.best(H[:, None])).mean())
    return float(min(means))


def by_ipopt(problem: Problem, random: int) -> float:
    """The best of IPOPT over the same starts; precoders in closed form or in alternation."""
    kin = problem.kinematics
    closed = all(k.modulation == "bpsk" and k.transmit == 2 for k in problem.links)

    def rates(w: Real) -> list[Any]:
        if closed:
            return [at_best(link, w) for link in problem.links]
        best = ((link, link.best(link.channel(w)[:, None])) for link in problem.links)
        return [at_precoders(link, w, P) for link, P in best]

    model, best = None, 0.0
    for flight in peer_starts(problem, random).values():
        reached = 0.0
        for _ in range(1 if closed else ROUNDS):
            now = rates(flight.w)
            model = model or Model(kin, now, PATIENCE)
            flight = model.solve(now, flight)
            rate = best_rate(problem, flight.w)
            if rate < reached + GAIN:
                break
            reached = rate
        best = max(best, reached)
    return best


def quality(quick: bool, random: int) -> None:
    """R_avg and whole times on every scenario."""
    print(f"{'scenario':28}{'direct':>9}{'s':>7}{'Alg. 1':>9}{'s':>7}{'IPOPT':>9}{'s':>7}")
    rows: list[tuple[str, Plan, bool]] = [
        (f"paper_active T={T} W={W}", plan("paper_active", T=T, W=W), True)
        for T in (10, 50, 100, 150)
        for W in (0, 10, 20)
        if not quick or (T, W) in ((10, 20), (50, 20))
    ]
    rows.append(("copter_relay, no fading", plan("copter_relay", fading="none"), not quick))
    for of_base, of_user in (((0, 0), (-5, 0)), ((0, 4), (0, 4)), ((0, 4), (-5, 0))):
        moving = plan("paper_active").changed({
            "radio.base_station.velocity": of_base, "radio.ground_user.velocity": of_user,
        })  # fmt: skip
        rows.append((f"at {of_base} and {of_user} m/s", moving, False))
    if not quick:
        qpsk = plan("paper_active", modulation="qpsk")
        rows.append(("paper_active T=50 qpsk", qpsk, True))
        qam = plan("paper_active", modulation="16qam", W=30)
        rows.append(("paper_active T=50 16qam W=30", qam, False))
        long = plan("paper_active", T=500, dt=0.05, starts=["straight"])
        rows.append(("10,000 slots, straight start", long, False))
    above_paper, above_peer, speedup = np.inf, np.inf, 0.0
    for name, read, with_paper in rows:
        solution, seconds = timed(optimize, read)
        ours = solution.rates.R_avg
        line, told = f"{name:28}{ours:9.4f}{seconds:7.2f}", f"{'-':>9}{'-':>7}"
        with suppress(PlanError):
            if with_paper:
                found, took = timed(optimize, read.changed({"optimizer.method": "algorithm1"}))
                told = f"{found.rates.R_avg:9.4f}{took:7.1f}"
                above_paper = min(above_paper, ours - found.rates.R_avg)
                if name == "paper_active T=50 W=20":
                    speedup = took / seconds
        peer, took = timed(by_ipopt, build_problem(read), random)
        above_peer = min(above_peer, ours - peer)
        line += f"{told}{peer:9.4f}{took:7.2f}"
        print(line, flush=True)
        if "16qam" in name:
            claims.append(("16-QAM, T = 50, within 3 s", seconds <= 3, f"{seconds:.2f} s"))
    claims.append(("at least Algorithm 1", above_paper >= -1e-4, f"least gain {above_paper:.1e}"))
    claims.append(("at least IPOPT's best", above_peer >= -1e-4, f"least gain {above_peer:.1e}"))
    claims.append(("ten times Algorithm 1's speed", speedup >= 10, f"{speedup:.1f} times"))


def best_of_others(read: Plan, count: int) -> float:
    """The best of `count` random flights and one optimised from each of the named starts."""
    problem = build_problem(read)
    kin, free = problem.kinematics, problem.free_area
    flights = [random_flight(kin, seed).w for seed in range(count)]
    if free is not None:
        flights = [w for w in flights if free.clearance(w) >= 0]
    for start in ("straight", "bs", "user", "bs-user", "user-bs", "global"):
        try:
            flights.append(optimize(read.changed({"optimizer.starts": [start]})).w)
        except PlanError:  # too little time for this one
            continue
    field, best = rate_field(problem, design(read)), 0.0
    for first in range(0, len(flights), 100):
        rates = field.value(np.stack(flights[first : first + 100]).transpose(2, 0, 1))
        values = [
            objective(values, kin, problem.maximised_queue) for values in rates.swapaxes(0, 1)
        ]
        best = max(best, max(values))
    return best


def bound(quick: bool) -> None:
    """What no route can exceed."""
    print(f"\n{'bound':64}{'rate':>9}{'bound':>9}{'gap %':>7}{'s':>7}")
    gaps, above = [], []
    rows: list[tuple[str, dict[str, Any]]] = [
        ("paper_active", {"T": T, "W": W}) for T in (50, 150) for W in (20, 10)
    ]
    rows += [("copter_relay", {"causal": causal}) for causal in (False, True)]
    rows.append(("copter_relay", {"causal": True, "duplex": "half"}))
    rows.append(("fenced_relay", {"causal": True}))
    for law in ({"elevation_db": [18, -30, 10]}, {"elevation_db": [0, 0, -40]}, {"exponent": 2.6}):
        rows.append(("copter_relay", {"causal": True, "gain": law}))
    for name, changes in rows[:1] if quick else rows:
        read = plan(name, **changes)
        solution = optimize(read)
        reached = solution.delivered_rate if read.radio.causal else solution.rates.R_avg
        found, seconds = timed(upper_bound, build_problem(read), reached)
        gaps.append(100 * (found.value / reached - 1))
        above.append(best_of_others(read, -(-FLIGHTS // len(rows))) / found.value)
        row = " ".join([name, *(f"{key}={value}" for key, value in changes.items())])
        print(f"{row:64}{reached:9.4f}{found.value:9.4f}{gaps[-1]:7.2f}{seconds:7.1f}", flush=True)
    claims.append(("bound within 1 % at T=50, W=20", gaps[0] <= 1, f"{gaps[0]:.2f} %"))
    claims.append(
        ("no flight above its bound", max(above) <= 1, f"nearest: {max(above):.4f} of it")
    )


def main() -> None:
    """Print all tables, then which claims hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few rows of each table")
    parser.add_argument("--random", type=int, default=0, help="random starts of the peer, too")
    options = parser.parse_args()
    quality(options.quick, options.random)
    bound(options.quick)
    for claim, met, figure in claims:
        print(f"{'met' if met else 'MISSED':8}{claim}: {figure}")


if __name__ == "__main__":
    main()
