"""The least speed ||v_n|| >= v_min of vehicles that cannot hover, which is not convex."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.half_planes import HalfPlanes
from faao_mav.plan import Vector

_SMALLEST = 1e-9
"""The least speed, in v_max, whose direction is divided by; far below any that is flown."""


@dataclass(frozen=True)
class MinSpeedConstraint(HalfPlanes):
    """g(v) = ||v - wind|| - `least`, in v_max: half-planes along the airspeed v - `wind`."""

    least: float
    wind: Vector = (0.0, 0.0)
    quantity: ClassVar = "v"

    @property
    def inside(self) -> float:
        """A share of 1e-6 of the least speed."""
        return 1e-6 * self.least

    @property
    def headroom(self) -> float:
        """A tenth of the least speed. Chosen; what a change costs is not measured."""
        return 0.1 * self.least * (1 + 1e-6)

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return ||v - wind|| - least and its gradient."""
        x = x - np.reshape(self.wind, (2, 1, 1))
        speed = np.hypot(*x)
        return speed - self.least, x / np.maximum(speed, _SMALLEST)
