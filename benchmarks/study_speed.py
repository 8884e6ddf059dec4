"""Plans per minute of a study: `python benchmarks/study_speed.py [--quick]`.

The grid of `missions/paper_fig4.yaml`, with one process and with two, without a directory. Rows
have to be the same. The time is that of the whole study, the start of the processes included.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

from faao_mav.plan import read_plan
from faao_mav.study import StudyCase, StudyRow, make_cases, run_study

PLAN = Path(__file__).parents[1] / "missions" / "paper_fig4.yaml"


def cases(seeds: int) -> tuple[StudyCase, ...]:
    plan = read_plan(PLAN)
    assert plan.study is not None
    return make_cases(
        plan.text, vary=plan.study.vary, schemes=plan.study.schemes, seeds=seeds, source=str(PLAN)
    )


def timed(grid: tuple[StudyCase, ...], jobs: int) -> tuple[float, list[StudyRow]]:
    started = time.perf_counter()
    rows = run_study(grid, jobs=jobs)
    return time.perf_counter() - started, [replace(row, seconds=None) for row in rows]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="a quarter of it")
    grid = cases(1 if parser.parse_args().quick else 4)
    run_study(grid[:1], jobs=1)  # imports are not counted
    found = {}
    for jobs in (1, 2):
        seconds, found[jobs] = timed(grid, jobs)
        print(f"--jobs {jobs}: {len(grid)} plans in {seconds:.1f} s, "
              f"{60 * len(grid) / seconds:.0f} a minute")  # fmt: skip
    print("the same rows" if found[1] == found[2] else "THE ROWS DIFFER")


if __name__ == "__main__":
    main()
