"""The relay route, before it becomes mission items."""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.vector import lengths


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

    @property
    def turns(self) -> Real:
        """By how much the way turns at each waypoint, (m,), rad; 0 at both ends."""
        headings = np.arctan2(*np.diff(self.positions, axis=0).T[::-1])
        turns = np.abs((np.diff(headings) + np.pi) % (2 * np.pi) - np.pi)
        return np.concatenate([[0.0], turns, [0.0]])[: len(self.positions)]

    def with_waypoints(self, at: Integers, positions: Real, times: Real, speeds: Real) -> "Route":
        """Return the route with plain waypoints before those that are at indices `at` (k,) now.

        `positions` (k, 2) are passed at `times` (k,); `speeds` (k,) are those of the new legs that
        end there, or, behind the last waypoint, begin there. `first` and `last` stay.
        """
        still = np.zeros(len(at))
        return replace(
            self,
            positions=np.insert(self.positions, at, positions, axis=0),
            arrivals=np.insert(self.arrivals, at, times),
            departures=np.insert(self.departures, at, times),
            speeds=np.insert(self.speeds, np.minimum(at, len(self.speeds)), speeds),
            holds=np.insert(self.holds, at, still),
            delays=np.insert(self.delays, at, still),
            radii=np.insert(self.radii, at, still),
            splines=np.insert(self.splines, at, False),
        )
