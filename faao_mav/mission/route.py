"""The relay route, before it becomes mission items."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.mission.vector import lengths


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """Waypoints with their planned times, and what is commanded for them.

    `positions` (m, 2) are local east-north metres, m >= 1. `arrivals` and `departures` (m,), s,
    say when the plan reaches and leaves each waypoint; they differ at hovers. `speeds` (m - 1,),
    m/s, are commanded, one for each leg; `holds` (m,), whole seconds, how long the aircraft waits
    at each waypoint, and `delays` (m,), s, how much longer, less than one; `radii` (m,), m, the
    acceptance radii, 0 for the autopilot's own; `splines` (m,) tells which are spline waypoints.

    The aircraft sets out `lead` seconds before the plan does.

    The relay route goes from waypoint `first`, w_I, to waypoint `last`, w_F: one before it is
    flown to be at speed there, one after it to be still at speed there.
    """

    positions: Real
    arrivals: Real
    departures: Real
    speeds: Real
    holds: Real
    delays: Real
    radii: Real
    splines: Flags
    first: int
    last: int
    lead: float = 0.0

    @property
    def leg_lengths(self) -> Real:
        """Length of each leg, (m - 1,), m."""
        return lengths(np.diff(self.positions, axis=0))

    @property
    def distance(self) -> float:
        """Length of the relay route, m: without the way to w_I and from w_F."""
        return float(self.leg_lengths[self.first : self.last].sum())
