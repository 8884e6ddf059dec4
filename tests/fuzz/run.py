"""Fuzz for long, by one command: `python tests/fuzz/run.py --cases 1000000`.

The cases are shared out equally among the targets, or go to those that are named. Each finding is
added to `corpus/`, which the suite reads from then on; the exit status is 1 where there was one.
With `--coverage` atheris, where it is installed, mutates further what has reached new code.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from random import Random

from harness import Finding, Target, fuzz, keep, outcome

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


def _by_coverage(target: Target, cases: int, seed: int) -> None:
    """Let atheris run `cases` on `target`, and end the process: status 0 without a finding."""
    import atheris

    def read(content: bytes) -> None:
        try:
            outcome(target, content)
        except Finding:
            keep(target, content)
            raise

    def mutate(content: bytes, most: int, number: int) -> bytes:
        return target.mutate(content, target.seeds, Random(number))[:most]

    with tempfile.TemporaryDirectory() as corpus:
        for number, content in enumerate((*target.seeds, *target.corpus)):
            (Path(corpus) / str(number)).write_bytes(content)
        options = [f"-runs={cases}", f"-seed={seed}", "-max_len=20000", "-verbosity=0"]
        atheris.Setup(["fuzz", *options, corpus], read, custom_mutator=mutate)
        atheris.Fuzz()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1_000_000, help="of all targets together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--coverage", action="store_true", help="mutate by coverage (atheris)")
    parser.add_argument("targets", nargs="*", help="names; all without")
    asked = parser.parse_args()

    sys.path.append(str(Path(__file__).parents[1]))  # what the tests share
    if asked.coverage:
        import atheris

        with atheris.instrument_imports(include=["faao_mav"]):
            from targets import targets
            from wire_targets import wire_targets
    else:
        from targets import targets
        from wire_targets import wire_targets

    with tempfile.TemporaryDirectory() as directory:
        found = targets(Path(directory)) | wire_targets()
        names = asked.targets or list(found)
        each = -(-asked.cases // len(names))
        if not asked.coverage:
            sound = [_at_random(found[name], each, asked.seed) for name in names]
            return 0 if all(sound) else 1
        if len(names) == 1:
            _by_coverage(found[names[0]], each, asked.seed)
    command = [sys.executable, __file__, "--coverage", f"--cases={each}", f"--seed={asked.seed}"]
    return max(subprocess.run([*command, name], check=False).returncode for name in names)


if __name__ == "__main__":
    sys.exit(main())
