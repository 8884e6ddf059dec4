"""The limits of an aircraft with a least speed, with their curvature: they end a search quickly.

    (1 - ||v_n||^2) / 2 >= 0,  (1 - ||a_n||^2) / 2 >= 0,  (||v_n||^2 - least^2) / 2 >= 0

A flight that circles can turn as a whole: to first order no limit feels that, and to second order
those on ||a|| and on the least speed cancel. Half-planes (`min_speed`) leave the curvature of the
least speed out, keep every iterate inside the limits, and so creep where a flight should turn. With
the curvature, and slacks that follow the limits only to first order, the end is reached in some
tens of steps, from a flight that is near it.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.half_planes import HalfPlanes
from faao_mav.optimizer.kinematics import Kinematics

_INSIDE = 1e-5
"""By how much g is smaller: the margin that a search to a tolerance of 1e-4 may leave."""


@dataclass(frozen=True)
class Below(HalfPlanes):
    """g(x) = (1 - ||x||^2) / 2 for the speed or the acceleration x, in v_max or a_max."""

    quantity: Literal["v", "a"]  # type: ignore[misc]
    bend: ClassVar = -1.0
    inside: ClassVar = _INSIDE

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return g and its gradient -x."""
        return (1 - x[0] ** 2 - x[1] ** 2) / 2, -x


@dataclass(frozen=True)
class Above(HalfPlanes):
    """g(v) = (||v||^2 - `least`^2) / 2, in v_max."""

    least: float
    quantity: ClassVar = "v"
    bend: ClassVar = 1.0
    inside: ClassVar = _INSIDE

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return g and its gradient v."""
        return (x[0] ** 2 + x[1] ** 2 - self.least**2) / 2, x


def smooth_limits(kin: Kinematics) -> tuple[HalfPlanes, ...]:
    """Return the limits of `kin` on speed and acceleration, the least speed included."""
    return Below("v"), Below("a"), Above(kin.min_speed / kin.max_speed)
