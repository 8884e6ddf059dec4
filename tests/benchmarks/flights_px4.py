"""Predicted against recorded PX4 flights (tests/data/flights/px4).

    python tests/benchmarks/flights_px4.py

The constants that the model calls fitted make the rms over the "fitted" flights of the arrival
error (s) and a third of the position error (m) small, as round figures near a flat minimum. The
flights "held out" were not looked at for that. Those that are "slow" have legs below 1 m/s, on
which half a metre of error in the aircraft's own position is up to a second: repeats differ by as
much, and missions are made without such legs.
"""

from recorded import FLIGHTS, Row, compared, mission_of, read, show

from faao_mav.mission.formats.parameter_file import read_parameters
from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.px4 import Px4

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


if __name__ == "__main__":
    show(rows())
