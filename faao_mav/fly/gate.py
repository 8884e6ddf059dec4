"""The gate of all setpoints: where an aircraft is may be sent to, by what it can have missed."""

import math
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.fly.course import Setpoint
from faao_mav.plan import Plan

NEAR, LEVEL = 2.0, 1.0
"""Metres across and up within which an aircraft is on course; chosen: a stream that nothing
disturbs keeps its plan to 0.5 m rms in the simulators."""

CLIMB, CLIMB_ACCELERATION = 2.0, 1.0
"""The speed, m/s, and acceleration, m/s², of a climb by setpoints; chosen: below all defaults."""


@dataclass(frozen=True, slots=True)
class Lag:
    """How far behind a flight of at most `speed`, m/s, and `acceleration`, m/s², one may be.

    >>> lag = Lag(speed=8.0, acceleration=2.0)
    >>> lag.after(0.5), lag.after(60.0)
    (4.0, 16.0)
    """

    speed: float
    acceleration: float

    def after(self, seconds: float) -> float:
        """Return the greatest lag, m, of an aircraft that was on course so many seconds ago.

        One that stays where it is falls behind by at most the speed; one that follows from rest, by
        the way that it takes to be as fast.
        """
        return min(self.speed * max(seconds, 0.0), self.speed**2 / (2 * self.acceleration))


class Gate:
    """The gate of the setpoints for a flight of `plan`: see `passes`; times are the vehicle's."""

    def __init__(self, plan: Plan) -> None:
        self._fence = plan.keep_in
        self._across = Lag(plan.max_ground_speed, plan.vehicle.max_acceleration)
        self._up = Lag(CLIMB, CLIMB_ACCELERATION)
        self._on_course: float | None = None

    def passes(self, t: float, place: Real, setpoint: Setpoint) -> bool:
        """Tell whether an aircraft at `place` (3,), m, at `t`, s, may be sent to `setpoint`.

        It may be within `NEAR` and `LEVEL` of it, or off by as much more as it can have fallen
        behind since it last was; the straight way there has to keep inside the fence.
        """
        off = setpoint.position - place
        across, up = math.hypot(off[0], off[1]), abs(float(off[2]))
        if self._on_course is None or (across <= NEAR and up <= LEVEL):
            self._on_course = t
        since = t - self._on_course
        if across > NEAR + self._across.after(since) or up > LEVEL + self._up.after(since):
            return False
        straight = np.array([place[:2], setpoint.position[:2]])
        return across <= NEAR or self._fence is None or self._fence.covers_path(straight)
