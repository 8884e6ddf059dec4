"""Predicted against recorded flights of all three autopilots (tests/data/flights).

    python benchmarks/flights.py [arducopter] [arduplane] [px4]

Prediction and record are aligned once per flight, at the start: when the first leg becomes
current, half-way between the two samples (0.2 s apart) that show it. Arrival errors are of the
moments at which the autopilot turns to the next item, relative to that; position errors are
horizontal, at equal times, until the last of these moments; the path error is the largest
distance of the recorded track from the predicted one, whenever it was there.

Constants of the models are fitted to the flights that are "fitted"; no constant is fitted to those
"held out", but errors of ArduCopter's were seen while its model was built. Of ArduCopter plain
waypoints are fitted, splines and parameters follow; that drag acts along the nose and across by
itself is fitted to flights in wind, its last digit to those in 9 m/s from 300 degrees. Of ArduPlane
the fitted flights are from sea level and in calm air. PX4's fit makes the rms of the arrival error
(s) and a third of the position error (m) small, as round figures near a flat minimum; its flights
that are "slow" have legs below 1 m/s, on which half a metre of error in the aircraft's own position
is up to a second: repeats differ by as much, and missions are made without such legs.
"""

import csv
import math
import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import FlightPath, Flown, Vehicle
from faao_mav.autopilot.body import PlaneBody
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command
from faao_mav.mission.formats.parameter_file import read_parameters
from faao_mav.mission.formats.wpl import read_wpl
from faao_mav.plan import Wind

FLIGHTS = Path(__file__).parents[1] / "tests" / "data" / "flights"

_ARDUCOPTER_FITTED = """line-20m-8ms line-5m-8ms line-80m-8ms speeds-150m zigzag-100m-8ms
    zigzag-100m-8ms-accel500-jerk5"""
_ARDUPLANE_FITTED = """sea-along-14 sea-along-22 sea-zigzag-300m-14 sea-corners-500m-16
    sea-wandering-0 sea-circle-200m-16 sea-bends-0 sea-sharp-400m-18 sea-steps-300m sea-speedsteps
    sea-wandering-4 sea-plan-240-12"""
_PX4_HELD_OUT = """bends-10-middle brief-80-7 circle-60m-20m corners-40m-gentle curved-75-s-8
    holds-60m-suited line-10m long-300m slow-90-s-4 speeds-40m-suited unequal-40m-gentle wandering-1
    wandering-4-suited wandering-8-gentle zigzag-100m-lively two-hovers-200-s-9 free-ends-90-10"""
_USES = {
    "arducopter": ("held out", {"fitted": _ARDUCOPTER_FITTED}),
    "arduplane": ("held out", {"fitted": _ARDUPLANE_FITTED}),
    "px4": ("fitted", {"held out": _PX4_HELD_OUT, "slow": "slow slow-suited"}),
}
"""The use of most calm flights of an autopilot, and the others that have another."""

MADE = (
    "brief-80-7", "copter_relay-120-s-8", "curved-100-s-7", "curved-150-s-8", "curved-75-s-8",
    "free-ends-90-10", "keep-100-6", "short-60-s-6", "slow-90-s-4", "two-hovers-200-s-9",
)  # fmt: skip
"""PX4's flights of missions that were made for a plan."""

PLANE = {
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

PLANE_BODY = {"airspeed_exponent": 1}
"""What the simulator's plane of before July 2026 has, which flew, and that of `sitl` has not."""

_TAKEN_OFF = 0.01
"""How far below the first waypoint ArduCopter's take-off ends, m."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recorded flight: its path, and the track with t = 0 when the first leg became current.

    `left` (m,), s, is when each waypoint stopped being the current item, NaN for the last.
    `before`, m/s, was commanded on the way to the first waypoint, NaN if nothing was. `taken_off`
    are place and velocity, (3,), m and m/s, in the first sample after the take-off, of a plane.
    """

    path: FlightPath
    t: Real
    position: Real
    left: Real
    before: float
    taken_off: tuple[Real, Real] | None


@dataclass(frozen=True)
class Row:
    """Errors of one flight: seconds and metres."""

    name: str
    use: str
    arrival_rms: float
    arrival_worst: float
    position_rms: float
    position_worst: float
    path_error: float


def mission_of(name: str) -> str:
    """Return the name of the mission that was flown: without the wind of the flight."""
    return name.partition("-wind")[0]


def wind_of(name: str) -> Wind:
    """Return the wind of the flight `name`."""
    speed, _, degrees = name.partition("-wind")[2].partition("from")
    return Wind(speed=float(speed or 0), from_degrees=float(degrees or 0))


def parameters_of(name: str) -> dict[str, float]:
    """Return what was not ArduCopter's default in its flight `name`."""
    if name == "line-20m-8ms-jerk5":
        return {"WPNAV_ACCEL": 500.0, "WPNAV_JERK": 5.0}
    given = {"WPNAV_ACCEL": r"accel(\d+)", "WPNAV_JERK": r"jerk(\d+)"}
    found = {parameter: re.search(pattern, name) for parameter, pattern in given.items()}
    return {parameter: float(match[1]) for parameter, match in found.items() if match}


def names(folder: str) -> list[str]:
    """Return the flights of an autopilot."""
    return sorted(path.stem for path in (FLIGHTS / folder).glob("*.csv"))


def rows(folder: str) -> list[Row]:
    """Predict every recorded flight of an autopilot and compare."""
    return [row(folder, name) for name in names(folder)]


def row(folder: str, name: str) -> Row:
    """Predict one recorded flight and compare."""
    recorded, most = _read(FLIGHTS / folder, name), 0
    path = recorded.path
    match folder:
        case "px4":
            given = read_parameters(FLIGHTS / folder / f"{mission_of(name)}.params")
            vehicle = Vehicle("px4", "copter", given, name)
            flown = vehicle.flight_model().fly(path)
        case "arducopter":
            vehicle = Vehicle("ardupilot", "copter", parameters_of(name), name)
            model = vehicle.flight_model(-35.36)
            before = model.cruise_speed if math.isnan(recorded.before) else recorded.before
            start = path.points[0] - [0.0, 0.0, _TAKEN_OFF]
            path = replace(path, holds=np.floor(path.holds))
            flown, most = model.fly(_with(path, start, before)), 1
        case _:
            # When the last waypoint is left depends on where the item after it is. The flight is
            # aligned at the second one, where the speed of the take-off is spent.
            assert recorded.taken_off is not None
            place, velocity = recorded.taken_off
            vehicle = Vehicle("ardupilot", "plane", PLANE, name, PlaneBody(**PLANE_BODY))
            elevation = 584.0 if name.startswith("high") else 0.0
            whole = _with(path, place, recorded.before)
            whole = replace(whole, elevation=elevation, entry=velocity)
            flown, most = vehicle.flight_model().fly(whole), 2
            recorded.left[-1], run_in = np.nan, recorded.left[1]
            recorded = replace(recorded, t=recorded.t - run_in, left=recorded.left[1:] - run_in)
    flown = replace(flown, arrivals=flown.arrivals[most:], departures=flown.departures[most:])
    return _compared(name, _use(folder, name), recorded, flown)


def _use(folder: str, name: str) -> str:
    if "wind" in name:
        return f"in {wind_of(name).speed:g} m/s"
    if "spline" in name:
        return "splines"
    usual, others = _USES[folder]
    use = next((use for use, those in others.items() if name in those.split()), usual)
    return f"{use}, {name.split('-')[0]}" if (folder, use) == ("arduplane", "held out") else use


def _with(path: FlightPath, place: Real, speed: float) -> FlightPath:
    """Return `path` from `place` (3,), m, on, at `speed`, m/s, to its first point."""
    return replace(
        path,
        points=np.vstack([place, path.points]),
        speeds=np.append(speed, path.speeds),
        holds=np.append(0.0, path.holds),
        splines=np.append(False, path.splines),
        radii=np.append(0.0, path.radii),
    )


def _read(folder: Path, name: str) -> Recorded:
    """Read a mission and its track."""
    mission = read_wpl((folder / f"{mission_of(name)}.waypoints").read_text()).mission
    assert mission.home is not None
    frame = LocalFrame(mission.home.latitude, mission.home.longitude)
    speed, points = math.nan, list[tuple[float, ...]]()
    # The current item counts home as 0, but for PX4.
    for index, item in enumerate(mission.items, start=int(folder.name != "px4")):
        if item.command == Command.DO_CHANGE_SPEED:
            speed = item.params[1]
        elif item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT):
            place, spline = frame.to_local(item.x, item.y), item.command != Command.NAV_WAYPOINT
            points.append((index, *place, item.z, speed, *item.params[:2], spline))
    items, east, north, up, speeds, holds, radii, splines = np.array(points).T
    with (folder / f"{name}.csv").open() as file:
        table = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    column = {key: np.array([row[key] for row in table]) for key in table[0]}
    horizontal = frame.to_local(column["lat"], column["lon"])
    taken_off = None
    if "vx" in column:
        k = int(np.argmax(column["seq"] > 1))
        velocity = np.array([column["vy"][k], column["vx"][k], -column["vz"][k]])
        taken_off = np.append(horizontal[k], column["alt_rel_m"][k]), velocity
    t, left = column["t_s"], np.full(len(items), np.nan)
    for k, item in enumerate(items):
        later = np.flatnonzero(column["seq"] > item)
        if len(later):
            left[k] = (t[later[0]] + t[later[0] - 1]) / 2
    path = FlightPath(
        points=np.column_stack([east, north, up]),
        speeds=speeds[1:],
        holds=holds,
        splines=splines.astype(bool),
        radii=radii,
        wind=wind_of(name).velocity,
    )
    return Recorded(path, t - left[0], horizontal, left - left[0], float(speeds[0]), taken_off)


def _compared(name: str, use: str, recorded: Recorded, flown: Flown) -> Row:
    """Return how far the prediction `flown` is from the record."""
    start = flown.departures[0]
    known = np.isfinite(recorded.left)
    late = (flown.departures - start - recorded.left)[known][1:]
    during = (recorded.t > 0) & (recorded.t < flown.departures[known][-1] - start)
    there, t = recorded.position[during], recorded.t[during] + start
    here = np.stack([np.interp(t, flown.t, x) for x in flown.position.T[:2]], axis=-1)
    apart = np.hypot(*(here - there).T)
    nearest = [np.hypot(*(flown.position[:, :2] - place).T).min() for place in there]
    arrivals, positions = float(np.abs(late).max()), float(apart.max())
    return Row(name, use, _rms(late), arrivals, _rms(apart), positions, float(np.max(nearest)))


def together(rows: list[Row], use: str) -> tuple[float, float]:
    """Return the rms over flights of the arrival error, s, and of the position error, m."""
    chosen = [row for row in rows if row.use == use]
    arrivals, positions = (
        [getattr(x, f"{y}_rms") for x in chosen] for y in ("arrival", "position")
    )
    return _rms(np.array(arrivals)), _rms(np.array(positions))


def show(rows: list[Row]) -> None:
    """Print a table, with the rms over the flights of each use."""
    print(f"{'flight':<40}{'':<16}{'arrivals, s':<16}{'positions, m':<16}path, m")
    print(f"{'':<56}{'rms':<8}{'worst':<8}{'rms':<8}{'worst':<8}worst")
    for each in rows:
        print(
            f"{each.name:<40}{each.use:<16}{each.arrival_rms:<8.2f}{each.arrival_worst:<8.2f}"
            f"{each.position_rms:<8.2f}{each.position_worst:<8.2f}{each.path_error:.2f}"
        )
    for use in sorted({each.use for each in rows}):
        arrival, position = together(rows, use)
        print(f"{'all, rms':<40}{use:<16}{arrival:<16.2f}{position:.2f}")


def _rms(values: Real) -> float:
    return float(np.sqrt(np.mean(values * values)))


if __name__ == "__main__":
    for chosen in sys.argv[1:] or _USES:
        print(f"\n{chosen}")
        show(rows(chosen))
