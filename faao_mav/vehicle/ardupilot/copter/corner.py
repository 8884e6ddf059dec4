"""Corners: how early the next leg begins where the aircraft does not stop."""

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import TypeAlias

from faao_mav.vehicle.ardupilot.copter.leg import StraightLeg

Direction: TypeAlias = tuple[float, float, float]
"""A unit vector: east, north, up."""

_TICKS = 1 << 40
"""In the longest overlap: how finely it is sought."""


@dataclass(frozen=True, slots=True)
class CornerLimits:
    """What must hold half-way round: metres from the waypoint, m/s² across the ground and up."""

    radius: float
    acceleration: float
    vertical: float


def half_overlap(
    leg: StraightLeg, u: Direction, following: StraightLeg, w: Direction, limits: CornerLimits
) -> float:
    """Return h, s: the `following` leg begins 2 h before `leg` ends, along `u` and `w`.

    The target moves by the sum of both. h is the largest, up to half of either leg's ramp, at
    which after h s of the overlap it is within the limits and slower than both legs' limits.
    """
    longest = min(leg.down.duration, following.up.duration) / 2
    end, length = leg.duration, leg.length
    slowest = min(leg.limits.speed, following.limits.speed)
    across = u[0] * w[0] + u[1] * w[1]
    along = across + u[2] * w[2]
    u_ground, w_ground = u[0] ** 2 + u[1] ** 2, w[0] ** 2 + w[1] ** 2

    def excess(h: float) -> float:
        s, v, a = leg.at(end - h)
        t, x, b = following.at(h)
        left = length - s
        position = math.sqrt(max(0.0, left * left + t * t - 2 * left * t * along))
        velocity = math.sqrt(max(0.0, v * v + x * x + 2 * v * x * along))
        ground = math.sqrt(max(0.0, a * a * u_ground + b * b * w_ground + 2 * a * b * across))
        return (
            max(
                position / limits.radius,
                velocity / slowest,
                ground / limits.acceleration,
                abs(a * u[2] + b * w[2]) / limits.vertical,
            )
            - 1
        )

    if excess(longest) <= 1e-9:
        return longest
    tick = longest / _TICKS
    return tick * bisect_left(range(_TICKS), 0.0, key=lambda ticks: excess(ticks * tick))
