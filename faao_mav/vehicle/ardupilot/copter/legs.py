"""How short ArduCopter's legs may be."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.vehicle.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.vehicle.ardupilot.copter.ramp import LegBounds, ramp_from_rest


@dataclass(frozen=True, slots=True)
class ArduCopterLegs(ArduCopterLimits):
    """How ArduCopter flies a leg between plain waypoints.

    Every leg is planned as if it began and ended at rest, with the ramps of the flight model.
    """

    least: ClassVar[float] = 0.0
    run_in: ClassVar[float] = 1.2

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg that reaches `speed`, m: two ramps; same shape.

        >>> float(ArduCopterLegs().shortest_leg(np.array(8.0)).round(1))
        48.0
        """
        return _each(lambda v: 2 * self._ramp_length(v), speed)

    def reachable_speed(self, length: Real) -> Real:
        """Return the speed that legs of `length`, m, reach, m/s; same shape."""
        bounds = self._bounds(math.inf)
        return _each(lambda way: ramp_from_rest(bounds, way / 2).high if way > 0 else 0.0, length)

    def radii(self, room: Real, turn: Real) -> Real:  # noqa: ARG002
        """Return acceptance radii, m: 0, for ArduCopter stores none; the shape of `turn`."""
        return np.zeros_like(turn)

    def _ramp_length(self, speed: float) -> float:
        return ramp_from_rest(self._bounds(speed), math.inf).length if speed > 0 else 0.0

    def _bounds(self, speed: float) -> LegBounds:
        return LegBounds(speed, self.acceleration, self.jerk, self.rise)


def _each(law: Callable[[float], float], values: Real) -> Real:
    found: Real = np.array([law(value) for value in np.ravel(values).tolist()])
    return found.reshape(np.shape(values))
