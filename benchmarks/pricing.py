"""Print the processor time and stated error of the mutual information along the copter's sample.

    python benchmarks/pricing.py [--before CHECKOUT] [MODULATION ...]

With `--before` the same is run with the package of another checkout, by its `.venv`, on the same
solutions.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from faao_mav import optimize, parse_plan, price, saturation
from faao_mav.optimizer.solution import load_solution, save_solution

_HERE = Path(__file__).resolve()
_SAMPLE = _HERE.parents[1] / "missions" / "copter_relay.yaml"


def measure(path: str) -> None:
    """Print one row: CPU seconds of ``price`` and ``saturation``, both rates and their error."""
    solution = load_solution(path)
    start = time.process_time()
    found = price(solution)
    priced = time.process_time()
    saturation(solution)
    print(
        f"{solution.plan.radio.modulation:6} price {priced - start:7.2f} s  "
        f"saturation {time.process_time() - priced:6.2f} s  "
        f"{found.bs_uav:.4f} {found.uav_user:.4f} ± {found.error:.4f} bit/s/Hz",
        flush=True,
    )


def main() -> None:
    """Optimise the sample with each alphabet, and measure here and before."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--solution", help=argparse.SUPPRESS)
    parser.add_argument("modulations", nargs="*", default=["qpsk", "8psk", "16qam"])
    chosen = parser.parse_args()
    if chosen.solution:
        measure(chosen.solution)
        return
    text = _SAMPLE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        for modulation in chosen.modulations:
            path = f"{folder}/{modulation}.npz"
            changed = re.sub(r"modulation: \w+", f"modulation: {modulation}", text)
            save_solution(optimize(parse_plan(changed)), path)
            where = [] if chosen.before is None else [("before", chosen.before)]
            for name, root in [*where, ("after", None)]:
                python = sys.executable if root is None else str(root / ".venv/bin/python")
                print(f"{name:6} ", end="", flush=True)
                subprocess.run([python, _HERE, "--solution", path], cwd=root, check=True)


if __name__ == "__main__":
    main()
