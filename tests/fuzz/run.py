"""Fuzz for long, by one command: `python tests/fuzz/run.py --cases 1000000`.

The cases are shared out equally among the targets, or go to those that are named. Each finding is
added to `corpus/`, which the suite reads from then on; the exit status is 1 where there was one.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from harness import Finding, fuzz

_BATCH = 10_000
"""Cases between two lines of progress; each batch has a seed of its own."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1_000_000, help="of all targets together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("targets", nargs="*", help="names; all without")
    asked, findings = parser.parse_args(), 0

    tests = Path(__file__).parents[1]
    sys.path += [str(tests), str(tests / "wire")]  # what the tests share
    from targets import targets
    from wire_targets import wire_targets

    with tempfile.TemporaryDirectory() as directory:
        found = targets(Path(directory)) | wire_targets()
        names = asked.targets or list(found)
        cases = -(-asked.cases // len(names))
        for name in names:
            counts, started = Counter[str](), time.process_time()
            for number in range(0, cases, _BATCH):
                try:
                    counts += fuzz(found[name], min(_BATCH, cases - number), asked.seed + number)
                except Finding as finding:
                    findings += 1
                    print(f"{finding!s:.500}", flush=True)
                took = time.process_time() - started
                print(f"{name}: {dict(counts)}, {took:.0f} s of processor time", flush=True)
    return min(findings, 1)


if __name__ == "__main__":
    sys.exit(main())
