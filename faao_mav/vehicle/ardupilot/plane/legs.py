"""How short ArduPlane's legs may be."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.vehicle.parameter import ParameterValues


@dataclass(frozen=True, slots=True)
class ArduPlaneLegs:
    """How ArduPlane flies a leg: `look_ahead`, s, is how far ahead its guidance aims."""

    least: ClassVar[float] = 0.0
    run_in: ClassVar[float] = 4.0  # chosen: room to come onto a track, whatever its course

    look_ahead: float

    @classmethod
    def of(cls, vehicle: ParameterValues) -> "ArduPlaneLegs":
        """Return how `vehicle` flies legs: it aims ζ T / π seconds ahead."""
        return cls(vehicle.value("damping") * vehicle.value("period") / math.pi)

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg flown at `speed`, m: one look-ahead; same shape."""
        return self.look_ahead * speed

    def reachable_speed(self, length: Real) -> Real:
        """Return the speed at which legs of `length`, m, are not cut short, m/s; same shape."""
        return length / self.look_ahead

    def radii(self, room: Real, turn: Real) -> Real:  # noqa: ARG002
        """Return acceptance radii, m: 0, ArduPlane's own; the shape of `turn`."""
        return np.zeros_like(turn)
