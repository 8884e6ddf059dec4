"""What plans that nobody chose cost, whole commands: any alphabet, antennas, fading, ends, powers.

    python benchmarks/any_plan.py [--plans FIRST,COUNT] [--limit SECONDS]

One row for each plan: seconds of the processor, Python's start included; the plan; the greatest of
its constraints' residuals and how the search ended, or how it was refused. Then the median, 90 and
99 % of the seconds. Status 1 where one took longer than the limit, ended in a traceback or broke a
constraint by more than `ALLOWED`.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from random import Random

import numpy as np
from processors import random_plan

from faao_mav.plan.yaml_text import dump_yaml, load_yaml

ALLOWED = 1e-6

STATIONS = ("base_station", "relay", "ground_user")


def planned(text: str, limit: float) -> tuple[float, str, bool]:
    """Return the processor's seconds for a plan, what is told of it, and whether all is well."""
    with tempfile.TemporaryDirectory() as folder:
        plan, out = Path(folder) / "plan.yaml", Path(folder) / "mission.waypoints"
        plan.write_text(text)
        command = [sys.executable, "-m", "faao_mav", str(plan), "--json", "--force", "--out"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        try:
            run = subprocess.run(
                [*command, str(out)], capture_output=True, text=True, check=False, timeout=limit
            )
        except subprocess.TimeoutExpired:
            return limit, "no end", False
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if not run.stdout.strip():
        return seconds, run.stderr.strip().splitlines()[-1], "Traceback" not in run.stderr
    told = json.loads(run.stdout)
    worst = max(told["residuals"].values())
    return seconds, f"{worst:.0e}  {told['ending']}", worst <= ALLOWED


def main() -> int:
    """Print a row for each plan, then the seconds of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", default="0,200", metavar="FIRST,COUNT", help="seeds")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds of the world for each")
    asked = parser.parse_args()
    first, count = map(int, asked.plans.split(","))
    costs, failed = [], 0
    for seed in range(first, first + count):
        random, data = Random(1000 + seed), load_yaml(random_plan(seed), "drawn")
        radio, flight = data["radio"], data["flight"]
        radio["modulation"] = random.choice(("bpsk", "qpsk", "8psk", "16qam", "64qam"))
        many = 2 if radio["modulation"] in ("16qam", "64qam") else 3
        for name in STATIONS:
            radio[name]["antennas"] = random.randint(1, many)
        seconds, told, well = planned(dump_yaml(data), asked.limit)
        costs.append(seconds)
        failed += not well
        antennas = "/".join(str(radio[name]["antennas"]) for name in STATIONS)
        kind = f"{data['vehicle']['type']} {radio['modulation']} {antennas} {radio['fading']}"
        slots = round(flight["duration"] / flight["time_step"])
        print(f"{seed:4d} {seconds:6.1f} s  {kind:32} {slots:4d} slots  {told}", flush=True)
    median, most, nearly_all = np.percentile(costs, [50, 90, 99])
    print(f"{median:.2f}, {most:.2f}, {nearly_all:.2f} s at 50, 90 and 99 %; {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
