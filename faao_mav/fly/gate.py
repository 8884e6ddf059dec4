"""The gate of all setpoints: where an aircraft can be, and where it may be sent to from there."""

import math
from collections.abc import Callable

import numpy as np

from faao_mav.arrays import Real
from faao_mav.fly.course import Setpoint
from faao_mav.plan import Plan

NEAR, LEVEL = 2.0, 1.0
"""Metres across and up within which an aircraft is on course; chosen: a stream that nothing
disturbs keeps its plan to 0.5 m rms in the simulators."""

CLIMB = 2.0, 1.0
"""The speed, m/s, and acceleration, m/s², of a climb by setpoints; chosen: below all defaults."""

_AROUND, _QUICKER, _BORNE = 2.0, 2.0, 3.0
"""A place may be so many metres farther from the last one than the aircraft flies meanwhile at so
many times the plan's top speed: a failsafe may fly faster than the plan, a wind carry it. Places
are doubted for so many seconds until they are given up. Chosen."""

_MOVES, _STANDS = 0.5, 1.0
"""An aircraft that tells at least so many m/s cannot be at the same place for so many seconds, to
the last digit. Chosen."""


class Gate:
    """The gate of the setpoints for a flight of `plan`: see `believes` and `passes`.

    Times are the vehicle's. `tell` is told when a place is doubted, and believed again.
    """

    def __init__(self, plan: Plan, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._fence, self._speed = plan.keep_in, plan.max_ground_speed
        self._acceleration = plan.vehicle.max_acceleration
        self._on_course: float | None = None
        self._last: tuple[float, Real] | None = None
        self._jumped_from: tuple[float, Real] | None = None
        self._moved = 0.0
        self._doubted_since = math.inf

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
        far = NEAR + _lag(since, self._speed, self._acceleration)
        if across > far or up > LEVEL + _lag(since, *CLIMB):
            return False
        straight = np.array([place[:2], setpoint.position[:2]])
        return across <= NEAR or self._fence is None or self._fence.covers_path(straight)

    def believes(self, t: float, place: Real, velocity: Real) -> bool:
        """Tell whether it can be at `place` (3,), m, with `velocity` (3,), m/s, at `t`, s.

        After a jump it is doubted until it jumps back; so is one that moves and stays where it is.
        """
        last = self._last
        if last is None or np.linalg.norm(velocity) < _MOVES or (place != last[1]).any():
            self._moved = t
        if self._jumps(last, t, place):
            if self._jumped_from is None:
                self._jumped_from = last
            elif not self._jumps(self._jumped_from, t, place):
                self._jumped_from = None
        self._last = t, place
        stands = t - self._moved >= _STANDS
        doubted = stands or self._jumped_from is not None
        if doubted and self._doubted_since == math.inf:
            self._doubted_since = t
            why = "does not change, though it moves" if stands else "has jumped"
            self._tell(f"its place {why}: no setpoints are sent")
        elif not doubted and self._doubted_since < math.inf:
            self._doubted_since = math.inf
            self._tell("its place is believed again")
        return not doubted

    def has_lost_it(self, t: float) -> bool:
        """Tell whether its places have been doubted for too long by `t`, s."""
        return t >= self._doubted_since + _BORNE

    def _jumps(self, before: tuple[float, Real] | None, t: float, place: Real) -> bool:
        if before is None:
            return False
        within = _AROUND + _QUICKER * self._speed * (t - before[0])
        return float(np.linalg.norm(place - before[1])) > within


def _lag(seconds: float, speed: float, acceleration: float) -> float:
    """Return the greatest lag, m, of an aircraft that was on course so many seconds ago.

    One that stays where it is falls behind by at most the speed; one that follows from rest, by
    the way that it takes to be as fast.

    >>> _lag(0.5, 8.0, 2.0), _lag(60.0, 8.0, 2.0)
    (4.0, 16.0)
    """
    return min(speed * max(seconds, 0.0), speed**2 / (2 * acceleration))
