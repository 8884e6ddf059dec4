"""Twelve synthetic sites with ridges: flights over maps of the gain, beside what they could be.

    python benchmarks/terrain_sites.py [SEED ...]

A site has three to five ridges, stations on the ground on both sides, and a map of the gain of each
hop: free space at 2.4 GHz less the loss of the worst knife edge in the way. Told for each: what the
flight delivers; its share of the best by dynamic programming over places and the queue's level,
which knows the greatest speed and no acceleration, on a grid whose directions cost it up to 2 %;
what the flight of the plan that knows no terrain delivers in truth; the bound; the least way to
ground, m; seconds. Every third relay is half duplex; from seed 100 on a plane flies, whose least
speed the paths over places do not know.
"""

import statistics
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from faao_mav import Plan, Solution, optimize, read_plan
from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.map_file import map_archive
from faao_mav.radio.terrain import knife_edge_loss
from faao_mav.schedule.prediction import rates_along

SEEDS, PLANES = range(12), 100
WAVELENGTH, MAST = 0.125, 2.0
PLAN = """
site: {{origin: {{latitude: -35.36, longitude: 149.17, elevation: 584}}}}
vehicle: {{{vehicle}}}
flight: {{start: {start}, end: {end}, altitude: {altitude}, duration: {duration}{velocity}}}
radio:
  fading: none
  duplex: {duplex}
  modulation: qpsk
  reference_gain_db: -40
  base_station: {{position: {bs}, power_dbm: {power}{bs_map}}}
  relay: {{power_dbm: {power}, noise_dbm: -95}}
  ground_user: {{position: {user}, noise_dbm: -95{user_map}}}
mission: {{path_tolerance: 3}}
"""
COPTER = "type: copter, max_speed: 12, max_acceleration: 2.5"
PLANE = "type: plane, min_speed: 13, max_speed: 16, max_acceleration: 3"


Ridge: TypeAlias = tuple[float, Real, float, float, float]
"""Height, middle, direction, half the length, and width of a ridge, m."""


@dataclass(frozen=True)
class Site:
    """The ridges of a site, its plan, and the plan that knows no terrain."""

    ridges: list[Ridge]
    plan: Plan
    plain: Plan

    @classmethod
    def of(cls, seed: int, folder: Path) -> "Site":
        """Return the site of a `seed`, its files in `folder`."""
        rng = np.random.default_rng(seed)
        size, points = float(rng.uniform(500, 1500)), int(rng.integers(60, 200))
        altitude = round(float(rng.uniform(60, 100)), 1)
        ridges = [
            (
                float(rng.uniform(0.4, 1.2)) * altitude,
                rng.uniform(0.25, 0.75, 2) * size,
                float(rng.uniform(0, np.pi)),
                float(rng.uniform(0.1, 0.3)) * size,
                float(rng.uniform(0.03, 0.08)) * size,
            )
            for _ in range(rng.integers(3, 6))
        ]
        side = np.linspace(-0.1 * size, 1.1 * size, points)
        ground = heights(ridges, side[:, None], side)

        def place(low: float, high: float) -> list[float]:
            around = 0.04 * size * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]))
            for _ in range(1000):
                p = rng.uniform(low, high, 2) * size
                if heights(ridges, *(p[:, None, None] + around)).max() < altitude - 10:
                    break
            return [float(x) for x in p.round(1)]

        bs, user, start, end = place(0, 0.25), place(0.75, 1), place(0, 1), place(0, 1)
        named = {}
        for name, at in (("bs", bs), ("user", user)):
            db = -edges_loss(ridges, np.array(at), side, altitude)[None]
            found = GainMap(side, side, np.array([altitude]), db, True, ground.T)
            (folder / f"{seed}-{name}.npz").write_bytes(map_archive(found))
            named[f"{name}_map"] = f", gain: {{map: {seed}-{name}.npz}}"
        values = {
            "vehicle": PLANE if seed >= PLANES else COPTER,
            "velocity": ", start_velocity: free, end_velocity: free" if seed >= PLANES else "",
            "duplex": "half" if seed % 3 == 2 else "full",
            "duration": int(size / 5),
            "power": round(20 * np.log10(size / 500) - 2, 1),
        }
        values |= {"start": start, "end": end, "bs": bs, "user": user, "altitude": altitude}
        plans = []
        for which, maps in (("plan", named), ("plain", dict.fromkeys(named, ""))):
            path = folder / f"{seed}-{which}.yaml"
            path.write_text(PLAN.format(**values, **maps))
            plans.append(read_plan(path))
        return cls(ridges, *plans)


def heights(ridges: list[Ridge], x: Real, y: Real) -> Real:
    """Return the height of the ground at x and y, m."""
    found = np.zeros(np.broadcast_shapes(x.shape, y.shape))
    for height, middle, turn, half, width in ridges:
        east, north = x - middle[0], y - middle[1]
        along = np.abs(east * np.cos(turn) + north * np.sin(turn))
        across = north * np.cos(turn) - east * np.sin(turn)
        off = (across / width) ** 2 + (np.maximum(0, along - half) / width) ** 2
        found = np.maximum(found, height * np.exp(-off))
    return found


def edges_loss(ridges: list[Ridge], station: Real, side: Real,
               altitude: float) -> Real:  # fmt: skip
    """Return the loss, dB (north, east), by the worst knife edge from a station to each place."""
    x, y = np.meshgrid(side, side)
    up = float(heights(ridges, *station[:, None])[0]) + MAST
    d = np.sqrt((x - station[0]) ** 2 + (y - station[1]) ** 2 + (altitude - up) ** 2)
    nu = np.full(x.shape, -9.0)
    for share in np.linspace(0, 1, 80)[1:-1]:
        at = station[:, None, None] + share * (np.stack([x, y]) - station[:, None, None])
        above = heights(ridges, *at) - (up + share * (altitude - up))
        nu = np.maximum(nu, above * np.sqrt(2 / WAVELENGTH / (share * (1 - share) * d)))
    return knife_edge_loss(nu)


def best_by_place(solution: Solution, ridges: list[Ridge], cells: int = 4000) -> float:
    """Return what the best path over a grid delivers, bit/s/Hz: see above."""
    kin, plan = solution.problem.kinematics, solution.plan
    low, high = np.array([each.east[[0, -1]] for each in plan.maps]).T
    step = float(np.sqrt((high.max() - low.min()) ** 2 / cells))
    side = np.arange(low.min(), high.max(), step)
    x, y = np.meshgrid(side, side, indexing="ij")
    stages = max(2, round(kin.time_step * kin.slots * kin.max_speed / (4 * step)))
    h, n = kin.time_step * kin.slots / stages, kin.slots / stages
    rates = []
    for link in solution.problem.links:
        H = link.channel(np.stack([x.ravel(), y.ravel()], axis=1))
        rates.append(n * link.draw_rates(H, link.best(H[:, None])).reshape(x.shape))
    along, reach = step * np.linspace(0, 1, 15), range(-5, 6)
    steps = {  # and the cells from which they pass over no ground
        (i, j): np.max([heights(ridges, x + a * i, y + a * j) for a in along], axis=0)
        < plan.flight.altitude
        for i in reach
        for j in reach
        if np.hypot(i, j) <= kin.max_speed * h / step + 1e-9
    }
    most = rates[0].max() * rates[1].max() * stages / (rates[0].max() + rates[1].max())
    level = np.linspace(0, most, 60)
    gap, value = level[1], np.zeros((60, *x.shape))
    far = [np.hypot(x - end[0], y - end[1]) for end in (kin.start, kin.end)]
    for k in range(stages - 1, -1, -1):
        after = np.max([_moved(value, *step) for step in steps.items()], axis=0)
        found = []
        for share in (0.0, 0.5, 1.0) if plan.radio.duplex == "half" else (None,):
            come, gone = rates if share is None else (share * rates[0], (1 - share) * rates[1])
            sent = np.minimum(level[:, None, None] + come, gone)
            at = np.minimum(level[:, None, None] + come - sent, most) / gap
            i = np.minimum(at.astype(int), 58)
            below, above = (np.take_along_axis(after, i + up, 0) for up in (0, 1))
            found.append(sent + below + (at - i) * (above - below))
        when = (k + 0.5) * h
        away = (far[0] > kin.max_speed * when + step) | (
            far[1] > kin.max_speed * (stages * h - when) + step
        )
        value = np.where(
            away | (heights(ridges, x, y) >= plan.flight.altitude), -1e9, np.max(found, axis=0)
        )
    return float(value[0].max()) / kin.slots


def _moved(value: Real, by: tuple[int, int], on: Flags) -> Real:
    """Return the `value` (..., i, j) so many cells away, where the way there is `on`."""
    wide = np.pad(value, ((0, 0), (5, 5), (5, 5)), constant_values=-1e9)
    (i, j), (rows, columns) = by, value.shape[1:]
    return np.where(on, wide[:, 5 + i : 5 + i + rows, 5 + j : 5 + j + columns], -1e9)


def main(seeds: list[int]) -> None:
    """Print a row for each site."""
    gains = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            site = Site.of(seed, Path(folder))
            began = time.perf_counter()
            solution = optimize(site.plan)
            took = time.perf_counter() - began
            plain = optimize(site.plain)
            worth = solution.delivered_rate
            I_U, I_G = rates_along(solution, plain.w)
            unaware = solution.relay(I_U, I_G).rate
            best = best_by_place(solution, site.ridges)
            bound = upper_bound(solution.problem, worth).value
            clear = site.plan.flight.altitude - heights(site.ridges, *solution.w.T).max()
            gains.append(worth / max(unaware, 1e-3) - 1)
            print(
                f"{seed:2}  {worth:.4f}  of the best by place {100 * worth / best:.1f} %  "
                f"without terrain {unaware:.4f}  bound {100 * (bound / worth - 1):+.1f} %  "
                f"above ground {clear:.1f} m  {took:.1f} s",
                flush=True,
            )
    print(f"more than without terrain, median: {100 * statistics.median(gains):.0f} %")


if __name__ == "__main__":
    main([int(seed) for seed in sys.argv[1:]] or [*SEEDS])
