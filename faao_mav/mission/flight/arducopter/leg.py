"""One leg from rest to rest: ramp, cruise, and where its speed was changed a second of both."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.mission.flight.arducopter.ramp import JERK_LAG, Ramp, top_speed

SWITCH_LAG = 0.1
"""What a speed command costs, s, between the ramp to the old speed and that to the new one."""

_BISECTIONS = 24


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """Ramps `first`, `second` and `last` with cruises of `waits` s after the first two; (B,)."""

    length: float
    first: Ramp
    second: Ramp
    last: Ramp
    waits: tuple[Real, Real]

    @property
    def duration(self) -> Real:
        """From start to stop, (B,) s."""
        ramps = self.first.duration + self.second.duration + self.last.duration
        return ramps + self.waits[0] + self.waits[1]

    def at(self, t: Real) -> tuple[Real, Real]:
        """Return way (m) and speed (m/s), each (B, k), at `t` (B, k) s after the start."""
        way, speed = self.first.at(t)
        begin = self.first.duration
        for wait, ramp in zip(self.waits, (self.second, self.last), strict=True):
            cruised = np.clip(t - begin[:, None], 0.0, wait[:, None])
            begin = begin + wait
            further, changed = ramp.at(t - begin[:, None])
            way = way + ramp.v0[:, None] * cruised + further
            speed = np.where(t > begin[:, None], changed, speed)
            begin = begin + ramp.duration
        return np.minimum(way, self.length), speed


def plain_leg(length: float, speed: Real, acceleration: float, jerk: float) -> Leg:
    """Return the leg that is planned for `speed` (B,) from its start, m and m/s."""
    top = top_speed(np.full_like(speed, length), speed, acceleration, jerk)
    up, none = Ramp.between(0 * top, top, acceleration, jerk), np.zeros_like(top)
    same = Ramp.between(top, top, acceleration, jerk)
    down = Ramp.between(top, none, acceleration, jerk)
    rest = length - up.length - down.length
    cruise = np.where(top > 0, rest / np.where(top > 0, top, 1.0), 0.0)
    return Leg(length, up, same, down, (none, np.maximum(cruise, 0.0)))


def changed_leg(
    length: float, old: Real, new: Real, elapsed: Real, acceleration: float, jerk: float
) -> Leg:
    """Return the leg planned for speed `old` on which `new` is commanded, (B,) m/s.

    The command comes `elapsed` (B,) s after the start. Speeding up, the ramp to the old speed is
    finished first, and another follows where there is room for it. Slowing down, the ramp up ends
    as soon as its acceleration can be taken back, at A max(r, elapsed); the ramp down follows if
    the cruise is long enough for it.
    """
    least = acceleration * np.maximum(acceleration / jerk + JERK_LAG, elapsed)
    planned = np.minimum(old, np.maximum(new, least))
    before = top_speed(np.full_like(new, length), planned, acceleration, jerk)
    up = Ramp.between(0 * before, before, acceleration, jerk)
    down = Ramp.between(before, 0 * before, acceleration, jerk)
    cruise = length - up.length - down.length
    slowing = Ramp.between(before, np.minimum(new, before), acceleration, jerk).length <= cruise
    quicker = _fitting(before, np.maximum(new, before), cruise, acceleration, jerk)
    top = np.where(new > old, quicker, np.where(slowing, np.minimum(new, before), before))
    more = Ramp.between(before, top, acceleration, jerk)
    last = Ramp.between(top, 0 * top, acceleration, jerk)
    left = length - up.length - more.length - last.length
    moving = np.where(before > 0, before, 1.0)
    wait = np.where(top > before, np.minimum(SWITCH_LAG, left / moving), 0.0)
    cruised = np.where(top > 0, (left - wait * before) / np.where(top > 0, top, 1.0), 0.0)
    return Leg(length, up, more, last, (wait, np.maximum(cruised, 0.0)))


def _fitting(low: Real, high: Real, cruise: Real, acceleration: float, jerk: float) -> Real:
    """Return the speed between two that a ramp up and one back reach within `cruise` (m).

    ArduCopter adds a change of speed to the cruise that it has planned.
    """

    def fits(top: Real) -> NDArray[np.bool_]:
        both: Real = 2 * Ramp.between(low, top, acceleration, jerk).length
        return both <= cruise

    whole = fits(high)
    if whole.all():
        return high
    below, above = low, high
    for _ in range(_BISECTIONS):
        middle = (below + above) / 2
        enough = fits(middle)
        below, above = np.where(enough, middle, below), np.where(enough, above, middle)
    return np.where(whole, high, below)
