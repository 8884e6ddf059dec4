"""The relay route: waypoints, when the plan passes them, and what the mission commands there."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.autopilot import FlightPath
from faao_mav.plan import Vector
from faao_mav.vector import lengths

DIGITS = 3
"""Decimals of all values of a route, in m, m/s and s, as they are flown and sent.

Far above the noise of a processor's rounding (1e-9 and less), far below what a flight shows; with
speeds of two, 300 s of flight end 0.25 s off.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """The relay route as m >= 1 waypoints and the m - 1 legs between them.

    `positions` (m, 2) are local east-north metres. The plan reaches waypoint k at `arrivals[k]`
    and leaves it at `departures[k]`, s; the two differ at hovers. The mission commands a speed for
    each leg, `speeds` (m - 1,), m/s, and for each waypoint how long to wait there, `waits` (m,), s,
    and an acceptance radius, `radii` (m,), m, 0 for the autopilot's own.

    The plan's flight begins at waypoint `first`, w_I, and ends at waypoint `last`, w_F. A waypoint
    before `first` lets the aircraft reach w_I at speed, one after `last` lets it leave w_F at
    speed. The aircraft leaves w_I `lead` seconds before the plan does.
    """

    positions: Real
    arrivals: Real
    departures: Real
    speeds: Real
    waits: Real
    radii: Real
    first: int
    last: int
    lead: float = 0.0

    @property
    def leg_lengths(self) -> Real:
        """Length of each leg, (m - 1,), m."""
        return lengths(np.diff(self.positions, axis=0))

    @property
    def joined(self) -> Flags:
        """Which legs follow another without a stop, (m - 1,)."""
        joined: Flags = self.waits[:-1] == 0
        joined[0] = False
        return joined

    @property
    def distance(self) -> float:
        """Length of the route from w_I to w_F, m."""
        return float(self.leg_lengths[self.first : self.last].sum())

    @property
    def turns(self) -> Real:
        """Change of heading at each waypoint, (m,), rad, 0 to pi; 0 at both ends."""
        headings = np.arctan2(*np.diff(self.positions, axis=0).T[::-1])
        turns = np.abs((np.diff(headings) + np.pi) % (2 * np.pi) - np.pi)
        return np.concatenate([[0.0], turns, [0.0]])[: len(self.positions)]

    def rounded(self) -> "Route":
        """Return the route to 1 mm, 1 mm/s and 1 ms.

        What is chosen from predicted flights then does not hang on how a processor rounds.
        """
        values = {name: getattr(self, name) for name in ("positions", "speeds", "waits", "lead")}
        return replace(self, **{name: np.round(x, DIGITS) for name, x in values.items()})

    def holds_and_delays(self, *, whole_seconds: bool) -> tuple[Real, Real]:
        """Return `waits` as holds, which waypoints command, and delays of items after them.

        Both (m,), s. An autopilot that keeps only `whole_seconds` of a hold needs a delay for the
        fraction; for others the delays are 0.
        """
        holds = np.floor(self.waits) if whole_seconds else self.waits
        return holds, np.round(self.waits - holds, 9)

    def path(self, *, altitude: float = 0.0, wind: Vector = (0.0, 0.0)) -> FlightPath:
        """Return the legs as a flight model takes them, in a `wind`, m/s.

        All are at `altitude`, m above sea level.
        """
        return FlightPath(
            points=np.column_stack([self.positions, np.zeros(len(self.positions))]),
            speeds=self.speeds,
            holds=self.waits,
            splines=np.zeros(len(self.positions), dtype=bool),
            radii=self.radii,
            elevation=altitude,
            wind=wind,
        )

    def insert(self, at: Integers, positions: Real, times: Real, speeds: Real) -> "Route":
        """Return the route with plain waypoints before those that now have the indices `at` (k,).

        The plan passes the new waypoints, `positions` (k, 2), at `times` (k,), s, without a wait.
        `speeds` (k,), m/s, are those of the legs that begin there; behind the last waypoint, of the
        leg that ends there. `first` and `last` stay with their waypoints.
        """
        values: dict[str, Any] = {
            "positions": positions,
            "arrivals": times,
            "departures": times,
            "speeds": speeds,
            "waits": 0.0,
            "radii": 0.0,
        }
        arrays = {name: getattr(self, name) for name in values}
        longer = {
            name: np.insert(array, np.minimum(at, len(array)), values[name], axis=0)
            for name, array in arrays.items()
        }
        first = self.first + int(np.sum(at <= self.first))
        last = self.last + int(np.sum(at <= self.last))
        return replace(self, **longer, first=first, last=last)


def sent_speeds(speeds: Real, max_speed: float) -> Real:
    """Return `speeds` (k,), m/s, as they are sent: to a millimetre a second, within `max_speed`.

    >>> sent_speeds(np.array([4.00049, 7.9999]), 7.9999)
    array([4.   , 7.999])
    """
    scale = 10**DIGITS
    limit = np.floor(max_speed * scale + 1e-6) / scale or max_speed
    return np.minimum(np.round(speeds, DIGITS), limit)
