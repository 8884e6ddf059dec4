"""Predicted against recorded ArduCopter flights (tests/data/flights/arducopter).

    python tests/benchmarks/flights_arducopter.py

The lags of the model are fitted to twelve flights over plain waypoints. Three more are held out: no
constant was fitted to them, but their errors were seen while the model was built, so they are no
blind test.
"""

import re

from recorded import FLIGHTS, Row, compared, read, show

from faao_mav.mission.flight.arducopter import ArduCopter
from faao_mav.mission.vehicle import Vehicle

HELD_OUT = ("circle-100m-20m-8ms", "zigzag-100m-8ms-accel100", "zigzag-60m-5ms")
SPLINES = ("spline-circle-100m-20m-8ms", "spline-circle-100m-40m-8ms", "spline-ess-60m-15m-6ms")
FITTED = tuple(
    path.stem
    for path in sorted((FLIGHTS / "arducopter").glob("*.csv"))
    if path.stem not in HELD_OUT + SPLINES
)


def parameters_of(name: str) -> dict[str, float]:
    """Return what was not ArduCopter's default in the flight `name`."""
    if name == "line-20m-8ms-jerk5":
        return {"WPNAV_ACCEL": 500.0, "WPNAV_JERK": 5.0}
    given = {"WPNAV_ACCEL": r"accel(\d+)", "WPNAV_JERK": r"jerk(\d+)"}
    found = {parameter: re.search(pattern, name) for parameter, pattern in given.items()}
    return {parameter: float(match[1]) for parameter, match in found.items() if match}


def rows() -> list[Row]:
    """Fly every recorded mission and compare."""
    return [row(name) for name in (*FITTED, *HELD_OUT, *SPLINES)]


def row(name: str) -> Row:
    recorded = read(FLIGHTS / "arducopter", name, home_row=True)
    vehicle = Vehicle("ardupilot", "copter", parameters_of(name), name)
    use = "fitted" if name in FITTED else "held out" if name in HELD_OUT else "splines"
    flown = ArduCopter.from_vehicle(vehicle).fly(recorded.path)
    return compared(name, use, recorded, flown)


if __name__ == "__main__":
    show(rows())
