"""How long predicting whole missions of ArduCopter and PX4 takes, by their number of items.

python benchmarks/predict.py
"""

import time

import numpy as np

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.predict import predict
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command, Frame, Home, Mission, MissionItem

HOME = Home(47.4, 8.5, 400.0)


def survey(items: int) -> Mission:
    """Return a mission of `items` items: take-off, lanes 40 m apart, a speed for each fifth leg."""
    lanes = np.arange(items)
    north = np.where((lanes + 1) % 4 < 2, 0.0, 60.0)
    latitudes, longitudes = LocalFrame(HOME.latitude, HOME.longitude).to_geodetic(
        np.column_stack([20.0 * (lanes // 2), north])
    )
    found = [
        MissionItem(
            Command.NAV_TAKEOFF,
            Frame.GLOBAL_RELATIVE_ALT,
            x=HOME.latitude,
            y=HOME.longitude,
            z=30.0,
        )
    ]
    for k, (x, y) in enumerate(zip(latitudes, longitudes, strict=True)):
        if k % 5 == 0:
            speed = (1.0, 4.0 + k % 4, -1.0, 0.0)
            found.append(MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, speed))
        found.append(
            MissionItem(
                Command.NAV_WAYPOINT,
                Frame.GLOBAL_RELATIVE_ALT,
                x=float(x),
                y=float(y),
                z=30.0,
            )
        )
    return Mission((*found[: items - 1], MissionItem(20, Frame.MISSION)), HOME)


def main() -> None:
    autopilots: tuple[str, ...] = ("ardupilot", "px4")
    print("autopilot   items   flight, s   prediction, s")
    for autopilot in autopilots:
        for items in (20, 100, 600):
            mission = survey(items)
            begun = time.perf_counter()
            track = predict(mission, Vehicle(autopilot))
            taken = time.perf_counter() - begun
            print(f"{autopilot:<12}{items:<8}{track.t[-1]:<12.0f}{taken:.2f}")


if __name__ == "__main__":
    main()
