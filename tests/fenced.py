"""Ten plans with a fence: what tests and the benchmark fly."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from conftest import MISSIONS, edited

from faao_mav.arrays import Real
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.yaml_text import load_yaml


def _random_polygons(count: int, seed: int) -> list[dict[str, Any]]:
    """Return polygons of 3 to 8 corners, star-shaped, away from the ends of the flight."""
    rng = np.random.default_rng(seed)
    zones: list[dict[str, Any]] = []
    while len(zones) < count:
        center, size = rng.uniform(-20, 370, 2), rng.uniform(8, 28)
        if min(np.hypot(*(center - end)) for end in ((0, 350), (350, 0))) < size + 12:
            continue
        corners = rng.integers(3, 9)
        angles = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.8, corners)) / corners
        radii = size * rng.uniform(0.5, 1, corners)
        corners_at = center + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        zones.append({"polygon": corners_at.tolist()})
    return zones


FILE = "tests/data/missions/fence_and_rally.plan"
ELSEWHERE = {
    "site.origin": {"latitude": 47.396, "longitude": 8.543, "elevation": 400},
    "flight.start": [20, 400],
    "flight.end": [420, 30],
}
"""Where the fence of `FILE` lies: 453 m by 445 m, with a circle of 25.5 m in the middle."""

FENCES: Mapping[str, dict[str, Any]] = {
    **load_yaml((MISSIONS.parent / "tests/data/fences/plans.yaml").read_text(), "plans.yaml"),
    "a fence from a file": {"file": str(MISSIONS.parent / FILE)},
    "forty random polygons": {"exclusion": _random_polygons(40, 7)},
}


def fenced(name: str, **changes: Any) -> Plan:
    """Return the sample plan of a copter, in steps of 0.5 s, with the fence of that name."""
    text = (MISSIONS / "copter_relay.yaml").read_text()
    own = ELSEWHERE if "file" in FENCES[name] else {}
    values = {"flight.time_step": 0.5, "fence": FENCES[name], **own, **changes}
    return parse_plan(edited(text, values), "plan.yaml")


def dense_path(w: Real, v: Real, a: Real, step: float, count: int = 20) -> Real:
    """Return the continuous path of a flight at `count` points per slot, (m, 2)."""
    t = np.arange(count)[:, None, None] * step / count
    points = (w[:-1] + v[:-1] * t + a[:-1] * t * t / 2).transpose(1, 0, 2).reshape(-1, 2)
    return np.vstack([points, w[-1:]])
