"""How short ArduCopter's legs may be."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.vehicle.ardupilot.copter.parameters import TABLE
from faao_mav.vehicle.ardupilot.copter.ramp import Limits, ramp_from_rest, rise_time
from faao_mav.vehicle.parameter import ParameterValues


@dataclass(frozen=True, slots=True)
class ArduCopterLegs:
    """How ArduCopter flies a leg between plain waypoints: m/s², m/s³, s.

    Every leg is planned as if it began and ended at rest, with the ramps of the flight model.
    """

    least: ClassVar[float] = 0.0
    run_in: ClassVar[float] = 1.2

    acceleration: float = TABLE["acceleration"].default
    jerk: float = TABLE["jerk"].default
    input_time: float = TABLE["input_time"].default

    @classmethod
    def of(cls, vehicle: ParameterValues) -> "ArduCopterLegs":
        """Return how `vehicle` flies legs."""
        return cls(*(vehicle.value(key) for key in ("acceleration", "jerk", "input_time")))

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg that reaches `speed`, m: two ramps; same shape.

        >>> float(ArduCopterLegs().shortest_leg(np.array(8.0)).round(1))
        48.0
        """
        return _each(lambda v: 2 * self._ramp_length(v), speed)

    def reachable_speed(self, length: Real) -> Real:
        """Return the speed that legs of `length`, m, reach, m/s; same shape."""
        limits = self._limits(math.inf)
        return _each(lambda way: ramp_from_rest(limits, way / 2).high if way > 0 else 0.0, length)

    def radii(self, room: Real, turn: Real) -> Real:  # noqa: ARG002
        """Return acceptance radii, m: 0, for ArduCopter stores none; the shape of `turn`."""
        return np.zeros_like(turn)

    def _ramp_length(self, speed: float) -> float:
        return ramp_from_rest(self._limits(speed), math.inf).length if speed > 0 else 0.0

    def _limits(self, speed: float) -> Limits:
        return Limits(speed, self.acceleration, self.jerk, rise_time(self.input_time))


def _each(law: Callable[[float], float], values: Real) -> Real:
    found: Real = np.array([law(value) for value in np.ravel(values).tolist()])
    return found.reshape(np.shape(values))
