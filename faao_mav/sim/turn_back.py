"""What becomes of a mock autopilot's flight that leaves the fence.

Measured in simulation, at 8 m/s: ArduCopter 4.7 (FENCE_ENABLE 1, FENCE_ACTION 1) changed to RTL
1 m outside, got 15 m outside, went home and landed; PX4 1.16.1 (GF_ACTION 2) changed to hold 4 m
outside and stayed 2 m outside. This one acts as soon as it is outside, and brakes as gently as it
speeds up.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.manners import FenceAction
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import FreeArea, areas_of
from faao_mav.mission.item import Home
from faao_mav.power import GRAVITY


@dataclass(frozen=True, slots=True)
class Breach:
    """The flight leaves the fence at `time`, s on the clock of its track, and does `action`."""

    time: float
    action: FenceAction


def home_outside(fence: Fence, home: Home, vehicle: Vehicle) -> bool:
    """Tell whether `home` lies outside a `fence` that `vehicle` does something about."""
    if not fence or vehicle.type.at_fence(vehicle).action == "nothing":
        return False
    frame = LocalFrame(home.latitude, home.longitude)
    return not _covered(fence, frame, vehicle, np.zeros((1, 2))).all()


def kept_inside(track: Track, fence: Fence, vehicle: Vehicle) -> tuple[Track, Breach | None]:
    """Return the flight that `vehicle` makes of `track` because of `fence`, and where it leaves it.

    A flight that starts outside leaves the fence once it has been inside.
    """
    action = vehicle.type.at_fence(vehicle).action
    if not fence or action == "nothing" or not len(track.t):
        return track, None
    out = ~_covered(fence, track.frame, vehicle, track.position[:, :2])
    left = np.flatnonzero(out & np.logical_or.accumulate(~out))
    if not len(left):
        return track, None
    last = int(left[0])
    breach = Breach(float(track.t[last]), action)
    return track if action == "report" else _instead(track, last, breach, vehicle), breach


def _instead(track: Track, last: int, breach: Breach, vehicle: Vehicle) -> Track:
    """Return `track` up to the sample `last`, and then what `vehicle` does at its fence."""
    points, lasting = [track.position[last]], [0.0]

    def go(to: Real, seconds: float) -> None:
        points.append(to)
        lasting.append(max(seconds, 1e-3))

    vertical, velocity = vehicle.vertical, track.velocity[last]
    speed = math.hypot(*velocity[:2])
    if vehicle.type.hovers and breach.action != "terminate":
        braking = vehicle.value("acceleration")
        go(points[-1] + [*(velocity[:2] * speed / (2 * braking)), 0.0], speed / braking)
    if breach.action == "return":
        east, north, height = points[-1]
        level = vertical.returns_at(height)
        go(np.array([east, north, level]), vertical.climb(abs(level - height)))
        go(np.array([0.0, 0.0, level]), math.hypot(east, north) / vehicle.value("cruise_speed"))
    down = points[-1] * [1.0, 1.0, 0.0]
    if breach.action == "land" or (breach.action == "return" and vertical.lands_on_return):
        go(down, vertical.descend(points[-1][2]))
    elif breach.action == "terminate":
        go(down, math.sqrt(2 * max(points[-1][2], 0.0) / GRAVITY))
    t = track.t[last] + np.cumsum(lasting[1:])
    after = np.diff(points, axis=0) / np.array(lasting[1:])[:, None]
    reached = np.where(track.reached <= breach.time, track.reached, np.nan)
    return replace(
        track,
        t=np.concatenate([track.t[: last + 1], t]),
        position=np.concatenate([track.position[: last + 1], points[1:]]),
        velocity=np.concatenate([track.velocity[:last], after, np.zeros((1, 3))]),
        item=np.append(track.item[: last + 1], np.full(len(t), track.item[last])),
        reached=reached,
    )


def _covered(fence: Fence, frame: LocalFrame, vehicle: Vehicle, places: Real) -> Flags:
    """Return at which `places` (n, 2), m in `frame`, `vehicle` is inside `fence`, (n,)."""
    any_inclusion = vehicle.type.fence_needs_one_inclusion(vehicle)
    return FreeArea.of(areas_of(fence, frame), any_inclusion=any_inclusion).covers(places)
