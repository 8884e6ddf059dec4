"""The direct method side by side with CasADi + IPOPT and with Algorithm 1, in one run.

    pip install -e '.[bench]'
    python benchmarks/direct_against_ipopt.py [--quick] [--random 20]

Rates are R_avg in bit/s/Hz, measured for all three by the same function; times are seconds, with
the building of the model. Everything printed is measured in the run.
"""

import argparse
import os
import resource
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as the command does

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from peer import GAIN, ROUNDS, Model, at_best, at_precoders, peer_starts
from random_flights import random_flight

from faao_mav.arrays import Real
from faao_mav.errors import PlanError
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import maximize, objective
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import RateField, rate_field
from faao_mav.optimizer.rates.slot_rate import FixedRate
from faao_mav.optimizer.search.bound import Bound, upper_bound
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.yaml_text import dump_yaml, load_yaml

MISSIONS = Path(__file__).parents[1] / "missions"
PATIENCE = 30.0
"""Seconds that the peer may take for one start."""
FLIGHTS = 10_000
"""Random flights that are held against the bounds, all plans together."""

claims: list[tuple[str, bool, str]] = []


def plan(name: str, **changes: Any) -> Plan:
    """Read a sample plan with `T`, `W`, `dt`, `modulation`, `fading` or `starts` replaced."""
    data = load_yaml((MISSIONS / f"{name}.yaml").read_text(), "test")
    data.setdefault("optimizer", {})["method"] = "direct"
    data["radio"]["causal"] = False  # the peers maximise R_avg
    for key, value in changes.items():
        if key == "T":
            data["flight"]["duration"] = value
        elif key == "dt":
            data["flight"]["time_step"] = value
        elif key == "W":
            data["radio"]["base_station"]["power_dbm"] = value
            data["radio"]["relay"]["power_dbm"] = value
        elif key == "starts":
            data["optimizer"]["starts"] = value
        else:
            data["radio"][key] = value
    return parse_plan(dump_yaml(data))


def timed(work: Callable[[], Any], times: int = 1) -> tuple[Any, float]:
    """Run `work` and return its result and the least of its times, s."""
    found, best = None, np.inf
    for _ in range(times):
        started = time.perf_counter()
        found = work()
        best = min(best, time.perf_counter() - started)
    return found, float(best)


def best_rate(problem: Problem, w: Real) -> float:
    """R_avg at the positions w with the best precoders."""
    means = []
    for link in problem.links:
        H = link.channel(w, link.small_scale(w))
        means.append(link.draw_rates(H, link.best(H[:, None])).mean())
    return float(min(means))


def by_ipopt(problem: Problem, random: int) -> float:
    """The best of IPOPT over the same starts; precoders in closed form or in alternation."""
    kin = problem.kinematics
    closed = all(k.modulation == "bpsk" and k.transmit == 2 for k in problem.links)

    def rates(w: Real) -> list[Any]:
        if closed:
            return [at_best(link, w) for link in problem.links]
        found = []
        for link in problem.links:
            H = link.channel(w, link.small_scale(w))
            P = link.best(H[:, None])
            found.append(at_precoders(link, w, P))
        return found

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


def rate_of(read: Plan) -> float:
    """R_avg by the plan's method."""
    return optimize(read).rates.R_avg


def peer_rate(read: Plan, random: int) -> float:
    """R_avg by IPOPT, the building of its model included."""
    return by_ipopt(build_problem(read), random)


def bound_of(read: Plan, reached: float) -> Bound:
    """What no route can exceed, where a plan has `reached` so much."""
    return upper_bound(build_problem(read), reached)


def quality(quick: bool, random: int) -> None:
    """R_avg and whole times on every scenario."""
    print(f"{'scenario':28}{'direct':>9}{'s':>7}{'Alg. 1':>9}{'s':>7}{'IPOPT':>9}{'s':>7}")
    rows: list[tuple[str, Plan, bool, bool]] = [
        (f"paper_active T={T} W={W}", plan("paper_active", T=T, W=W), True, True)
        for T in (10, 50, 100, 150)
        for W in (0, 10, 20)
        if not quick or (T, W) in ((10, 20), (50, 20))
    ]
    rows.append(("copter_relay, no fading", plan("copter_relay", fading="none"), not quick, True))
    for of_base, of_user in (((0, 0), (-5, 0)), ((0, 4), (0, 4)), ((0, 4), (-5, 0))):
        moving = plan("paper_active").changed({
            "radio.base_station.velocity": of_base, "radio.ground_user.velocity": of_user,
        })  # fmt: skip
        rows.append((f"at {of_base} and {of_user} m/s", moving, False, True))
    if not quick:
        qpsk = plan("paper_active", modulation="qpsk")
        rows.append(("paper_active T=50 qpsk", qpsk, True, True))
        qam = plan("paper_active", modulation="16qam", W=30)
        rows.append(("paper_active T=50 16qam W=30", qam, False, True))
        long = plan("paper_active", T=500, dt=0.05, starts=["straight"])
        rows.append(("10,000 slots, straight start", long, False, True))
    above_paper, above_peer, speedup = np.inf, np.inf, 0.0
    for name, read, with_paper, with_peer in rows:
        solution, seconds = timed(partial(optimize, read))
        ours = solution.rates.R_avg
        line = f"{name:28}{ours:9.4f}{seconds:7.2f}"
        paper = None
        if with_paper:
            paper_plan = read.changed({"optimizer.method": "algorithm1"})
            try:
                paper, took = timed(partial(rate_of, paper_plan))
            except PlanError:
                paper = None
        if paper is None:
            line += f"{'-':>9}{'-':>7}"
        else:
            line += f"{paper:9.4f}{took:7.1f}"
            above_paper = min(above_paper, ours - paper)
            if name == "paper_active T=50 W=20":
                speedup = took / seconds
        if with_peer:
            peer, took = timed(partial(peer_rate, read, random))
            line += f"{peer:9.4f}{took:7.2f}"
            above_peer = min(above_peer, ours - peer)
        print(line, flush=True)
        if "16qam" in name:
            claims.append(("16-QAM, T = 50, within 3 s", seconds <= 3, f"{seconds:.2f} s"))
    claims.append(("at least Algorithm 1", above_paper >= -1e-4, f"least gain {above_paper:.1e}"))
    claims.append(("at least IPOPT's best", above_peer >= -1e-4, f"least gain {above_peer:.1e}"))
    claims.append(("100 times Algorithm 1's speed", speedup >= 100, f"{speedup:.1f} times"))


def fixed_precoders(quick: bool) -> None:
    """The trajectory problem alone, from the straight flight."""
    print(f"\n{'fixed precoders':28}{'direct':>9}{'s':>8}{'IPOPT':>9}{'s':>8}{'ratio':>7}")
    cases: list[dict[str, Any]] = [{"T": 10}, {"T": 50}]
    if not quick:
        cases += [{"T": 100}, {"T": 150}, {"W": 0}, {"W": 10}, {"modulation": "qpsk"}]
        cases.append({"T": 500, "dt": 0.05})
    ratios = {}
    for case in cases:
        problem = build_problem(plan("paper_active", **case))
        kin, flight = problem.kinematics, straight_flight(problem.kinematics)
        precoders = []
        for link in problem.links:
            H = link.channel(flight.w, link.small_scale(flight.w))
            precoders.append(link.best(H[:, None]))
        pairs = list(zip(problem.links, precoders, strict=True))

        def own(
            pairs: Any = pairs, kin: Any = kin, flight: Any = flight, problem: Any = problem
        ) -> Any:
            held = tuple(FixedRate(k, P) for k, P in pairs)  # these samples have no steering
            field = RateField(problem.links, held)
            return maximize(kin, field, flight, tolerance=1e-6).trajectory

        def other(pairs: Any = pairs, kin: Any = kin, flight: Any = flight) -> Any:
            rates = [at_precoders(k, flight.w, P) for k, P in pairs]
            return Model(kin, rates, PATIENCE).solve(rates, flight)

        many = 1 if kin.slots > 1000 else 3
        ours, seconds = timed(own, many)
        theirs, took = timed(other, many)
        values = [
            min(k.rates(f.w, k.small_scale(f.w), P).mean() for k, P in pairs)
            for f in (ours, theirs)
        ]
        name = " ".join(f"{k}={v}" for k, v in case.items())
        ratios[name] = took / seconds
        print(
            f"{name:28}{values[0]:9.4f}{seconds:8.3f}{values[1]:9.4f}{took:8.3f}"
            f"{took / seconds:7.1f}",
            flush=True,
        )
    least = min(ratios.values())
    claims.append(("fixed precoders: quicker than IPOPT", least > 1, f"least ratio {least:.1f}"))
    named = {k: r for k, r in ratios.items() if k in ("T=50", "T=150")}
    claims.append(
        ("fixed precoders: twice at T = 50, 150", min(named.values()) >= 2,
         ", ".join(f"{k}: {r:.1f}" for k, r in named.items()))
    )  # fmt: skip


def growth() -> None:
    """Time and memory by the number of slots."""
    print(f"\n{'slots':>8}{'s':>8}{'us/slot':>9}")
    for slots in (250, 1000, 2500, 5000, 10_000):
        read = plan("paper_active", dt=50 / slots, starts=["straight"])
        _, seconds = timed(partial(optimize, read))
        print(f"{slots:8}{seconds:8.2f}{1e6 * seconds / slots:9.0f}", flush=True)


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
        found, seconds = timed(partial(bound_of, read, reached))
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
    quick = options.quick
    quality(quick, options.random)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    fixed_precoders(quick)
    if not quick:
        growth()
    bound(quick)
    print(f"\nmemory up to the first table's end, peer included: {memory:.2f} GB")
    for claim, met, figure in claims:
        print(f"{'met' if met else 'MISSED':8}{claim}: {figure}")


if __name__ == "__main__":
    main()
