"""How a mock autopilot takes up its mission in flight, as after setpoints.

ArduCopter 4.7 and PX4 1.16.1 accept the mode then: what has taken off already does not do so again.
"""

from dataclasses import replace

import numpy as np

from faao_mav.autopilot import Track, Vehicle
from faao_mav.fly.course import Course
from faao_mav.sim.flight import Posture

_STEP = 0.1
"""Seconds between two samples of the way there; chosen."""

_GENTLY = 1.0
"""The acceleration on the way there, m/s²; chosen."""


def taken_up(track: Track, posture: Posture, vehicle: Vehicle) -> Track:
    """Return the flight from `posture` straight to where `track` has done its first item, and on.

    The velocity of `posture` counts for nothing. Items done by then are reached at once.
    """
    first = float(np.nanmin(track.reached)) if np.isfinite(track.reached).any() else 0.0
    k = min(int(np.searchsorted(track.t, first)), len(track.t) - 1)
    legs = np.array([posture.position, track.position[k]])
    speed = vehicle.value("cruise_speed")
    way = Course.through(legs, speed=speed, acceleration=_GENTLY)
    t = np.arange(0.0, way.end, _STEP)
    points = [way.at(float(each)) for each in t]
    later = way.end - float(track.t[k])
    ahead = slice(k, None)
    places, speeds = (
        np.array(each).reshape(-1, 3)
        for each in ([point.position for point in points], [point.velocity for point in points])
    )
    return replace(
        track,
        t=np.concatenate([t, track.t[ahead] + later]),
        position=np.concatenate([places, track.position[ahead]]),
        velocity=np.concatenate([speeds, track.velocity[ahead]]),
        item=np.concatenate([np.full(len(t), track.item[k]), track.item[ahead]]),
        reached=np.maximum(track.reached + later, 0.0),
    )
