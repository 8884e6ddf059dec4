"""Missions that real autopilots flew in their simulators, beside their plans.

    FAAO_AUTOPILOTS=FOLDER python benchmarks/flown.py [ardupilot | px4 | plane] [PLAN ...]
        [--wind SPEED,FROM] [--stream] [--random FIRST,COUNT]

With a wind, m/s and degrees, plans are made for it, and flown in it; else in calm air. With
--stream copters fly the plans by setpoints, and what is predicted is of the mission still. With
--random plans, for copters each with its wind, are drawn from these seeds.

One row for each plan: rms position error at equal times (m), how much later than planned the flight
is over (s), the delivered rate over the planned one; each as predicted and as flown.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from conftest import MISSIONS, edited
from flights import PLANE, PLANE_BODY
from record import flown_by, in_wind
from simulators import simulated, start_log

from faao_mav import Result, parse_plan, plan_mission
from faao_mav.arrays import Real
from faao_mav.errors import FaaoError
from faao_mav.fly.fly import fly_mission
from faao_mav.fly.preflight import Flight
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan, Wind
from faao_mav.schedule.prediction import Prediction, price_flight
from faao_mav.wire.client import upload
from missions import PLANS, changes, plan_of, random_changes

Changes = dict[str, Any]
"""Changes of a sample plan, by dotted keys."""

RUNNERS = {
    "ardupilot": ("fly_arducopter.py", ["--speedup", "20"]),
    "px4": ("fly_px4.py", ["--speedup", "10", "--params", "SIH_KDV=0.2"]),
    "plane": ("fly_arducopter.py", ["--speedup", "20", "--vehicle", "plane", "--tail", "5"]),
}
"""The runner of each autopilot, with its options: little air drag for PX4's aircraft."""

_FAST: Changes = {"flight.duration": 90, "vehicle.max_speed": 10, "vehicle.max_acceleration": 2.5}
_FREE: Changes = {"flight.start_velocity": "free", "flight.end_velocity": "free"}
_OF_MISSIONS = ("copter_relay", "short", "slow", "two hovers, 200", "curved, 75")

FLOWN: dict[str, Changes] = {
    name: changes for name, changes in PLANS.items() if name.startswith(_OF_MISSIONS)
} | {
    "brief, 80 s, 7 m/s": changes(80, 7, [0, 350], [350, 0], [350, 200], 100),
    "free ends, 90 s, 10 m/s": _FAST | _FREE,
    "the same, 45 degrees of lean": _FAST | _FREE | {"vehicle.parameters": {"ANGLE_MAX": 4500}},
    "gentle, 90 s, 10 m/s": _FAST | _FREE | {"vehicle.max_acceleration": 0.6},
    "16-QAM, 240 s, 5 m/s": changes(240, 5, [0, 350], [350, 0], [400, 250], 100)
    | {"vehicle.max_acceleration": 1.0, "radio.modulation": "16qam"},
}
"""Plans for copters, as changes of `missions/copter_relay.yaml`."""


def planes(duration: int, least: int, most: float, elevation: float, **more: Any) -> Changes:
    """Return a plan for a plane: s, m/s, m above the sea, and keys of `flight`."""
    return {
        "flight.duration": duration,
        "vehicle.min_speed": least,
        "vehicle.max_speed": most,
        "site.origin.elevation": elevation,
        **{f"flight.{key}": value for key, value in more.items()},
    }


PLANES: dict[str, Changes] = {
    "plane_relay, 180 s, 13-16 m/s": {"site.origin.elevation": 584.0},
    "the same at sea level": {"site.origin.elevation": 0.0},
    "plane, 150 s, 14-18 m/s": planes(150, 14, 18, 0.0)
    | {"radio.ground_user.position": [700, 300]},
    "plane, 120 s, 14-15 m/s": planes(120, 14, 15, 584.0, start=[-300, 400], end=[400, -300])
    | {"vehicle.max_acceleration": 2.5},
    "plane, 240 s, 12-20 m/s": planes(240, 12, 20, 0.0, end=[-400, -200]),
    "plane, 90 s, 16-22 m/s": planes(90, 16, 22, 584.0, start=[-600, 0])
    | {"vehicle.max_acceleration": 4},
}
"""Plans for planes, as changes of `missions/plane_relay.yaml`."""


def plane_of(changes: Changes) -> Plan:
    """Return the sample plan for the simulator's plane with `changes`."""
    own = {"vehicle.parameters": PLANE, "vehicle.body": PLANE_BODY}
    return parse_plan(edited((MISSIONS / "plane_relay.yaml").read_text(), own | changes))


def flown(autopilots: Path, autopilot: str, result: Result, folder: Path) -> Prediction:
    """Fly the mission of `result` and return what it delivers.

    `autopilots` is the folder with the runners; the mission is written to `folder`. It is flown in
    the plan's wind.
    """
    runner, plan = autopilots / RUNNERS[autopilot][0], result.solution.plan
    files = result.write(folder / "mission.waypoints")
    own = folder / "own.parm"  # what the plan says that the vehicle has
    told = plan.vehicle.parameters
    own.write_text("".join(f"{name} {value}\n" for name, value in told.items()))
    options = [*RUNNERS[autopilot][1], *in_wind(runner, plan.site.wind)]
    for values in (*files[1:2], *([own] if told else [])):
        options += ["--param-file", str(values)]
    table = np.array(
        [
            [row[key] for key in ("t_s", "lat", "lon")]
            for row in flown_by(runner, files[0], options)
        ],
        dtype=float,
    )
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
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
    autopilots: Path,
    autopilot: str,
    result: Result,
    folder: Path,
    speedup: int = 5,
    wind: Wind | None = None,
) -> Iterator[str]:
    """Run a simulator in `folder`, in the plan's wind or another, with the mission of `result`.

    It yields where it is heard, `speedup` times as fast as the world. The autopilot's own log stays
    in `folder`. Without setpoints PX4 goes into Hold.
    """
    wind = wind or result.solution.plan.site.wind
    assert result.conversion is not None
    files, script = result.write(folder / "mission.waypoints"), autopilots / RUNNERS[autopilot][0]
    if autopilot == "px4":
        kind, options = "px4", in_wind(script, wind)
        options += ["--params", "SIH_KDV=0.2,COM_OBL_RC_ACT=5", "--keep", str(folder / "px4")]
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


def row(autopilots: Path, autopilot: str, name: str, changes: Changes, *, stream: bool) -> str:
    """Plan, fly and compare."""
    try:
        plane = autopilot == "plane"
        plan = plane_of(changes) if plane else plan_of(changes, autopilot, "recommend")
        result = plan_mission(plan)
    except FaaoError as error:
        return f"{autopilot:<10}{name:<28}refused: {error}"
    assert result.prediction is not None
    with tempfile.TemporaryDirectory() as folder:
        real = (streamed if stream else flown)(autopilots, autopilot, result, Path(folder))
    cells = [f"{autopilot:<10}{name:<28}"]
    for found in (result.prediction, real):
        late = found.duration - plan.flight.duration
        share = 100 * found.delivered_rate / result.solution.delivered_rate
        cells.append(f"{found.rms_position_error:6.2f} {late:+6.2f} {share:7.2f} %")
    return "   ".join(cells)


def drawn(seed: int) -> Changes:
    """Return the plan for a copter that `seed` draws, with 3 to 8 m/s of wind."""
    random = Random(seed + 1000)
    wind = {"speed": round(random.uniform(3, 8), 1), "from": random.randrange(360)}
    return random_changes(seed) | {"site.wind": wind}


def drawn_plane(seed: int) -> Changes:
    """Return the plan for a plane that `seed` draws.

    It takes 100 to 240 s, at 12 to 16 m/s and 1.1 to 1.5 times as much, half of them in up to 5 m/s
    of wind.
    """
    random = Random(seed)
    least = random.randrange(12, 17)

    def place() -> list[int]:
        return [random.randrange(-600, 600) for _ in range(2)]

    most = round(least * random.uniform(1.1, 1.5), 1)
    changes: Changes = {
        "vehicle.max_acceleration": round(random.uniform(2.0, 4.0), 1),
        "flight.start": place(),
        "flight.end": place(),
        "radio.ground_user.position": place(),
        "radio.modulation": random.choice(("bpsk", "qpsk")),
    }
    changes |= planes(random.randrange(100, 241, 10), least, most, random.choice((0.0, 584.0)))
    if random.random() < 0.5:
        speed = round(random.uniform(1, 5), 1)
        changes["site.wind"] = {"speed": speed, "from": random.randrange(360)}
    return changes


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("chosen", nargs="*")
    parser.add_argument("--wind", metavar="SPEED,FROM")
    parser.add_argument("--stream", action="store_true")
    parser.add_argument("--random", metavar="FIRST,COUNT")
    options, wind = parser.parse_args(), Changes()
    if options.wind:
        speed, start = map(float, options.wind.split(","))
        wind = {"site.wind": {"speed": speed, "from": start}}
    print(f"{'':<41}{'predicted: m, s late, rate':<27}flown")
    for autopilot in [each for each in RUNNERS if each in options.chosen] or RUNNERS:
        plans, draw = (PLANES, drawn_plane) if autopilot == "plane" else (FLOWN, drawn)
        if options.random:
            first, count = map(int, options.random.split(","))
            plans = {f"random {seed}": draw(seed) for seed in range(first, first + count)}
        for name in [each for each in plans if each in options.chosen] or plans:
            where, changes = Path(os.environ["FAAO_AUTOPILOTS"]), plans[name] | wind
            print(row(where, autopilot, name, changes, stream=options.stream), flush=True)


if __name__ == "__main__":
    main()
