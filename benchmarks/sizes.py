"""Print what whole plans of many sizes cost: seconds of the processor and memory.

    python benchmarks/sizes.py

Each plan is the copter's sample with its alphabet, antennas, fading and time step changed, in a
process of its own.
"""

import argparse
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as the command does

from faao_mav import plan_mission, read_plan

_SAMPLE = Path(__file__).resolve().parents[1] / "missions" / "copter_relay.yaml"

_SIZES = (
    "qpsk 2 ergodic 0.5",
    "16qam 2 ergodic 0.5",
    "64qam 2 ergodic 0.5",
    "8psk 3 ergodic 0.5",
    "16qam 3 ergodic 0.5",
    "qpsk 4 ergodic 0.5",
    "bpsk 6 ergodic 0.5",
    "64qam 2 none 0.5",
    "64qam 2 realization 0.5",
    "qpsk 3 realization 0.5",
    "bpsk 4 realization 0.5",
    "bpsk 2 ergodic 0.12",
    "bpsk 2 ergodic 0.012",
    "bpsk 2 ergodic 0.0012",
)


def measure(size: str) -> None:
    """Print one row, of alphabet, antennas, fading and time step, s: what it takes, and R_del."""
    modulation, antennas, fading, step = size.split()
    ends = ("base_station", "relay", "ground_user")
    plan = read_plan(_SAMPLE).changed(
        {"radio.modulation": modulation, "radio.fading": fading, "flight.time_step": float(step)}
        | {f"radio.{end}.antennas": int(antennas) for end in ends}
    )
    result = plan_mission(plan)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(
        f"{size:24} {plan.flight.slots:7,} slots  {time.process_time():6.1f} s  {peak:5.2f} GB  "
        f"{result.solution.delivered_rate:.4f} bit/s/Hz",
        flush=True,
    )


def main() -> None:
    """Measure each size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.size:
        measure(chosen.size)
        return
    for size in _SIZES:
        subprocess.run([sys.executable, __file__, "--size", size], check=True)


if __name__ == "__main__":
    main()
