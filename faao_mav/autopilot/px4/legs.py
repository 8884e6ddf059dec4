"""What legs and waypoints suit a PX4 multicopter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.px4.guidance import stopping_distance, stopping_speed
from faao_mav.autopilot.px4.parameters import Px4Limits

_RADIUS = 4.0
"""The least acceptance radius that is asked for on long legs, m. Measured: about 130 flights."""

_LEAST_RADIUS = 1.0
"""The least acceptance radius that is asked for, m. Measured: where it flies, PX4's aircraft is off
by up to 0.5 m for seconds; 0.1 m held it for two minutes, 0.3 m for 6 s."""

_STRAIGHT = np.radians(3.0)
"""The turn at a waypoint, rad, below which a radius wider than the next one costs nothing. Chosen:
at 10 m from the waypoint it is 0.5 m."""

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


_LEAST_LEG = 5.0
"""The least length of a leg, m: two acceptance radii with which an aircraft half a metre off is in
time. Chosen; what a change costs is not measured."""

_SLOWEST = 1.5
"""The least speed that is commanded, m/s. Measured: an aircraft that is half a metre off comes half
a metre sooner or later to its waypoint, a second at 0.5 m/s."""


@dataclass(frozen=True, slots=True)
class Px4Legs(Px4Limits):
    """How PX4 flies a leg between plain waypoints: a in m/s², j in m/s³."""

    least: ClassVar[float] = _LEAST_LEG
    slowest: ClassVar[float] = _SLOWEST
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
        speeds = [stopping_speed(self.jerk, self.acceleration, way) for way in length.flat]
        return np.reshape(np.array(speeds), np.shape(length))

    def radii(self, room: Real, turn: Real, stops: Flags) -> Real:
        """Return acceptance radii, m, for waypoints whose shorter leg is `room` (n,), m.

        A wider one costs less speed in a corner, of sqrt(a r tan(alpha / 2)) at the inner angle
        alpha, but cuts it: by r tan(turn / 4) about, `turn` (n,) in radians. Where it turns none is
        wider than the next: PX4 would first fly back to the waypoint. `stops` (n,)
        marks waypoints at which it waits: those are left from within.
        """
        most_cut = _CUT if self.jerk < _HIGH_JERK else _CUT_WITH_HIGH_JERK
        cut = most_cut / np.maximum(np.tan(turn / 4), 1e-9)
        wide = np.where(stops, _RADIUS, np.maximum(_RADIUS, cut))
        radii = np.maximum(np.minimum(wide, _RADIUS_SHARE * room), _LEAST_RADIUS)
        for k in reversed(np.flatnonzero((turn > _STRAIGHT) & ~stops)):
            radii[k] = min(radii[k], radii[k + 1])
        return radii
