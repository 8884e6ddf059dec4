"""Missions about a known home, in local metres, and tracks that fly them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from faao_mav.autopilot import Track, Vehicle
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.validate import Finding, Level, Limits, LinkCheck, validate
from faao_mav.validate.energy import EnergyUse

HOME = Home(-35.363262, 149.165237, 584.0)
FRAME = LocalFrame(HOME.latitude, HOME.longitude)

COPTER = Vehicle("ardupilot", "copter")
PLANE = Vehicle("ardupilot", "plane")
PX4 = Vehicle("px4", "copter")
PX4_PLANE = Vehicle("px4", "plane")
VEHICLES = (COPTER, PLANE, PX4, PX4_PLANE)


def having(vehicle: Vehicle, **parameters: float) -> Vehicle:
    return replace(vehicle, parameters=parameters)


def latlon(east: float, north: float) -> tuple[float, float]:
    latitude, longitude = FRAME.to_geodetic([east, north])
    return float(latitude), float(longitude)


def at(
    east: float,
    north: float,
    up: float,
    *params: float,
    command: int = Command.NAV_WAYPOINT,
    frame: int = Frame.GLOBAL_RELATIVE_ALT,
    autocontinue: bool = True,
) -> MissionItem:
    """An item that flies to a local place, by default a waypoint above home."""
    latitude, longitude = latlon(east, north)
    return raw(latitude, longitude, up, *params, command=command, frame=frame, go_on=autocontinue)


def four(*params: float) -> tuple[float, float, float, float]:
    one, two, three, last = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return one, two, three, last


def raw(
    x: float,
    y: float,
    z: float,
    *params: float,
    command: int = Command.NAV_WAYPOINT,
    frame: int = Frame.GLOBAL_RELATIVE_ALT,
    go_on: bool = True,
) -> MissionItem:
    return MissionItem(command, frame, four(*params), x, y, z, go_on)


def do(command: int, *params: float, frame: int = Frame.MISSION) -> MissionItem:
    """An item without a place."""
    return MissionItem(command, frame, four(*params))


def speed(value: float, kind: float = 1.0) -> MissionItem:
    return do(Command.DO_CHANGE_SPEED, kind, value, -1.0)


TAKEOFF = at(0, 0, 30, command=Command.NAV_TAKEOFF)
RTL = do(Command.NAV_RETURN_TO_LAUNCH)
LAND = at(0, 0, 0, command=Command.NAV_LAND)


def spline(east: float, north: float, up: float = 30.0, *params: float) -> MissionItem:
    return at(east, north, up, *params, command=Command.NAV_SPLINE_WAYPOINT)


def mission(*items: MissionItem, home: Home | None = HOME, **beside: Any) -> Mission:
    return Mission(items, home, **beside)


def flown(*items: MissionItem, **beside: Any) -> Mission:
    """Take-off, `items`, return."""
    return mission(TAKEOFF, *items, RTL, **beside)


def row(count: int, spacing: float, up: float = 30.0) -> list[MissionItem]:
    """`count` waypoints to the north, the first `spacing` from home."""
    return [at(0, spacing * (k + 1), up) for k in range(count)]


def polygon(*corners: tuple[float, float], inclusion: bool = True) -> Polygon:
    return Polygon(tuple(latlon(*corner) for corner in corners), inclusion)


def square(side: float, *, inclusion: bool = True, east: float = 0.0) -> Polygon:
    """A square about home, or about a place to the east of it."""
    h = side / 2
    corners = ((east - h, -h), (east + h, -h), (east + h, h), (east - h, h))
    return polygon(*corners, inclusion=inclusion)


def circle(east: float, north: float, radius: float, *, inclusion: bool = False) -> Circle:
    return Circle(latlon(east, north), radius, inclusion)


def fence(*parts: Polygon | Circle, breach_return: RallyPoint | None = None) -> Fence:
    return Fence(
        tuple(part for part in parts if isinstance(part, Polygon)),
        tuple(part for part in parts if isinstance(part, Circle)),
        breach_return,
    )


def rally(east: float, north: float, up: float = 50.0) -> RallyPoint:
    return RallyPoint(*latlon(east, north), up)


def track(
    points: Sequence[tuple[float, float, float]],
    items: Sequence[int],
    pace: float | Sequence[float],
    step: float = 0.1,
    frame: LocalFrame = FRAME,
) -> Track:
    """Straight lines through `points` at `pace` m/s each, towards the items at `items`."""
    paces = [pace] * len(items) if isinstance(pace, int | float) else list(pace)
    t, position, velocity, item = [0.0], [np.array(points[0], dtype=float)], [np.zeros(3)], []
    reached = np.full(max(items) + 1, np.nan)
    for start, end, index, v in zip(points, points[1:], items, paces, strict=False):
        a, b = np.array(start, dtype=float), np.array(end, dtype=float)
        samples = max(1, round(float(np.linalg.norm(b - a)) / v / step))
        for k in range(samples):
            t.append(t[-1] + step)
            position.append(a + (b - a) * (k + 1) / samples)
            velocity.append((b - a) / (samples * step))
            item.append(index)
        reached[index] = t[-1]
    velocity[0] = velocity[1]
    return Track(
        np.array(t),
        np.array(position),
        np.array(velocity),
        np.array([items[0], *item]),
        reached,
        frame,
    )


LINK = LinkCheck(
    planned_rate=2.0,
    predicted_rate=2.0,
    planned_delivered=2.0,
    predicted_delivered=2.0,
    planned_duration=120.0,
    predicted_duration=120.0,
    rms_position_error=1.0,
    max_position_error=2.0,
    path_error=1.0,
    path_tolerance=2.0,
)


@dataclass(frozen=True)
class Given:
    """What is judged."""

    mission: Mission
    vehicle: Vehicle = COPTER
    track: Track | None = None
    limits: Limits | None = None
    link: LinkCheck | None = None
    airborne: bool = False
    energy: EnergyUse | None = None

    def findings(self) -> tuple[Finding, ...]:
        return validate(
            self.mission,
            self.vehicle,
            track=self.track,
            limits=self.limits,
            link=self.link,
            airborne=self.airborne,
            energy=self.energy,
        )

    def by(self, rule: str) -> list[Finding]:
        return [finding for finding in self.findings() if finding.rule == rule]


def check(rule: str, trips: Given, item: int | None, passes: Given) -> None:
    """Assert that `rule` speaks about `trips` at `item` and says nothing about `passes`."""
    found = trips.by(rule)
    assert found, f"{rule} does not speak; {[finding.rule for finding in trips.findings()]} do"
    assert found[0].item == item
    assert all(finding.message for finding in found)
    assert all(finding.action or finding.level is Level.NOTE for finding in found)
    assert passes.by(rule) == []
