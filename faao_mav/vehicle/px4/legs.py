"""What legs and waypoints suit a PX4 multicopter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.vehicle.px4.guidance import stopping_distance, stopping_speed
from faao_mav.vehicle.px4.parameters import Px4Limits

_RADIUS = 4.0
"""The least acceptance radius that is asked for on long legs, m. Measured: about 130 flights."""

_RADIUS_SHARE = 0.45
"""The greatest acceptance radius as a share of the shorter leg at the waypoint. Chosen below 0.5,
so that the circles of two waypoints do not meet; a radius as long as its leg counts at once."""

_CUT, _CUT_WITH_HIGH_JERK = 1.3, 1.0
"""How much of a corner a wide acceptance radius may cut, m: the second from `_HIGH_JERK` on, where
an aircraft is soon at speed again and loses less in a corner. Chosen; what a change costs is not
measured."""

_HIGH_JERK = 10.0
"""The jerk from which corners cost little time, m/s³: between the default of 4 and the recommended
20. Chosen; what a change costs is not measured."""


@dataclass(frozen=True, slots=True)
class Px4Legs(Px4Limits):
    """How PX4 flies a leg between plain waypoints: a in m/s², j in m/s³."""

    least: ClassVar[float] = 3.0  # NAV_ACC_RAD is 2 m
    run_in: ClassVar[float] = 1.2

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg flown at `speed`, m; same shape.

        It must be able to stop at the next waypoint: that is its stopping distance.

        >>> float(Px4Legs(acceleration=5.0, jerk=10.0).shortest_leg(np.array(8.0)))
        14.4
        """
        return stopping_distance(self.jerk, self.acceleration, speed)

    def reachable_speed(self, length: Real) -> Real:
        """Return the speed from which it can stop within legs of `length`, m, in m/s."""
        speeds = [stopping_speed(self.jerk, self.acceleration, way, 0.0) for way in length.flat]
        return np.reshape(np.array(speeds), np.shape(length))

    def radii(self, room: Real, turn: Real) -> Real:
        """Return acceptance radii, m, for waypoints whose shorter leg is `room` (n,), m.

        A wider one costs less speed in a corner, of sqrt(a r tan(alpha / 2)) at the inner angle
        alpha, but cuts it: by r tan(turn / 4) about, `turn` (n,) in radians.
        """
        most_cut = _CUT if self.jerk < _HIGH_JERK else _CUT_WITH_HIGH_JERK
        cut = most_cut / np.maximum(np.tan(turn / 4), 1e-9)
        return np.minimum(np.maximum(_RADIUS, cut), _RADIUS_SHARE * room)
