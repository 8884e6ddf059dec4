"""Whether an aircraft can be where it tells: what it tells may jump, or stand still."""

import numpy as np

from faao_mav.arrays import Real

_AROUND, _QUICKER = 2.0, 2.0
"""A place may be so many metres farther from the last one than the aircraft flies meanwhile at so
many times the plan's top speed. Chosen: a failsafe may fly faster than the plan, a wind carry it.
"""

_MOVES, _STANDS = 0.5, 1.0
"""An aircraft that tells at least so many m/s cannot be at the same place for so many seconds, to
the last digit. Chosen."""

_BORNE = 3.0
"""Seconds for which places are doubted until they are given up; chosen."""


class Belief:
    """Tells of one place after the other whether an aircraft of at most `speed`, m/s, can be there.

    After a jump it is doubted until it jumps back; so is one that moves and stays where it is.
    `told` is what changes, in words. Times are the vehicle's.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._last: tuple[float, Real] | None = None
        self._jumped_from: tuple[float, Real] | None = None
        self._moved = 0.0
        self._doubted_since: float | None = None
        self.told: list[str] = []

    def holds(self, t: float, place: Real, velocity: Real) -> bool:
        """Tell whether it can be at `place` (3,), m, with `velocity` (3,), m/s, at `t`, s."""
        last = self._last
        if last is None or np.linalg.norm(velocity) < _MOVES or (place != last[1]).any():
            self._moved = t
        if last is not None and self._jumps(last, t, place):
            if self._jumped_from is None:
                self._jumped_from = last
            elif not self._jumps(self._jumped_from, t, place):
                self._jumped_from = None
        self._last = t, place
        why = None
        if self._jumped_from is not None:
            why = "its place has jumped"
        elif t - self._moved >= _STANDS:
            why = "its place does not change, though it moves"
        self._note(why, t)
        return why is None

    def is_lost(self, t: float) -> bool:
        """Tell whether it has been doubted for too long by `t`, s."""
        return self._doubted_since is not None and t >= self._doubted_since + _BORNE

    def _note(self, why: str | None, t: float) -> None:
        if why is not None and self._doubted_since is None:
            self._doubted_since = t
            self.told.append(f"{why}: no setpoints are sent")
        elif why is None and self._doubted_since is not None:
            self._doubted_since = None
            self.told.append("its place is believed again")

    def _jumps(self, before: tuple[float, Real], t: float, place: Real) -> bool:
        within = _AROUND + _QUICKER * self._speed * (t - before[0])
        return float(np.linalg.norm(place - before[1])) > within
