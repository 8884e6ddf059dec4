"""How long a validation takes: `python benchmarks/validation.py`.

A mission of 650 items with home, as long as ArduPilot surely stores: waypoints along a spiral, a
speed before each, a fence of two polygons and four circles, and a predicted flight at 10 Hz.
"""

import math
import time

import numpy as np

from faao_mav.autopilot import Track, Vehicle
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.fence import Circle, Fence, Polygon
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.validate import Finding, Limits, ValidationContext, validate

HOME = Home(-35.363262, 149.165237, 584.0)
FRAME = LocalFrame(HOME.latitude, HOME.longitude)
WAYPOINTS, SPACING, SPEED, STEP = 323, 25.0, 8.0, 0.1
REPEATS = 5


def spiral() -> np.ndarray:
    """Places (n, 2), m, `SPACING` apart on a spiral whose turns are 60 m apart."""
    angle, places = 0.0, []
    for _ in range(WAYPOINTS):
        radius = 20 + 60 * angle / (2 * math.pi)
        places.append((radius * math.sin(angle), radius * math.cos(angle)))
        angle += SPACING / radius
    return np.array(places)


def item(command: int, place: np.ndarray) -> MissionItem:
    latitude, longitude = (float(value) for value in FRAME.to_geodetic(place))
    return MissionItem(
        command, Frame.GLOBAL_RELATIVE_ALT, (0.0, 0.0, 0.0, 0.0), latitude, longitude, 50.0
    )


def mission_along(places: np.ndarray) -> Mission:
    items = [item(Command.NAV_TAKEOFF, np.zeros(2))]
    for place in places:
        items.append(MissionItem(Command.DO_CHANGE_SPEED, Frame.MISSION, (1.0, SPEED, -1.0, 0.0)))
        items.append(item(Command.NAV_WAYPOINT, place))
    items += [item(Command.NAV_WAYPOINT, places[-1] / 2)]
    items += [MissionItem(Command.NAV_RETURN_TO_LAUNCH, Frame.MISSION)]
    half = float(np.abs(places).max()) + 50
    corners = ((-half, -half), (half, -half), (half, half), (-half, half))
    square = Polygon(tuple(latlon(corner) for corner in corners), inclusion=True)
    notch = Polygon(
        tuple(latlon((half + dx, dy)) for dx, dy in ((0, 0), (99, 0), (0, 99))), inclusion=False
    )
    circles = tuple(Circle(latlon(corner), 40.0, inclusion=False) for corner in corners)
    return Mission(tuple(items), HOME, Fence((square, notch), circles))


def latlon(place: tuple[float, float]) -> tuple[float, float]:
    latitude, longitude = FRAME.to_geodetic(place)
    return float(latitude), float(longitude)


def flight_along(places: np.ndarray, items: int) -> Track:
    """The places in turn at the commanded speed, sampled at 10 Hz."""
    lengths = np.hypot(*np.diff(places, axis=0).T)
    times = np.concatenate([[0.0], np.cumsum(lengths) / SPEED])
    t = np.arange(0.0, times[-1], STEP)
    ground = np.column_stack([np.interp(t, times, places[:, k]) for k in (0, 1)])
    position = np.column_stack([ground, np.full(len(t), 50.0)])
    velocity = np.gradient(position, STEP, axis=0)
    leg = np.minimum(np.searchsorted(times, t, side="right"), len(places) - 1)
    return Track(t, position, velocity, 2 * leg + 2, np.full(items, np.nan), FRAME)


def main() -> None:
    places = spiral()
    mission = mission_along(places)
    flight = flight_along(places, len(mission.items))
    print(f"{len(mission.items) + 1} items with home, {len(flight.t)} samples of flight")
    for autopilot in ("ardupilot", "px4"):
        vehicle = Vehicle(autopilot)
        for name, track in (("without a flight", None), ("with it", flight)):
            best = math.inf
            findings: tuple[Finding, ...] = ()
            for _ in range(REPEATS):
                started = time.perf_counter()
                limits = Limits(max_altitude=120.0)
                findings = validate(ValidationContext(mission, vehicle, track, limits))
                best = min(best, time.perf_counter() - started)
            print(f"{autopilot:9} {name:16} {1000 * best:6.0f} ms, {len(findings)} findings")


if __name__ == "__main__":
    main()
