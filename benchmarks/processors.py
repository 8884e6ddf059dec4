"""Whether other processors find the same optima: samples and random plans.

    python benchmarks/processors.py [--plans 20] [NAME ...]

Each plan is planned and converted anew by the command for each of `PROCESSORS`, as OpenBLAS and
NumPy let this machine pass for another one of its family. One row for each plan: the items, and for
each other processor whether its mission has the same bytes as this one's, and its rate less this
one's, as a share. Status 1 where a rate is more than `SAME_RATE` apart. NAMEs choose plans.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from faao_mav.plan.yaml_text import dump_yaml

SAMPLES = Path(__file__).parents[1] / "missions"

SAME_RATE = 1e-6
"""How far the rates of one plan may be apart on two processors, as a share: what is promised."""

_FOUND = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
_NUMPY_NARROW = {"NPY_DISABLE_CPU_FEATURES": " ".join(_FOUND)}
_OPENBLAS_NARROW = {"OPENBLAS_CORETYPE": "Nehalem"}

NARROW = _NUMPY_NARROW | _OPENBLAS_NARROW
"""The environment in which NumPy and OpenBLAS know of no AVX."""

PROCESSORS = {
    "OpenBLAS for Nehalem": _OPENBLAS_NARROW,
    "NumPy without AVX": _NUMPY_NARROW,
    "both": NARROW,
}
"""The environment in which the program takes this processor for another one."""


def random_radio(
    random: Random, place: Callable[[], list[int]], causal: bool, duplex: Callable[[], str]
) -> dict[str, Any]:
    """Return the radio of a plan: its stations by `place`, where the relay is causal a `duplex`."""
    return {
        "base_station": {"position": place(), "power_dbm": random.choice((8, 12, 20))},
        "relay": {"power_dbm": random.choice((8, 12, 20)), "noise_dbm": -80},
        "ground_user": {"position": place(), "noise_dbm": -80},
        "modulation": random.choice(("bpsk", "qpsk")),
        "causal": causal,
        "duplex": duplex() if causal else "full",
        "fading": random.choice(("ergodic", "none", "realization")),
    }


def random_plan(seed: int) -> str:
    """Return the YAML of a plan of which little is fixed: every fourth one is for a plane."""
    random, kind = Random(seed), seed % 4
    plane, extent = kind == 3, 500 if kind == 3 else random.choice((250, 350))

    def place() -> list[int]:
        return [random.randrange(extent), random.randrange(extent)]

    causal = random.random() < 0.5
    fastest = {"max_speed": random.choice((8, 10, 12)), "max_acceleration": random.choice((1.5, 3))}
    vehicle = {"max_speed": 22, "max_acceleration": 4, "min_speed": 14} if plane else fastest
    named = {
        "autopilot": "px4" if kind == 2 else "ardupilot",
        "type": "plane" if plane else "copter",
    }
    free = {"start_velocity": "free", "end_velocity": "free"} if plane else {}
    origin = {"latitude": random.uniform(-60, 60), "longitude": 8.5}
    flight = {
        "start": place(),
        "end": place(),
        "altitude": random.choice((60, 100)),
        "duration": random.choice((80, 100, 120)),
        "time_step": random.choice((0.25, 0.5)),
        **free,
    }
    radio = random_radio(random, place, causal, lambda: random.choice(("full", "half")))
    whole = {"site": {"origin": origin}, "vehicle": named | vehicle, "flight": flight}
    return dump_yaml(whole | {"radio": radio})


def planned(plan: Path, environment: dict[str, str]) -> tuple[bytes, float]:
    """Return the mission file for `plan` and the rate that was maximised, bit/s/Hz.

    Where there is no mission, what the program says instead, and nan.
    """
    own = {name: value for name, value in os.environ.items() if name not in NARROW}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "mission.waypoints"
        program = "from faao_mav.cli.main import run; run()"
        told = subprocess.run(
            [sys.executable, "-c", program, str(plan), "--out", str(out), "--json", "--force"],
            env=own | environment,
            capture_output=True,
            check=False,
        )
        if not out.exists():
            return told.stderr, math.nan
        data = json.loads(told.stdout)
        return out.read_bytes(), data["delivered_rate" if data["causal"] else "average_rate"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=20, help="random plans beside the samples")
    parser.add_argument("names", nargs="*", help="of the plans; all without")
    asked = parser.parse_args()
    differ = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(asked.plans):
            (Path(folder) / f"random {seed}.yaml").write_text(random_plan(seed))
        for plan in (*sorted(SAMPLES.glob("*.yaml")), *sorted(Path(folder).glob("*.yaml"))):
            if asked.names and plan.stem not in asked.names:
                continue
            first, rate = planned(plan, {})
            told = []
            for name, environment in PROCESSORS.items():
                other, its_rate = planned(plan, environment)
                apart = its_rate / rate - 1
                same = other == first
                differ += not (same or abs(apart) <= SAME_RATE)
                told.append(f"{name}: {'same bytes' if same else f'DIFFERS, rate {apart:+.1e}'}")
            items = len(first.splitlines()) - 1
            print(f"{plan.stem}: {items} items; {', '.join(told)}", flush=True)
    print(f"{differ} rates differ")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
