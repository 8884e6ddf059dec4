"""Fly missions in a real ArduPlane's simulator and keep the tracks (tests/data/flights/arduplane).

    FAAO_AUTOPILOTS=FOLDER python benchmarks/record_plane.py [NAME ...]

Each mission is flown without wind, from sea level (`sea-`) or from 584 m (`high-`), with the
parameters that ArduPilot's simulator has for its plane: those of `PARAMETERS` shape the flight.
Its track is kept every half second and at each change of the current item, from a second before the
take-off is over.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from record_px4 import Leg, flown_by, keep, legs
from recorded import FLIGHTS

from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Frame, Home, Mission, MissionItem
from faao_mav.mission.formats.wpl import write_wpl
from faao_mav.optimizer.optimize import optimize
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.yaml_text import dump_yaml, load_yaml
from faao_mav.schedule.conversion import convert

FOLDER = FLIGHTS / "arduplane"
SAMPLE = Path(__file__).parents[1] / "missions" / "plane_relay.yaml"
PLACE = (-35.363262, 149.165237)
HEIGHT = 100.0  # of the plain shapes, m above home

PARAMETERS = {
    "AIRSPEED_CRUISE": 22.0,
    "AIRSPEED_MIN": 10.0,
    "AIRSPEED_MAX": 30.0,
    "ROLL_LIMIT_DEG": 65.0,
    "RLL2SRV_TCONST": 0.25,
    "NAVL1_PERIOD": 15.0,
    "WP_RADIUS": 50.0,
    "WP_LOITER_RAD": 80.0,
}
"""What the simulator's plane has that is not ArduPlane's default."""

BODY = {"airspeed_exponent": 1}
"""What the simulator's plane of before July 2026 has, which flew, and that of `sitl` has not."""


def wandering(seed: int, *, count: int = 12, turn: float = 100.0, least: float = 80.0) -> list[Leg]:
    """Return legs of any length up to 400 m, turn and airspeed from 12 to 20 m/s."""
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(least), np.log(400), count)).round(1)
    speed = rng.uniform(12, 20, count).round(1)
    speed = np.where(rng.uniform(size=count) < 0.5, speed, np.roll(speed, 1))
    return legs(length, rng.uniform(-turn, turn, count).round(), speed, 0)


def round_bends(seed: int, count: int = 36) -> list[Leg]:
    """Return legs of about 50 m that bend as a converted plan does, at 13 to 16 m/s."""
    rng = np.random.default_rng(seed)
    turn = np.repeat(rng.uniform(-32, 32, count // 6), 6)
    length = rng.uniform(35, 70, count)
    return legs(length.round(1), turn.round(), np.repeat(rng.uniform(13, 16, 6), 6).round(2), 0)


CORNERS = [0, 30, -60, 90, -120, 150, 45, -170, 75]
STEPS = [13, 18, 14, 20, 12, 16, 15]
SHARP = [90, 180, -150, 120, 180, 135]

SHAPES: dict[str, list[Leg]] = {
    "corners-500m-16": legs([500] * 9, CORNERS, 16, 0),
    "corners-350m-13": legs([350] * 9, CORNERS, 13, 0),
    "sharp-400m-18": legs([400] * 6, SHARP, 18, 0),
    "steps-300m": legs([300] * 7, [0, 20, -40, 60, -20, 0, 30], STEPS, 0),
    "circle-120m-15": legs([62.1] * 18, [90] + [30] * 17, 15, 0),
    **{f"wandering-{k}": wandering(k) for k in range(5)},
    **{f"bends-{k}": round_bends(k) for k in range(3)},
    "line-60m-14": legs([60] * 24, [120] + [0] * 11 + [8] * 12, 14, 0),
}
ELEVATIONS = {"sea": 0.0, "high": 584.0}


def shape(route: list[Leg], elevation: float) -> Mission:
    """Return the mission that flies the legs after a take-off over home, towards north."""
    turns = np.cumsum(np.radians([leg[1] for leg in route]))
    ways = [leg[0] * np.exp(1j * turn) for leg, turn in zip(route, turns, strict=True)]
    places = np.cumsum([0, *ways])
    frame = LocalFrame(*PLACE)
    x, y = frame.to_geodetic(np.column_stack([places.imag, places.real]))
    relative = Frame.GLOBAL_RELATIVE_ALT
    items = [MissionItem(Command.NAV_TAKEOFF, relative, (15.0, 0, 0, 0), x[0], y[0], HEIGHT)]
    commanded = None
    for leg, east, north in zip(route, x[1:], y[1:], strict=True):
        if leg[2] != commanded:
            commanded = leg[2]
            items.append(
                MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, (0.0, commanded, -1.0, 0.0))
            )
        items.append(
            MissionItem(Command.NAV_WAYPOINT, relative, (0.0, leg[3], 0, 0), east, north, HEIGHT)
        )
    items.append(MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION))
    return Mission(tuple(items), Home(*PLACE, elevation))


PLANS: dict[str, dict[str, Any]] = {
    "plan-180-14": {},
    "plan-150-18": {
        "flight.duration": 150,
        "vehicle.min_speed": 14,
        "vehicle.max_speed": 18,
        "radio.ground_user.position": [700, 300],
    },
    "plan-120-15": {
        "flight.duration": 120,
        "vehicle.min_speed": 14,
        "vehicle.max_speed": 15,
        "vehicle.max_acceleration": 2.5,
        "flight.start": [-300, 400],
        "flight.end": [400, -300],
    },
}
"""Plans, as changes of the sample."""


def plan_of(changes: dict[str, Any], elevation: float) -> Plan:
    """Return the sample plan with the dotted keys of `changes` replaced, for the simulator."""
    data = load_yaml(SAMPLE.read_text(), "sample")
    own = {
        "site.origin.elevation": elevation,
        "vehicle.parameters": PARAMETERS,
        "vehicle.body": BODY,
    }
    for path, value in (own | changes).items():
        *parents, last = path.split(".")
        section = data
        for key in parents:
            section = section[key]
        section[last] = value
    return parse_plan(dump_yaml(data))


def made(name: str) -> Mission:
    """Return the mission called `name`."""
    where, _, kind = name.partition("-")
    elevation = ELEVATIONS[where]
    if kind in SHAPES:
        return shape(SHAPES[kind], elevation)
    return convert(optimize(plan_of(PLANS[kind], elevation))).mission


def record(name: str, runner: Path) -> None:
    """Fly the mission called `name` and keep its track; again if the simulator fails."""
    target = FOLDER / f"{name}.waypoints"
    target.write_text(write_wpl(made(name)))
    fly(runner, target, target.with_suffix(".csv"))


def fly(runner: Path, mission: Path, track: Path, options: Sequence[str] = ()) -> None:
    """Fly the file `mission` by `runner` with `options` too, and keep the thinned track."""
    options = ["--vehicle", "plane", "--speedup", "20", "--tail", "3", *options]
    rows = flown_by(runner, mission, options)
    taken_off = next(float(row["t_s"]) for row in rows if int(row["seq"]) > 1)
    rows = [row for row in rows if float(row["t_s"]) >= taken_off - 1]
    keep(rows, track, ("t_s", "lat", "lon", "alt_rel_m", "vx", "vy", "vz", "seq"))


def main() -> None:
    """Record the flights that are named, or all."""
    runner = Path(os.environ["FAAO_AUTOPILOTS"]) / "fly_arducopter.py"
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or [
        f"{where}-{kind}" for where in ELEVATIONS for kind in (*SHAPES, *PLANS)
    ]:
        record(name, runner)
        print(name, flush=True)


if __name__ == "__main__":
    main()
