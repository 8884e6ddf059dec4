"""The relay route: what is flown between w_I and w_F, before it becomes mission items."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.vector import lengths


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """Waypoints from w_I to w_F with their planned times, and what is commanded for them.

    `positions` (m, 2) are local east-north metres, m >= 1. `arrivals` and `departures` (m,), s,
    say when the plan reaches and leaves each waypoint; they differ at hovers. `speeds` (m - 1,),
    m/s, are commanded, one for each leg; `holds` (m,), whole seconds, how long the aircraft waits
    at each waypoint.
    """

    positions: Real
    arrivals: Real
    departures: Real
    speeds: Real
    holds: Real

    @property
    def leg_lengths(self) -> Real:
        """Length of each leg, (m - 1,), m."""
        return lengths(np.diff(self.positions, axis=0))

    @property
    def distance(self) -> float:
        """Length of the route, m: without the way to w_I and from w_F."""
        return float(self.leg_lengths.sum())

    @property
    def duration(self) -> float:
        """Nominal duration of the route, s: legs at the commanded speeds, plus the holds.

        How the aircraft speeds up and slows down is not in it.
        """
        return float((self.leg_lengths / self.speeds).sum() + self.holds.sum())
