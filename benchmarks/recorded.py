"""Recorded flights (tests/data/flights), and how far predictions are from them.

Prediction and record are aligned once per flight, at the start: when the first leg becomes
current, half-way between the two samples (0.2 s apart) that show it. Arrival errors are of the
moments at which the autopilot turns to the next item, relative to that; position errors are
horizontal, at equal times, until the last of these moments; the path error is the largest
distance of the recorded track from the predicted one, whenever it was there.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.autopilot.flight_path import FlightPath, Flown
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command
from faao_mav.mission.formats.wpl import read_wpl
from faao_mav.plan import Wind

FLIGHTS = Path(__file__).parents[1] / "tests" / "data" / "flights"


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recorded flight: its path, and the track with t = 0 when the first leg became current.

    `left` (m,), s, is when each waypoint stopped being the current item, NaN for the last.
    `before`, m/s, was commanded on the way to the first waypoint, NaN if nothing was.
    """

    path: FlightPath
    t: Real
    position: Real
    left: Real
    before: float


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


def read(folder: Path, name: str, *, home_row: bool) -> Recorded:
    """Read a mission and its track; `home_row`: whether the current item counts home as 0."""
    mission = read_wpl((folder / f"{mission_of(name)}.waypoints").read_text()).mission
    assert mission.home is not None
    frame = LocalFrame(mission.home.latitude, mission.home.longitude)
    items, points, speeds, holds, radii, splines = [], [], [], [], [], []
    speed = math.nan
    for index, item in enumerate(mission.items, start=home_row):
        if item.command == Command.DO_CHANGE_SPEED:
            speed = item.params[1]
        elif item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT):
            items.append(index)
            points.append([*frame.to_local(item.x, item.y), item.z])
            speeds.append(speed)
            holds.append(item.params[0])
            radii.append(item.params[1])
            splines.append(item.command == Command.NAV_SPLINE_WAYPOINT)
    with (folder / f"{name}.csv").open() as file:
        table = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    column = {key: np.array([row[key] for row in table]) for key in table[0]}
    left = _left(column["t_s"], column["seq"], np.array(items))
    path = FlightPath(
        points=np.array(points),
        speeds=np.array(speeds[1:]),
        holds=np.array(holds),
        splines=np.array(splines),
        radii=np.array(radii),
        wind=wind_of(name).velocity,
    )
    horizontal = frame.to_local(column["lat"], column["lon"])
    return Recorded(path, column["t_s"] - left[0], horizontal, left - left[0], speeds[0])


def compared(name: str, use: str, recorded: Recorded, flown: Flown) -> Row:
    """Return how far the prediction `flown` is from the record."""
    start = flown.departures[0]
    known = np.isfinite(recorded.left)
    late = (flown.departures - start - recorded.left)[known][1:]
    during = (recorded.t > 0) & (recorded.t < flown.departures[known][-1] - start)
    there, t = recorded.position[during], recorded.t[during] + start
    here = np.stack([np.interp(t, flown.t, x) for x in flown.position.T[:2]], axis=-1)
    apart = np.hypot(*(here - there).T)
    nearest = [np.hypot(*(flown.position[:, :2] - place).T).min() for place in there]
    return Row(
        name,
        use,
        arrival_rms=_rms(late),
        arrival_worst=float(np.abs(late).max()),
        position_rms=_rms(apart),
        position_worst=float(apart.max()),
        path_error=float(np.max(nearest)),
    )


def together(rows: list[Row], use: str) -> tuple[float, float]:
    """Return the rms over flights of the arrival error, s, and of the position error, m."""
    chosen = [row for row in rows if row.use == use]
    return (
        _rms(np.array([row.arrival_rms for row in chosen])),
        _rms(np.array([row.position_rms for row in chosen])),
    )


def show(rows: list[Row]) -> None:
    """Print a table, with the rms over the flights of each use."""
    print(f"{'flight':<33}{'':<10}{'arrivals, s':<16}{'positions, m':<16}path, m")
    print(f"{'':<43}{'rms':<8}{'worst':<8}{'rms':<8}{'worst':<8}worst")
    for row in rows:
        print(
            f"{row.name:<33}{row.use:<10}{row.arrival_rms:<8.2f}{row.arrival_worst:<8.2f}"
            f"{row.position_rms:<8.2f}{row.position_worst:<8.2f}{row.path_error:.2f}"
        )
    for use in dict.fromkeys(row.use for row in rows):
        arrival, position = together(rows, use)
        print(f"{'all, rms':<33}{use:<10}{arrival:<16.2f}{position:.2f}")


def _left(t: Real, current: Real, items: NDArray[np.int_]) -> Real:
    """Return when each of `items` stopped being `current`."""
    times = np.full(len(items), np.nan)
    for k, item in enumerate(items):
        later = np.flatnonzero(current > item)
        if len(later):
            times[k] = (t[later[0]] + t[later[0] - 1]) / 2
    return times


def _rms(values: Real) -> float:
    return float(np.sqrt(np.mean(values * values)))
