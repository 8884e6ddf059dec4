"""Plans with a fence: the direct method beside CasADi + IPOPT from random starts, in one run.

    pip install -e '.[bench]'
    python benchmarks/fences.py [--starts N] [--step S] [NAME ...]

The scenarios are those of the tests (tests/fenced.py). IPOPT has the same constraints: an angle for
every obstacle and interval, whose half-plane parts both ends of the chord from the obstacle. Its
starts fly the shortest way by a random place. Rates are delivered rates in bit/s/Hz, of both by the
same function from the positions alone; times are seconds of the processor. Everything printed is
measured in the run; a flight of the peer counts where it keeps every limit to 1e-4.
"""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as the command does
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from fenced import FENCES, dense_path, fenced
from peer import delivered

from faao_mav.optimizer.design import design
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.starts import along, shortest_by

KEPT = 1e-4
"""What the peer may violate of a limit, SI units."""


def random_starts(problem: Problem, tries: int) -> Iterator[Trajectory]:
    """Yield feasible flights, each by way of a place at random that time allows."""
    area, kin, rng = problem.free_area, problem.kinematics, np.random.default_rng(0)
    assert area is not None
    places = np.stack([kin.start, kin.end, *(link.gains.station for link in problem.links)])
    for place in rng.uniform(places.min(axis=0) - 60, places.max(axis=0) + 60, (tries, 2)):
        inside = area.covers(place[None])[0]
        way = shortest_by(area, [kin.start, place, kin.end]) if inside else None
        flight = None if way is None else along(kin, way, problem.constraints(kin))
        if flight is not None:
            yield flight


def main() -> None:
    """Print the table, then the least margin and ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[""], help="parts of the names of scenarios")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--step", type=float, default=1.5)
    given = parser.parse_args()
    print(f"{'fence':36}{'direct':>9}{'s':>7}{'clear':>8}{'IPOPT':>9}{'s':>8}{'kept':>6}  ratio")
    ratios, clearances = [], []
    for name in FENCES:
        if not any(part in name for part in given.names):
            continue
        plan = fenced(name, **{"flight.time_step": given.step})
        problem, area = build_problem(plan), plan.keep_in
        assert area is not None
        began = time.process_time()
        ours = optimize(plan)
        took = time.process_time() - began
        clearances.append(area.clearance(dense_path(ours.w, ours.v, ours.a, given.step)))
        flights = list(islice(random_starts(problem, 20 * given.starts), given.starts))
        reached, seconds = delivered(problem, rate_field(problem, design(plan)), flights, KEPT)
        best, kept = max(reached), sum(map(bool, reached))
        ratios.append(ours.delivered_rate / best if kept else np.nan)
        print(
            f"{name:36}{ours.delivered_rate:9.4f}{took:7.1f}{clearances[-1]:8.3f}{best:9.4f}"
            f"{sum(seconds):8.1f}{kept:3}/{len(flights)}{ratios[-1]:9.5f}",
            flush=True,
        )
    print(f"least margin {min(clearances):.4f} m, of 5; least ratio {np.nanmin(ratios):.5f}")


if __name__ == "__main__":
    main()
