"""Fly recorded missions again in wind, in real autopilots' simulators, and keep the thinned tracks.

    FAAO_AUTOPILOTS=FOLDER python benchmarks/record_wind.py [FOLDER ...] [NAME ...]

A flight NAME-windSPEEDfromDEGREES is that of the mission NAME (of the folders arducopter, arduplane
and px4 in tests/data/flights) in a steady wind, m/s and degrees clockwise from north; ArduCopter's
parameters are those that the mission's name tells.
"""

import os
import sys
from pathlib import Path

from flights_arducopter import parameters_of
from record_plane import fly
from record_px4 import flown_by, in_wind, keep
from recorded import FLIGHTS, mission_of, wind_of

COLUMNS = ("t_s", "lat", "lon", "alt_rel_m", "seq")
WINDS = {
    "arducopter": ("wind3from250", "wind6from20", "wind9from130", "wind9from210", "wind9from300"),
    "arduplane": ("wind3from250", "wind6from20"),
    "px4": ("wind3from250", "wind6from20", "wind9from130"),
}
MISSIONS = {
    "arducopter": ("line-80m-8ms", "zigzag-100m-8ms", "holds-100m-8ms", "speeds-150m"),
    "arduplane": (
        "sea-corners-500m-16",
        "sea-wandering-2",
        "high-bends-1",
        "sea-circle-120m-15",
        "sea-steps-300m",
        "high-zigzag-300m-14",
    ),
    "px4": ("zigzag-100m-lively", "holds-100m", "long-300m", "corners-60m-suited"),
}


def options(folder: str, name: str) -> list[str]:
    """Return the options of the runner for the flight `name`, the wind aside."""
    if folder == "px4":
        parameters = FLIGHTS / folder / f"{mission_of(name)}.params"
        return ["--param-file", str(parameters), "--params", "SIH_KDV=0.2", "--speedup", "10"]
    given = ",".join(f"{key}={value}" for key, value in parameters_of(name).items())
    return ["--speedup", "20", "--params", given]


def main() -> None:
    """Record the flights that are named, or all."""
    autopilots = Path(os.environ["FAAO_AUTOPILOTS"])
    for folder, missions in MISSIONS.items():
        runner = autopilots / ("fly_px4.py" if folder == "px4" else "fly_arducopter.py")
        for name in [f"{mission}-{wind}" for mission in missions for wind in WINDS[folder]]:
            if set(sys.argv[1:]) and not {folder, name} & set(sys.argv[1:]):
                continue
            mission = FLIGHTS / folder / f"{mission_of(name)}.waypoints"
            wind = in_wind(runner, wind_of(name))
            if folder == "arduplane":
                fly(runner, mission, FLIGHTS / folder / f"{name}.csv", wind)
            else:
                rows = flown_by(runner, mission, [*options(folder, name), *wind])
                keep(rows, FLIGHTS / folder / f"{name}.csv", COLUMNS)
            print(name, flush=True)


if __name__ == "__main__":
    main()
