"""The limits of an aircraft with a least speed, with their curvature.

    (1 - ||v_n||^2) / 2 >= 0,  (1 - ||a_n||^2) / 2 >= 0,  (||v_n||^2 - least^2) / 2 >= 0

In a wind u the least speed is of v_n - u, and so is one more greatest speed, that through the air.
A flight that circles can turn as a whole: to first order no limit feels that, and to second order
those on ||a|| and on the least speed cancel. A method that leaves the curvature of the least speed
out, or keeps every iterate inside the limits, creeps where a flight should turn. Here the curvature
counts, and slacks follow the limits only to first order.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.half_planes import HalfPlanes
from faao_mav.optimizer.kinematics import Kinematics
from faao_mav.plan import Vector

INSIDE = 1e-5
"""By how much g is smaller: the margin that a search to a tolerance of 1e-4 may leave."""


@dataclass(frozen=True)
class Below(HalfPlanes):
    """g(x) = (`most`^2 - ||x - wind||^2) / 2: a speed x in v_max, or an acceleration in a_max."""

    quantity: Literal["v", "a"]  # type: ignore[misc]
    most: float = 1.0
    wind: Vector = (0.0, 0.0)
    bend: ClassVar = -1.0
    inside: ClassVar = INSIDE

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return g and its gradient wind - x."""
        x = x - np.reshape(self.wind, (2, 1, 1))
        return (self.most**2 - x[0] ** 2 - x[1] ** 2) / 2, -x


@dataclass(frozen=True)
class Above(HalfPlanes):
    """g(v) = (||v - wind||^2 - `least`^2) / 2, in v_max."""

    least: float
    wind: Vector = (0.0, 0.0)
    quantity: ClassVar = "v"
    bend: ClassVar = 1.0
    inside: ClassVar = INSIDE

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return g and its gradient v - wind."""
        x = x - np.reshape(self.wind, (2, 1, 1))
        return (x[0] ** 2 + x[1] ** 2 - self.least**2) / 2, x


def limits_with_least_speed(kin: Kinematics) -> tuple[HalfPlanes, ...]:
    """Return the limits of `kin` on speed and acceleration, the least speed included."""
    east, north = (part / kin.max_speed for part in kin.wind)
    limits = Below("v"), Below("a"), Above(kin.min_speed / kin.max_speed, (east, north))
    if math.isinf(kin.max_airspeed):
        return limits
    return *limits, Below("v", kin.max_airspeed / kin.max_speed, (east, north))
