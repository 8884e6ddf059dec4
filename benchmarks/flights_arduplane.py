"""Predicted against recorded ArduPlane flights (tests/data/flights/arduplane).

    python benchmarks/flights_arduplane.py

The constants of the model are fitted to flights from sea level (`FITTED`); the other flights from
there, all from 584 m and all in wind, are held out of every fit. Predictions begin where the
take-off was over, at the recorded velocity. They are aligned at the second waypoint, where the
speed of the take-off is spent: a plan begins after such a run-in, too.
"""

import csv
from dataclasses import replace

import numpy as np
from record_plane import BODY, ELEVATIONS, PARAMETERS, PLACE
from recorded import FLIGHTS, Row, compared, read, show, wind_of

from faao_mav.arrays import Real
from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.ardupilot.plane import ArduPlane
from faao_mav.autopilot.body import PlaneBody
from faao_mav.autopilot.flight_path import FlightPath
from faao_mav.geodesy import LocalFrame

FOLDER = FLIGHTS / "arduplane"
FITTED = (
    "sea-along-14",
    "sea-along-22",
    "sea-zigzag-300m-14",
    "sea-corners-500m-16",
    "sea-wandering-0",
    "sea-circle-200m-16",
    "sea-bends-0",
    "sea-sharp-400m-18",
    "sea-steps-300m",
    "sea-speedsteps",
    "sea-wandering-4",
    "sea-plan-240-12",
)
HELD_OUT = tuple(sorted(path.stem for path in FOLDER.glob("*.csv") if path.stem not in FITTED))
TAKE_OFF = 1  # the row of the take-off


def rows() -> list[Row]:
    """Fly every recorded mission and compare."""
    return [row(name) for name in (*FITTED, *HELD_OUT)]


def row(name: str) -> Row:
    recorded = read(FOLDER, name, home_row=True)
    # When the last waypoint is left depends on where the item after it is.
    recorded.left[-1] = np.nan
    vehicle = Vehicle("ardupilot", "plane", PARAMETERS, name, PlaneBody(**BODY))
    plane = ArduPlane.from_vehicle(vehicle)
    place, velocity = _taken_off(name)
    path = recorded.path
    whole = FlightPath(
        points=np.vstack([place, path.points]),
        speeds=np.append(recorded.before, path.speeds),
        holds=np.append(0.0, path.holds),
        splines=np.append(False, path.splines),
        radii=np.append(0.0, path.radii),
        elevation=ELEVATIONS[name.split("-")[0]],
        entry=velocity,
        wind=path.wind,
    )
    flown = plane.fly(whole)
    run_in = recorded.left[1]
    recorded = replace(recorded, t=recorded.t - run_in, left=recorded.left[1:] - run_in)
    after = replace(flown, arrivals=flown.arrivals[2:], departures=flown.departures[2:])
    use = "fitted" if name in FITTED else f"held out, {name.split('-')[0]}"
    if "wind" in name:
        use = f"in {wind_of(name).speed:g} m/s"
    return compared(name, use, recorded, after)


def _taken_off(name: str) -> tuple[Real, Real]:
    """Return place and velocity (3,), m and m/s, when the take-off was over."""
    with (FOLDER / f"{name}.csv").open() as file:
        table = list(csv.DictReader(file))
    row = next(row for row in table if int(row["seq"]) > TAKE_OFF)
    east, north = LocalFrame(*PLACE).to_local(float(row["lat"]), float(row["lon"]))
    velocity = [float(row["vy"]), float(row["vx"]), -float(row["vz"])]
    return np.array([east, north, float(row["alt_rel_m"])]), np.array(velocity)


if __name__ == "__main__":
    show(rows())
