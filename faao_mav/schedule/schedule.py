"""A route with its predicted flight, and how far that is from the plan."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.schedule.deviation import Deviation, deviation
from faao_mav.schedule.route import Route
from faao_mav.schedule.timing import ON_TIME, Clock
from faao_mav.vector import lengths
from faao_mav.vehicle import FlightPath, Flown

_EVERY = 0.4
"""Seconds between samples of the predicted flight that still show its path."""

_ASTRAY, _SURELY = 8.0, 0.95
"""Metres of error that one metre beyond so much of the path tolerance weighs."""


@dataclass(frozen=True, slots=True, eq=False)
class Schedule:
    """A route with its predicted flight: `clock` ties the flight's time to the plan's."""

    route: Route
    path: FlightPath
    flown: Flown
    clock: Clock

    def positions(self, t: Real) -> Real:
        """Return where the aircraft is predicted to be at the plan's times `t` (k,), (k, 2)."""
        return self.clock.positions(self.flown, t)

    def track(self) -> dict[str, Real]:
        """Return the predicted relay flight on the plan's clock, as `--save` keeps it.

        `predicted_t` (k,), s; `predicted_w` and `predicted_v` (k, 2), east and north, m and m/s.
        """
        return {
            "predicted_t": self.flown.t - self.clock.start(self.flown),
            "predicted_w": self.flown.position[:, :2],
            "predicted_v": self.flown.velocity[:, :2],
        }

    @property
    def rms(self) -> float:
        """How far that is from the plan, m rms."""
        return float(np.sqrt(np.mean(lengths(self.positions(self.clock.t) - self.clock.w) ** 2)))

    @property
    def error(self) -> float:
        """That with what being late or early at the end weighs, m."""
        return float(np.hypot(self.rms, ON_TIME * self.clock.late(self.flown)))

    @property
    def cost(self) -> float:
        """That with what straying from the path too far weighs, m."""
        return self.error + _ASTRAY * max(0.0, self.deviation.path - _SURELY * self.clock.near)

    @property
    def deviation(self) -> Deviation:
        """How far that is from the plan."""
        t, w = self.clock.t, self.clock.w
        start = self.clock.start(self.flown)
        # a path flown late is the same path
        over = start + t[-1] + max(0.0, self.clock.late(self.flown))
        flown = np.arange(start, over, _EVERY)
        path = np.stack(
            [np.interp([*flown, over], self.flown.t, x) for x in self.flown.position.T[:2]], axis=-1
        )
        return deviation(w, self.positions(t), path)
