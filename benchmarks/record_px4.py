"""Fly missions in a real PX4's simulator and keep the thinned tracks (tests/data/flights/px4).

    FAAO_AUTOPILOTS=FOLDER python benchmarks/record_px4.py [NAME ...] [--again OTHER]

Each mission is written with its parameters, flown without wind and with little drag, and its track
is kept every half second and at each change of the current item. With --again those of the flights
held out are flown as they stand, and their tracks kept in OTHER, beside those of earlier times.
"""

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from flights_px4 import FOLDER, HELD_OUT
from simulators import usable

from faao_mav.autopilot import PX4_COPTER
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Frame, Home, Mission, MissionItem
from faao_mav.mission.formats.parameter_file import render_parameters
from faao_mav.mission.formats.wpl import write_wpl
from faao_mav.optimizer.optimize import optimize
from faao_mav.plan import Wind
from faao_mav.schedule.conversion import convert
from missions import PLANS, plan_of

HOME = Home(-35.363262, 149.165237, 584.0)
HEIGHT = 30.0  # of the plain shapes, m above home

Parameters = Mapping[str, float]
Leg = tuple[float, float, float, float, float]
"""Length m, turn to it degrees, speed m/s, acceptance radius at its end m, hold there s."""

NAMES = ("MPC_ACC_HOR", "MPC_JERK_AUTO", "MPC_XY_ERR_MAX", "NAV_MC_ALT_RAD")


def parameters(*values: float) -> Parameters:
    """Return the values of the parameters that shape a flight."""
    return dict(zip(NAMES, values, strict=True))


DEFAULT = parameters(3.0, 4.0, 2.0, 0.8)
LIVELY = parameters(5.0, 10.0, 2.0, 0.8)
SUITED = parameters(5.0, 20.0, 10.0, 3.0)
MIDDLE = parameters(3.0, 10.0, 10.0, 3.0)
GENTLE = parameters(2.0, 20.0, 10.0, 3.0)

PERIOD = 0.5  # between the samples that are kept, s


def legs(
    length: object, turn: object, speed: object, radius: object = 2.0, hold: object = 0.0
) -> list[Leg]:
    """Return legs of what may be one value for all or a list."""
    table = np.broadcast_arrays(
        *(np.array(each, float) for each in (length, turn, speed, radius, hold))
    )
    return [tuple(row) for row in np.column_stack([np.atleast_1d(each) for each in table]).tolist()]


def wandering(seed: int, *, count: int = 14, turn: float = 60.0, fastest: float = 8.0) -> list[Leg]:
    """Return legs of any length from 10 to 80 m, speed, turn and radius."""
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(10), np.log(80), count))
    radius = np.minimum(rng.uniform(1, 10, count), 0.45 * length)
    return legs(
        length.round(1),
        rng.uniform(-turn, turn, count).round(),
        rng.uniform(1, fastest, count).round(1),
        radius.round(1),
        np.where(rng.uniform(size=count) < 0.12, 4.0, 0.0),
    )


CORNERS = [0, 10, -30, 60, -90, 120, -150, 170, -45]
SLOW = [5, 0.5, 5, 0.7, 3, 0.6, 6, 1.0, 8, 0.75]
UNEQUAL = [9.9, 1.5, 9.9, 9.9, 2, 6, 1, 10, 10, 3, 15, 1.5]
BENT = [0, 15, -20, 25, 30, -35, 40, -10, 20, -45, 50, 5]
CHANGES = [3, 8, 5, 9, 2, 7, 1, 10]

SHAPES: dict[str, tuple[Parameters, list[Leg]]] = {
    "speeds-60m": (DEFAULT, legs(60, 0, CHANGES)),
    "speeds-150m": (DEFAULT, legs(150, 0, CHANGES[:6])),
    "speeds-40m-suited": (SUITED, legs(40, 0, CHANGES)),
    "slow": (DEFAULT, legs([30, 8] * 5, 0, SLOW)),
    "slow-suited": (SUITED, legs([30, 8] * 5, [0, 20] * 5, SLOW, 3)),
    "corners-60m": (DEFAULT, legs(60, CORNERS, 8)),
    "corners-60m-suited": (SUITED, legs(60, CORNERS, 8, 4)),
    "corners-40m-gentle": (GENTLE, legs(40, CORNERS, 5, 4)),
    "corners-80m-wide": (MIDDLE, legs(80, CORNERS, 10, 12)),
    "unequal-50m": (DEFAULT, legs(50, BENT, 8, UNEQUAL)),
    "unequal-50m-suited": (SUITED, legs(50, BENT, 8, UNEQUAL)),
    "unequal-40m-gentle": (GENTLE, legs(40, BENT, 6, UNEQUAL)),
    "unequal-straight": (SUITED, legs(45, 0, 8, UNEQUAL)),
    "line-5m": (DEFAULT, legs([5] * 25, 0, 8)),
    "line-10m": (DEFAULT, legs([10] * 20, 0, 8)),
    "line-10m-suited": (SUITED, legs([10] * 25, 0, 8, 4)),
    "line-20m-gentle": (GENTLE, legs([20] * 20, 0, 8, 4)),
    "line-40m": (DEFAULT, legs([40] * 8, 0, 8)),
    "holds-100m": (DEFAULT, legs([100] * 5, [0, 90, 90, 90, 0], 8, 2, 7)),
    "holds-60m-suited": (SUITED, legs([60] * 6, [0, 90, 90, 90, 0, 60], 6, 4, [0, 3, 5, 0, 1, 8])),
    "long-300m": (DEFAULT, legs([300] * 3, [0, 80, 30], 10, 5)),
    "long-300m-suited": (SUITED, legs([300] * 3, [0, 80, 30], 10, 5)),
    "circle-60m-20m": (DEFAULT, legs([20] * 18, 19, 8)),
    "circle-60m-20m-suited": (SUITED, legs([20] * 18, 19, 8, 4)),
    "circle-25m-12m-suited": (SUITED, legs([12] * 13, 27, 6, 4)),
    "zigzag-100m-lively": (LIVELY, legs([100] * 7, [45] + [90, -90] * 3, 8)),
    **{f"wandering-{k}": (DEFAULT, wandering(k)) for k in range(3)},
    **{f"wandering-{k}-suited": (SUITED, wandering(k)) for k in range(3, 7)},
    **{f"wandering-{k}-gentle": (GENTLE, wandering(k)) for k in range(7, 9)},
    "bends-9-suited": (SUITED, wandering(9, turn=160, fastest=10)),
    "bends-10-middle": (MIDDLE, wandering(10, turn=160, fastest=10)),
}

CONVERTED = {
    "-".join(name.replace(",", "").replace("m/s", "").split()): changes
    for name, changes in PLANS.items()
} | {
    "free-ends-90-10": {
        "flight.duration": 90,
        "vehicle.max_speed": 10,
        "vehicle.max_acceleration": 2.5,
        "flight.start_velocity": "free",
        "flight.end_velocity": "free",
    },
    "brief-80-7": {
        "flight.duration": 80,
        "vehicle.max_speed": 7,
        "radio.ground_user.position": [350, 200],
    },
    "keep-100-6": {"flight.duration": 100, "vehicle.max_speed": 6, "mission.parameters": "keep"},
}
"""Plans, as changes of the sample."""


def shape(legs: list[Leg]) -> Mission:
    """Return the mission that flies the legs, after a hold over home."""
    turns = np.cumsum(np.radians([leg[1] for leg in legs]))
    places = np.cumsum(
        [0, *(leg[0] * np.exp(1j * turn) for leg, turn in zip(legs, turns, strict=True))]
    )
    frame = LocalFrame(HOME.latitude, HOME.longitude)
    x, y = frame.to_geodetic(np.column_stack([places.imag, places.real]))
    relative = Frame.GLOBAL_RELATIVE_ALT
    items = [MissionItem(Command.NAV_TAKEOFF, relative, x=x[0], y=y[0], z=HEIGHT)]
    first: Leg = (0.0, 0.0, 5.0, 2.0, 5.0)
    for leg, east, north in zip([first, *legs], x, y, strict=True):
        _, _, speed, radius, hold = leg
        items.append(MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, (1.0, speed, -1.0, 0.0)))
        params = (hold, radius, 0.0, 0.0)
        items.append(MissionItem(Command.NAV_WAYPOINT, relative, params, east, north, HEIGHT))
    return Mission(tuple(items), HOME)


def made(name: str) -> tuple[Mission, Parameters]:
    """Return the mission called `name` and the parameters that it is flown with."""
    if name in SHAPES:
        flown_with, route = SHAPES[name]
        return shape(route), flown_with
    changes = CONVERTED[name]
    plan = plan_of(changes, "px4", str(changes.get("mission.parameters", "recommend")))
    conversion = convert(optimize(plan))
    return conversion.mission, {**DEFAULT, **conversion.parameters}


def thinned(rows: list[dict[str, str]]) -> Iterator[dict[str, str]]:
    """Yield the rows every `PERIOD` s, and those before and after a change of the item."""
    due = -np.inf
    for before, row, after in zip([None, *rows], rows, [*rows[1:], None], strict=False):
        change = any(each is not None and each["seq"] != row["seq"] for each in (before, after))
        if change or float(row["t_s"]) >= due:
            due = max(due, float(row["t_s"])) + (0 if change else PERIOD)
            yield row


def record(name: str, runner: Path) -> None:
    """Fly the mission called `name` and keep its track; again if the simulator fails."""
    mission, settings = made(name)
    target = FOLDER / f"{name}.waypoints"
    target.write_text(write_wpl(mission))
    values = target.with_suffix(".params")
    values.write_text(render_parameters(settings, PX4_COPTER.family.parameter_style))
    fly_as_it_stands(target, runner, target)


def fly_as_it_stands(mission: Path, runner: Path, target: Path) -> None:
    """Fly the file `mission` with the parameters beside it, and keep the track beside `target`."""
    values = str(mission.with_suffix(".params"))
    options = ["--param-file", values, "--params", "SIH_KDV=0.2", "--speedup", "10"]
    keep(flown_by(runner, mission, options), target, ("t_s", "lat", "lon", "alt_rel_m", "seq"))


def flown_by(runner: Path, mission: Path, options: list[str]) -> list[dict[str, str]]:
    """Fly the file `mission` by `runner` and return the rows of its track, 20 a second."""
    with tempfile.TemporaryDirectory() as folder:
        track = Path(folder) / "track.csv"
        command = [sys.executable, str(runner), str(mission), "--out", str(track), "--hz", "20"]
        for _ in range(4):
            done = subprocess.run([*command, *options], stdout=subprocess.DEVNULL, check=False)
            if done.returncode == 0:
                break
        else:
            raise SystemExit(f"{mission.stem}: not flown")
        with track.open() as file:
            return list(csv.DictReader(file))


def in_wind(runner: Path, wind: Wind) -> list[str]:
    """Return the option of `runner` for a steady `wind`."""
    east, north = wind.velocity
    asked = f"{east},{north}" if "px4" in runner.name else f"{wind.speed},{wind.from_degrees}"
    return [f"--wind={asked}"] if wind.speed else []


def keep(rows: list[dict[str, str]], target: Path, keys: Sequence[str]) -> None:
    """Write the columns `keys` of the thinned track beside the mission `target`."""
    with target.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, keys, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(thinned(rows))


def main() -> None:
    """Record the flights that are named, or all; or fly again those that are held out."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*")
    parser.add_argument("--again", type=Path, metavar="OTHER")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as where:
        runner = usable(Path(os.environ["FAAO_AUTOPILOTS"]), Path(where)) / "fly_px4.py"
        for name in options.names or (HELD_OUT if options.again else [*SHAPES, *CONVERTED]):
            if options.again:
                number = len(list(options.again.glob(f"{name}.*.csv")))
                target = options.again / f"{name}.{number}.waypoints"
                fly_as_it_stands(FOLDER / f"{name}.waypoints", runner, target)
            else:
                record(name, runner)
            print(name, flush=True)


if __name__ == "__main__":
    main()
