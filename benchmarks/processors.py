"""Whether other processors write the same missions: samples and random plans, byte for byte.

    python benchmarks/processors.py [--plans 20] [NAME ...]

Each plan is planned and converted anew by the command for each of `PROCESSORS`, as OpenBLAS and
NumPy let this machine pass for another one of its family. One row for each plan: the items, and for
each processor whether its mission file has the same bytes as the first one's. Status 1 where one
has not. NAMEs choose plans.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from random import Random

import numpy as np

from faao_mav.plan.yaml_text import dump_yaml

SAMPLES = Path(__file__).parents[1] / "missions"

_VECTORS = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
PROCESSORS = {
    "this one": {},
    "Nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
    "NumPy without AVX-512": {
        "NPY_DISABLE_CPU_FEATURES": " ".join(each for each in _VECTORS if each != "X86_V3")
    },
    "NumPy without AVX2": {"NPY_DISABLE_CPU_FEATURES": " ".join(_VECTORS)},
}
"""The environment in which the program takes this processor for another one."""


def random_plan(seed: int) -> str:
    """Return the YAML of a plan of which little is fixed: every fourth one is for a plane."""
    random, kind = Random(seed), seed % 4
    plane, extent = kind == 3, 500 if kind == 3 else random.choice((250, 350))

    def place() -> list[int]:
        return [random.randrange(extent), random.randrange(extent)]

    causal = random.random() < 0.5
    fastest = {"max_speed": random.choice((8, 10, 12)), "max_acceleration": random.choice((1.5, 3))}
    vehicle = {"max_speed": 22, "max_acceleration": 4, "min_speed": 14} if plane else fastest
    free = {"start_velocity": "free", "end_velocity": "free"} if plane else {}
    return dump_yaml(
        {
            "site": {"origin": {"latitude": random.uniform(-60, 60), "longitude": 8.5}},
            "vehicle": {
                "autopilot": "px4" if kind == 2 else "ardupilot",
                "type": "plane" if plane else "copter",
                **vehicle,
            },
            "flight": {
                "start": place(),
                "end": place(),
                "altitude": random.choice((60, 100)),
                "duration": random.choice((80, 100, 120)),
                "time_step": random.choice((0.25, 0.5)),
                **free,
            },
            "radio": {
                "base_station": {"position": place(), "power_dbm": random.choice((8, 12, 20))},
                "relay": {"power_dbm": random.choice((8, 12, 20)), "noise_dbm": -80},
                "ground_user": {"position": place(), "noise_dbm": -80},
                "modulation": random.choice(("bpsk", "qpsk")),
                "causal": causal,
                "duplex": random.choice(("full", "half")) if causal else "full",
                "fading": random.choice(("ergodic", "none", "realization")),
            },
        }
    )


def mission(plan: Path, environment: dict[str, str]) -> bytes:
    """Return the mission file for `plan`, or what the program says instead of one."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "mission.waypoints"
        program = "from faao_mav.cli.main import run; run()"
        told = subprocess.run(
            [sys.executable, "-c", program, str(plan), "--out", str(out), "--quiet", "--force"],
            env=os.environ | environment,
            capture_output=True,
            check=False,
        )
        return out.read_bytes() if out.exists() else told.stderr


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
            first, *others = (mission(plan, each) for each in PROCESSORS.values())
            same = [other == first for other in others]
            told = ", ".join(
                f"{name}: {'same' if is_same else 'DIFFERS'}"
                for name, is_same in zip(list(PROCESSORS)[1:], same, strict=True)
            )
            print(f"{plan.stem}: {len(first.splitlines()) - 1} items; {told}", flush=True)
            differ += not all(same)
    print(f"{differ} plans differ")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
