"""Missions that real autopilots flew in their simulators, beside their plans.

    FAAO_AUTOPILOTS=FOLDER python benchmarks/flown.py [ardupilot | px4 | plane] [PLAN ...]
        [--wind SPEED,FROM] [--stream] [--random FIRST,COUNT]

With a wind, m/s and degrees, plans are made for it, and flown in it; else in calm air. With
--stream copters fly the plans by setpoints, and what is predicted is of the mission still. With
--random plans, for copters each with its wind, are drawn from these seeds.

One row for each plan: rms position error at equal times (m), how much later than planned the flight
is over (s), the delivered rate over the planned one; each as predicted and as flown.
"""

import csv
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import record_plane
from record_px4 import in_wind
from simulators import simulated, start_log

from faao_mav import Result, plan_mission
from faao_mav.arrays import Real
from faao_mav.errors import FaaoError
from faao_mav.fly.fly import fly_mission
from faao_mav.fly.seen import Flight
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.prediction import Prediction, price_flight
from faao_mav.wire.client import upload
from missions import PLANS, plan_of, random_changes

RUNNERS = {
    "ardupilot": ("fly_arducopter.py", ["--speedup", "20"]),
    "px4": ("fly_px4.py", ["--speedup", "10", "--params", "SIH_KDV=0.2"]),
    "plane": ("fly_arducopter.py", ["--speedup", "20", "--vehicle", "plane", "--tail", "5"]),
}
"""The runner of each autopilot, with its options: little air drag for PX4's aircraft."""

FLOWN: dict[str, dict[str, Any]] = {
    name: PLANS[name]
    for name in (
        "copter_relay, 120 s, 8 m/s",
        "short, 60 s, 6 m/s",
        "slow, 90 s, 4 m/s",
        "two hovers, 200 s, 9 m/s",
        "curved, 75 s, 8 m/s",
    )
} | {
    "brief, 80 s, 7 m/s": {
        "flight.duration": 80,
        "vehicle.max_speed": 7,
        "radio.ground_user.position": [350, 200],
    },
    "free ends, 90 s, 10 m/s": {
        "flight.duration": 90,
        "vehicle.max_speed": 10,
        "vehicle.max_acceleration": 2.5,
        "flight.start_velocity": "free",
        "flight.end_velocity": "free",
    },
    "the same, 45 degrees of lean": {
        "flight.duration": 90,
        "vehicle.max_speed": 10,
        "vehicle.max_acceleration": 2.5,
        "vehicle.parameters": {"ANGLE_MAX": 4500},
        "flight.start_velocity": "free",
        "flight.end_velocity": "free",
    },
    "gentle, 90 s, 10 m/s": {
        "flight.duration": 90,
        "vehicle.max_speed": 10,
        "vehicle.max_acceleration": 0.6,
        "flight.start_velocity": "free",
        "flight.end_velocity": "free",
    },
    "16-QAM, 240 s, 5 m/s": {
        "flight.duration": 240,
        "vehicle.max_speed": 5,
        "vehicle.max_acceleration": 1.0,
        "radio.modulation": "16qam",
        "radio.ground_user.position": [400, 250],
    },
}


PLANES: dict[str, tuple[dict[str, Any], float]] = {
    "plane_relay, 180 s, 13-16 m/s": ({}, 584.0),
    "the same at sea level": ({}, 0.0),
    "plane, 150 s, 14-18 m/s": (record_plane.PLANS["plan-150-18"], 0.0),
    "plane, 120 s, 14-15 m/s": (record_plane.PLANS["plan-120-15"], 584.0),
    "plane, 240 s, 12-20 m/s": (
        {
            "flight.duration": 240,
            "vehicle.min_speed": 12,
            "vehicle.max_speed": 20,
            "flight.end": [-400, -200],
        },
        0.0,
    ),
    "plane, 90 s, 16-22 m/s": (
        {
            "flight.duration": 90,
            "vehicle.min_speed": 16,
            "vehicle.max_speed": 22,
            "vehicle.max_acceleration": 4,
            "flight.start": [-600, 0],
        },
        584.0,
    ),
}
"""Plans for planes, as changes of `missions/plane_relay.yaml`, and the elevation of home, m."""


def flown(autopilots: Path, autopilot: str, result: Result, folder: Path) -> Prediction:
    """Fly the mission of `result` and return what it delivers; again if the simulator fails.

    `autopilots` is the folder with the runners; mission and track are written to `folder`. It is
    flown in the plan's wind.
    """
    script, options = RUNNERS[autopilot]
    files = result.write(folder / "mission.waypoints")
    command = [sys.executable, str(autopilots / script), str(files[0])]
    command += ["--param-file", str(files[1])] if len(files) > 1 else []
    own = folder / "own.parm"  # what the plan says that the vehicle has
    told = result.solution.plan.vehicle.parameters
    own.write_text("".join(f"{name} {value}\n" for name, value in told.items()))
    command += ["--param-file", str(own)] if told else []
    command += in_wind(autopilots / script, result.solution.plan.site.wind)
    track = folder / "track.csv"
    for _ in range(4):
        run = subprocess.run(
            [*command, *options, "--out", str(track)], capture_output=True, text=True, check=False
        )
        if run.returncode == 0:
            break
    else:
        raise SystemExit(f"not flown: {run.stdout[-2000:]}{run.stderr[-2000:]}")
    with track.open() as file:
        rows = [(row["t_s"], row["lat"], row["lon"]) for row in csv.DictReader(file)]
    table = np.array(rows, dtype=float)
    origin = result.solution.plan.origin
    frame = LocalFrame(origin.latitude, origin.longitude)
    return on_the_plans_clock(result.solution, table[:, 0], frame.to_local(*table[:, 1:].T))


def streamed(autopilots: Path, autopilot: str, result: Result, folder: Path) -> Prediction:
    """Fly the plan of `result` by setpoints, and return what it delivers by the stream's clock."""
    solution = result.solution
    assert result.conversion is not None
    with serving(autopilots, autopilot, result, folder) as connection:
        flight = Flight.planned(result.conversion, solution, streamed=True)
        report = fly_mission(flight, connection, rate=10, wait=60)
    if report.relay_start is None or report.ending is None or report.ending.kind != "finished":
        raise SystemExit(f"not flown: {report.ending}")
    return report.record.line(solution, report.relay_start).priced(solution)


@contextmanager
def serving(
    autopilots: Path, autopilot: str, result: Result, folder: Path, speedup: int = 5
) -> Iterator[str]:
    """Run a simulator in `folder`, in the plan's wind, that holds the mission of `result`.

    It yields where it is heard, `speedup` times as fast as the world. The autopilot's own log stays
    in `folder`.
    """
    wind = result.solution.plan.site.wind
    assert result.conversion is not None
    files, script = result.write(folder / "mission.waypoints"), autopilots / RUNNERS[autopilot][0]
    if autopilot == "px4":
        kind, options = "px4", in_wind(script, wind)
        options += ["--params", "SIH_KDV=0.2", "--keep", str(folder / "px4")]
        options += ["--param-file", str(files[1])] if len(files) > 1 else []
    else:
        plans = result.solution.plan.vehicle.parameters
        told = {**plans, **result.conversion.parameters}
        timed = [f"{name} {value}" for name, value in told.items()]
        air = [f"SIM_WIND_SPD {wind.speed}", f"SIM_WIND_DIR {wind.from_degrees}"]
        (folder / "own.parm").write_text(
            "\n".join(["LOG_BACKEND_TYPE 1", "GUID_TIMEOUT 1", *timed, *air])
        )
        defaults = f"{autopilots / 'ardupilot' / 'copter.parm'},{folder / 'own.parm'}"
        kind, options = "arducopter", ["--defaults", defaults]
    with simulated(autopilots, kind, folder, "--speedup", str(speedup), *options) as connection:
        if autopilot == "px4":
            start_log(autopilots, folder / "px4")
        upload(result.conversion.mission, connection, wait=60)
        yield connection


def on_the_plans_clock(solution: Solution, t: Real, w: Real) -> Prediction:
    """Price a flight whose clock is shifted so that it is nearest to the plan at equal times."""

    def apart(start: float) -> float:
        at = np.stack([np.interp(solution.t + start, t, x) for x in w.T], axis=-1)
        return float(((at - solution.w) ** 2).sum(axis=1).mean())

    begin = min(np.arange(t[0], t[-1] - solution.t[-1] + 5, 0.5).tolist(), key=apart)
    begin = min(np.arange(begin - 0.6, begin + 0.6, 0.02).tolist(), key=apart)
    return price_flight(solution, t - begin, w)


def row(
    name: str, autopilots: Path, autopilot: str, wind: dict[str, Any], *, stream: bool = False
) -> str:
    """Plan, fly and compare."""
    try:
        if autopilot == "plane":
            changes, elevation = PLANES[name]
            plan = record_plane.plan_of(changes | wind, elevation)
        else:
            plan = plan_of(FLOWN[name] | wind, autopilot, "recommend")
        result = plan_mission(plan)
    except FaaoError as error:
        return f"{autopilot:<10}{name:<28}refused: {error}"
    assert result.prediction is not None
    with tempfile.TemporaryDirectory() as folder:
        run = streamed if stream else flown
        real = run(autopilots, autopilot, result, Path(folder))
    cells = [f"{autopilot:<10}{name:<28}"]
    for found in (result.prediction, real):
        late = found.duration - plan.flight.duration
        share = 100 * found.delivered_rate / result.solution.delivered_rate
        cells.append(f"{found.rms_position_error:6.2f} {late:+6.2f} {share:7.2f} %")
    return "   ".join(cells)


def drawn(seed: int) -> dict[str, Any]:
    """Return the plan that `seed` draws, as changes of the sample, with 3 to 8 m/s of wind."""
    random = Random(seed + 1000)
    wind = {"speed": round(random.uniform(3, 8), 1), "from": random.randrange(360)}
    return random_changes(seed) | {"site.wind": wind}


def drawn_plane(seed: int) -> tuple[dict[str, Any], float]:
    """Return the plan for a plane that `seed` draws, and the elevation of home, m.

    It takes 100 to 240 s, at 12 to 16 m/s and 1.1 to 1.5 times as much, half of them in up to 5 m/s
    of wind.
    """
    random = Random(seed)
    least = random.randrange(12, 17)

    def place(reach: int) -> list[int]:
        return [random.randrange(-reach, reach) for _ in range(2)]

    changes: dict[str, Any] = {
        "vehicle.min_speed": least,
        "vehicle.max_speed": round(least * random.uniform(1.1, 1.5), 1),
        "vehicle.max_acceleration": round(random.uniform(2.0, 4.0), 1),
        "flight.start": place(600),
        "flight.end": place(600),
        "flight.duration": random.randrange(100, 241, 10),
        "radio.ground_user.position": place(600),
        "radio.modulation": random.choice(("bpsk", "qpsk")),
    }
    if random.random() < 0.5:
        speed = round(random.uniform(1, 5), 1)
        changes["site.wind"] = {"speed": speed, "from": random.randrange(360)}
    return changes, random.choice((0.0, 584.0))


def main() -> None:
    """Print the table."""
    chosen, autopilots = sys.argv[1:], Path(os.environ["FAAO_AUTOPILOTS"])
    wind: dict[str, Any] = {}
    if "--wind" in chosen:
        speed, start = chosen[chosen.index("--wind") + 1].split(",")
        wind = {"site.wind": {"speed": float(speed), "from": float(start)}}
    names: list[str] = []
    if "--random" in chosen:
        first, count = map(int, chosen[chosen.index("--random") + 1].split(","))
        names = [f"random {seed}" for seed in range(first, first + count)]
        FLOWN.update({name: drawn(int(name.split()[1])) for name in names})
        PLANES.update({name: drawn_plane(int(name.split()[1])) for name in names})
    print(f"{'':<41}{'predicted: m, s late, rate':<27}flown")
    for autopilot in [each for each in RUNNERS if each in chosen] or RUNNERS:
        plans = PLANES if autopilot == "plane" else FLOWN
        for name in [each for each in plans if each in chosen] or names or plans:
            stream = "--stream" in chosen
            print(row(name, autopilots, autopilot, wind, stream=stream), flush=True)


if __name__ == "__main__":
    main()
