"""Predicted against recorded PX4 flights (tests/data/flights/px4).

    python tests/benchmarks/flights_px4.py

Four constants of the model are fitted to eight of the twelve flights: they make the rms over
flights of the arrival error (s) and a sixth of the position error (m) small, as round figures near
a flat minimum. The other four flights are held out: no constant was fitted to them, but their
errors were seen while the model was built, so they are no blind test.

Prediction and record are aligned once per flight, at the start: the predicted time 0 is when the
first leg becomes current, half-way between the two samples (0.2 s apart) that show it. Arrival
errors are of the moments at which PX4 turns to the next item, relative to that; position errors
are horizontal, at equal times, until the last of these moments; the path error is the largest
distance of the recorded track from the predicted one, whenever it was there.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command
from faao_mav.mission.flight.path import FlightPath
from faao_mav.mission.flight.px4 import Px4
from faao_mav.mission.formats.wpl import read_wpl
from faao_mav.mission.vehicle import Vehicle

FLIGHTS = Path(__file__).parent.parent / "data" / "flights" / "px4"

FITTED = (
    "circle-100m-20m-8ms",
    "holds-100m-8ms",
    "line-5m-8ms",
    "line-20m-8ms",
    "line-40m-8ms",
    "speeds-150m",
    "zigzag-100m-8ms",
    "zigzag-100m-8ms-acc5-jerk10",
)
HELD_OUT = ("line-10m-8ms", "line-40m-4ms", "speeds-60m", "zigzag-60m-5ms")

PARAMETERS = {"zigzag-100m-8ms-acc5-jerk10": {"MPC_ACC_HOR": 5.0, "MPC_JERK_AUTO": 10.0}}
"""What was not PX4's default."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recorded flight: its path, and the track with t = 0 when the first leg became current.

    `left` (m,), s, is when each waypoint stopped being the current item, NaN for the last.
    """

    path: FlightPath
    t: Real
    position: Real
    left: Real


@dataclass(frozen=True)
class Row:
    """Errors of one flight: seconds and metres."""

    name: str
    fitted: bool
    arrival_rms: float
    arrival_worst: float
    position_rms: float
    path_error: float


def rows() -> list[Row]:
    """Fly every recorded mission and compare."""
    return [row(name) for name in (*FITTED, *HELD_OUT)]


def row(name: str) -> Row:
    recorded = read(name)
    model = Px4.from_vehicle(Vehicle("px4", "copter", PARAMETERS.get(name, {}), name))
    flown = model.fly(recorded.path)
    known = np.isfinite(recorded.left)
    late = (flown.departures - recorded.left)[known][1:]
    compared = (recorded.t > 0) & (recorded.t < flown.departures[known][-1])
    there = recorded.position[compared]
    here = np.stack([np.interp(recorded.t[compared], flown.t, x) for x in flown.position.T[:2]], -1)
    apart = np.hypot(*(here - there).T)
    nearest = [np.hypot(*(flown.position[:, :2] - place).T).min() for place in there]
    return Row(
        name,
        name in FITTED,
        _rms(late),
        float(np.abs(late).max()),
        _rms(apart),
        float(np.max(nearest)),
    )


def together(rows: list[Row], fitted: bool) -> tuple[float, float]:
    """Return the rms over flights of the arrival error, s, and of the position error, m."""
    chosen = [row for row in rows if row.fitted == fitted]
    return (
        _rms(np.array([row.arrival_rms for row in chosen])),
        _rms(np.array([row.position_rms for row in chosen])),
    )


def read(name: str) -> Recorded:
    """Read a mission and its track."""
    mission = read_wpl((FLIGHTS / f"{name}.waypoints").read_text(), name)
    assert mission.home is not None
    frame = LocalFrame(mission.home.latitude, mission.home.longitude)
    items, points, speeds, holds = [], [], [], []
    speed = 0.0
    for index, item in enumerate(mission.items):
        if item.command == Command.DO_CHANGE_SPEED:
            speed = item.params[1]
        elif item.command == Command.NAV_WAYPOINT:
            items.append(index)
            points.append([*frame.to_local(item.x, item.y), item.z])
            speeds.append(speed)
            holds.append(item.params[0])
    with (FLIGHTS / f"{name}.csv").open() as file:
        table = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    column = {key: np.array([row[key] for row in table]) for key in table[0]}
    left = _left(column["t_s"], column["seq"], np.array(items))
    path = FlightPath(
        np.array(points),
        np.array(speeds[1:]),
        np.array(holds),
        np.zeros(len(points), dtype=bool),
        np.zeros(len(points)),
    )
    horizontal = frame.to_local(column["lat"], column["lon"])
    return Recorded(path, column["t_s"] - left[0], horizontal, left - left[0])


def _left(t: Real, current: Real, items: NDArray[np.int_]) -> Real:
    """Return when each of `items` stopped being `current`: `seq` counts rows without home."""
    times = np.full(len(items), np.nan)
    for k, item in enumerate(items):
        later = np.flatnonzero(current > item)
        if len(later):
            times[k] = (t[later[0]] + t[later[0] - 1]) / 2
    return times


def _rms(values: Real) -> float:
    return float(np.sqrt(np.mean(values * values)))


def main() -> None:
    table = rows()
    print(f"{'flight':<30}{'':<10}{'arrivals, s':<16}{'position, m':<13}path, m")
    print(f"{'':<40}{'rms':<8}{'worst':<8}{'rms':<13}worst")
    for line in table:
        use = "fitted" if line.fitted else "held out"
        print(
            f"{line.name:<30}{use:<10}{line.arrival_rms:<8.2f}{line.arrival_worst:<8.2f}"
            f"{line.position_rms:<13.2f}{line.path_error:.2f}"
        )
    for fitted in (True, False):
        arrival, position = together(table, fitted)
        use = "fitted" if fitted else "held out"
        print(f"{'all, rms':<30}{use:<10}{arrival:<16.2f}{position:.2f}")


if __name__ == "__main__":
    main()
