"""Predicted against recorded PX4 flights (tests/data/flights/px4).

    python benchmarks/flights_px4.py [OTHER]

The constants that the model calls fitted make the rms over the "fitted" flights of the arrival
error (s) and a third of the position error (m) small, as round figures near a flat minimum. The
flights "held out" were not looked at for that. Those that are "slow" have legs below 1 m/s, on
which half a metre of error in the aircraft's own position is up to a second: repeats differ by as
much, and missions are made without such legs.

With OTHER, a folder of tracks NAME.NUMBER.csv (`record_px4.py --again OTHER`), it is told how well
flights of one mission predict each other: arrivals (s rms) and positions (m rms) of the prediction
beside each flight, of each flight beside the mean of the others, of the prediction beside the mean.
"""

import math
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from recorded import FLIGHTS, Row, compared, mission_of, read, show

from faao_mav.arrays import Real
from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.px4 import Px4
from faao_mav.mission.formats.parameter_file import read_parameters

FOLDER = FLIGHTS / "px4"

"""Where the recorded missions and tracks are, with the parameters that they were flown with."""

HELD_OUT = (
    "bends-10-middle",
    "brief-80-7",
    "circle-60m-20m",
    "corners-40m-gentle",
    "curved-75-s-8",
    "holds-60m-suited",
    "line-10m",
    "long-300m",
    "slow-90-s-4",
    "speeds-40m-suited",
    "unequal-40m-gentle",
    "wandering-1",
    "wandering-4-suited",
    "wandering-8-gentle",
    "zigzag-100m-lively",
    "two-hovers-200-s-9",
    "free-ends-90-10",
)

SLOW = ("slow", "slow-suited")

NAMES = sorted(path.stem for path in FOLDER.glob("*.csv"))


def rows(names: list[str] = NAMES) -> list[Row]:
    """Fly the recorded missions and compare."""
    return [row(name) for name in names]


def row(name: str) -> Row:
    recorded = read(FOLDER, name, home_row=False)
    parameters = read_parameters(FOLDER / f"{mission_of(name)}.params")
    model = Px4.from_vehicle(Vehicle("px4", "copter", parameters, name))
    use = "slow" if name in SLOW else "held out" if name in HELD_OUT else "fitted"
    use = "in wind" if "wind" in name else use
    return compared(name, use, recorded, model.fly(recorded.path))


def repeated(name: str, others: Path) -> list[float]:
    """Return the six errors of the prediction and of the flights of one mission."""
    tracks = [FOLDER / f"{name}.csv", *sorted(others.glob(f"{name}.*.csv"))]
    parameters = read_parameters(FOLDER / f"{name}.params")
    with tempfile.TemporaryDirectory() as where:
        shutil.copy(FOLDER / f"{name}.waypoints", where)
        flights = []
        for track in tracks:
            shutil.copy(track, Path(where) / f"{name}.csv")
            flights.append(read(Path(where), name, home_row=False))
    flown = Px4.from_vehicle(Vehicle("px4", "copter", parameters, name)).fly(flights[0].path)
    known = np.flatnonzero(np.isfinite(flights[0].left))[1:]
    foreseen = (flown.departures - flown.departures[0])[known]
    left = np.array([flight.left[known] for flight in flights])
    t = np.arange(0.5, min(foreseen[-1], left[:, -1].min()), 0.5)
    places = np.array([[np.interp(t, each.t, x) for x in each.position.T] for each in flights])
    there = np.array([np.interp(t + flown.departures[0], flown.t, x) for x in flown.position.T[:2]])

    def apart(arrivals: Real, positions: Real) -> list[float]:
        return [
            math.sqrt(np.mean(arrivals**2)),
            math.sqrt(np.mean(np.sum(positions**2, axis=-2))),
        ]

    count = len(flights)
    from_others = count / (count - 1)  # times the distance from the mean of all
    return [
        *apart(foreseen - left, there - places),
        *apart(from_others * (left - left.mean(0)), from_others * (places - places.mean(0))),
        *apart(foreseen - left.mean(0), there - places.mean(0)),
    ]


def main() -> None:
    """Show how far predictions are from flights, or flights from each other."""
    if len(sys.argv) == 1:
        show(rows())
        return
    table = {name: repeated(name, Path(sys.argv[1])) for name in HELD_OUT}
    table["all, rms"] = np.sqrt(np.mean(np.square(list(table.values())), axis=0)).tolist()
    for name, errors in table.items():
        print(f"{name:<24}" + "".join(f"{error:7.2f}" for error in errors))


if __name__ == "__main__":
    main()
