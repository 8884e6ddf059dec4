"""How long straight legs take at any speeds, told without a flight."""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.copter.ramp import LegBounds, ramp_between, ramp_from_rest

_FASTEST, _STEP = 31.0, 0.25
"""The end and the step of the table of ramps, m/s. Chosen: their lengths are told to 1 cm."""

_FITTINGS = 3
"""How often it is reckoned anew what second ramp fits. Chosen."""


@dataclass(frozen=True, eq=False)
class StraightDurations:
    """Legs of `lengths` (m - 1,), m; `joined` (m - 1,) marks those that follow one without a stop.

    A leg of l metres is planned at the speed that is in force when it begins: that of the leg
    before, where they are joined. Its own comes into force half-way through their overlap. A lower
    one shortens what is left of the ramp, which ends at p then; from p a second ramp leads to the
    speed e, if the cruise has room for one. Ramps from rest to v last D(v), others, by d, C(d). The
    leg takes

        T = l/e + D(p) (1 - p/2e) + C(|e - p|) (e - p)/2e + D(e)/2 - h - h'

    from passing one end to passing the other, h and h' being half of its overlaps, 0 at a stop. An
    overlap is as long as the shorter of its ramps; that it is shorter in a sharp corner is left
    out. Of random straight routes half are told to 0.01 s; nine tenths to 0.1 s with a jerk of 10
    and 20 m/s³, to 0.9 s with 1 m/s³.

    >>> joined, bounds = np.array([False, True, True]), LegBounds(math.inf, 3.0, 5.0, 0.2)
    >>> legs = StraightDurations(np.array([50.0, 12.0, 50.0]), joined, bounds)
    >>> flown, durations = legs.flown(np.array([4.0, 8.0, 8.0]))
    >>> flown, durations.round(1)  # the second leg is too short to be faster than the first
    (array([4., 4., 8.]), array([13.6,  3. ,  8.6]))
    """

    lengths: Real
    joined: Flags
    limits: LegBounds

    @property
    def most(self) -> Real:
        """The greatest commands that make a difference, (m - 1,), m/s.

        A command above what a leg comes to still tells how the next one begins.
        """
        following: Real = np.append(self._top[1:] * self.joined[1:], 0.0)
        return np.maximum(self._top, following)

    @cached_property
    def _top(self) -> Real:
        """The greatest speeds that the legs come to, (m - 1,), m/s; above 0 without a length."""
        return np.maximum(ramps(self.limits).reached(self.lengths), _STEP)

    def flown(self, speeds: Real) -> tuple[Real, Real]:
        """Return e, m/s, and T, s, at the commands `speeds` (..., m - 1), m/s; same shape."""
        table, most = ramps(self.limits), self._top
        begun = speeds.copy()
        begun[..., 1:] = np.where(self.joined[1:], speeds[..., :-1], speeds[..., 1:])
        begun = np.minimum(begun, most)
        planned = np.minimum(begun, np.maximum(speeds, table.at(begun, "lowered")))
        cruise = self.lengths - table.at(planned, "lengths")
        room = cruise / self.limits.second_ramp
        change = np.where(room > planned, np.minimum(speeds, room) - planned, 0.0)
        slower, fits = planned + np.minimum(change, 0.0), np.abs(change)
        for _ in range(_FITTINGS):  # a second ramp has half of the cruise
            fits = np.minimum(fits, table.changed(cruise / 2 / (slower + fits / 2)))
        change = np.copysign(fits, change)
        top = planned + change
        ramp = table.at(top, "durations")
        lasting = self.lengths / top + ramp / 2
        lasting += table.at(planned, "durations") * (1 - planned / (2 * top))
        lasting += table.at(fits, "changes") * change / (2 * top)
        following = table.at(begun, "durations")[..., 1:]
        half = np.minimum(ramp[..., :-1], following) / 2 * self.joined[1:]
        lasting[..., :-1] -= half
        lasting[..., 1:] -= half
        return top, lasting


@dataclass(frozen=True, slots=True, eq=False)
class Ramps:
    """Ramps from rest to `speeds` (n,), m/s.

    `durations` (n,), s; `lengths` (n,), m, of the shortest legs that come to the speeds; `lowered`
    (n,), m/s: what a ramp still ends at when a lower speed is commanded half-way. `changes` (n,),
    s, are the durations of ramps by as much between other speeds.
    """

    speeds: Real
    lengths: Real
    durations: Real
    lowered: Real
    changes: Real

    def at(self, speed: Real, what: Literal["lengths", "durations", "lowered", "changes"]) -> Real:
        """Return what there is of ramps to `speed`, m/s; same shape."""
        found: Real = np.interp(speed, self.speeds, getattr(self, what))
        return found

    def reached(self, length: Real) -> Real:
        """Return the speeds that legs of `length`, m, come to, m/s; same shape."""
        found: Real = np.interp(length, self.lengths, self.speeds)
        return found

    def changed(self, duration: Real) -> Real:
        """Return by how much speeds change in ramps of `duration`, s, in m/s; same shape."""
        found: Real = np.interp(duration, self.changes, self.speeds)
        return found


@lru_cache(maxsize=64)
def ramps(limits: LegBounds) -> Ramps:
    """Return the table of ramps within `limits` but that of the speed."""
    speeds = _STEP * np.arange(1, _FASTEST / _STEP)
    found = [ramp_from_rest(limits.at(speed), math.inf) for speed in speeds.tolist()]
    rows = [
        (
            ramp.high,
            2 * ramp.length,
            ramp.duration,
            ramp.high - ramp.peak * ramp.steady / 2,
            ramp_between(_STEP, _STEP + ramp.high, limits, math.inf).duration,
        )
        for ramp in found
    ]
    return Ramps(*np.array([(0.0,) * 5, *rows]).T)
