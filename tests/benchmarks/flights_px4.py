"""Predicted against recorded PX4 flights (tests/data/flights/px4).

    python tests/benchmarks/flights_px4.py

Four constants of the model are fitted to eight of the twelve flights: they make the rms over
flights of the arrival error (s) and a sixth of the position error (m) small, as round figures near
a flat minimum. The other four flights are held out: no constant was fitted to them, but their
errors were seen while the model was built, so they are no blind test.
"""

from recorded import FLIGHTS, Row, compared, read, show

from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.px4 import Px4

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


def rows() -> list[Row]:
    """Fly every recorded mission and compare."""
    return [row(name) for name in (*FITTED, *HELD_OUT)]


def row(name: str) -> Row:
    recorded = read(FLIGHTS / "px4", name, home_row=False)
    model = Px4.from_vehicle(Vehicle("px4", "copter", PARAMETERS.get(name, {}), name))
    use = "fitted" if name in FITTED else "held out"
    return compared(name, use, recorded, model.fly(recorded.path))


if __name__ == "__main__":
    show(rows())
