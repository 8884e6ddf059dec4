"""Fuzz for long, by one command: `python tests/fuzz/run.py --cases 1000000`.

The cases are shared out equally among the targets, or go to those that are named. Each finding is
added to `corpus/`, which the suite reads from then on; the exit status is 1 where there was one.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from harness import Finding, Target, fuzz

_BATCH = 10_000
"""Cases between two lines of progress; each batch has a seed of its own."""


def _at_random(target: Target, cases: int, seed: int) -> bool:
    """Run `cases` mutations and return whether none was a finding."""
    read, refused, findings, started = 0, 0, 0, time.process_time()
    for number in range(0, cases, _BATCH):
        batch = min(_BATCH, cases - number)
        try:
            counts = fuzz(target, batch, seed + number)
        except Finding as finding:
            findings += 1
            print(f"{finding!s:.500}", flush=True)
        else:
            read, refused = read + counts["read"], refused + counts["refused"]
        print(
            f"{target.name}: {read:,} read, {refused:,} refused, {findings} findings, "
            f"{time.process_time() - started:.0f} s of processor time",
            flush=True,
        )
    return not findings


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1_000_000, help="of all targets together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("targets", nargs="*", help="names; all without")
    asked = parser.parse_args()

    sys.path.append(str(Path(__file__).parents[1]))  # what the tests share
    from targets import targets
    from wire_targets import wire_targets

    with tempfile.TemporaryDirectory() as directory:
        found = targets(Path(directory)) | wire_targets()
        names = asked.targets or list(found)
        each = -(-asked.cases // len(names))
        sound = [_at_random(found[name], each, asked.seed) for name in names]
        return 0 if all(sound) else 1


if __name__ == "__main__":
    sys.exit(main())
