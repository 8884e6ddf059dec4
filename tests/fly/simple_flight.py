"""A simple flight for mock autopilots: straight lines at constant speed."""

import math
from itertools import pairwise

import numpy as np

from faao_mav.autopilot import Track, Vehicle
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Mission

SPEED = 10.0
LANDING = (20, 21)


def fly(mission: Mission, _: Vehicle | None = None) -> Track:
    """Return a flight from home over all places, in one second steps; landing where it started."""
    assert mission.home is not None
    frame = LocalFrame(mission.home.latitude, mission.home.longitude)
    points, items = [np.zeros(3)], [0]
    for index, item in enumerate(mission.items):
        if item.command in LANDING:
            points += [points[0] + [0, 0, points[-1][2]], points[0]]
            items += [index, index]
        elif item.frame == 3 or item.frame == 6:
            points.append(np.append(frame.to_local(item.x, item.y), item.z))
            items.append(index)
    legs = [np.linalg.norm(b - a) / SPEED for a, b in pairwise(points)]
    times = np.concatenate([[0.0], np.cumsum(legs)])
    t = np.linspace(0.0, times[-1], int(times[-1] * 10) + 2)
    position = np.column_stack([np.interp(t, times, np.array(points)[:, k]) for k in range(3)])
    velocity = np.gradient(position, t, axis=0)
    following = np.searchsorted(times[1:], t, side="left").clip(max=len(legs) - 1)
    reached = np.full(len(mission.items), math.nan)
    for index, time in zip(items[1:], times[1:], strict=True):
        reached[index] = time
    return Track(t, position, velocity, np.array(items[1:])[following], reached, frame)
