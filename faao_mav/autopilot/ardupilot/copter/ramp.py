"""Jerk-limited changes of speed: the ramps that legs are made of.

The jerk of a ramp rises and falls along half a cosine instead of stepping: in a phase of T seconds
it is j(t) = c + d cos(pi t / T), with (c, d) = (J, -J)/2 for the rise to J, (J, J)/2 for the fall
from it and (J, 0) while it is kept. A ramp has seven phases: the jerk rises, is kept and falls; the
acceleration is steady; and the first three again with the opposite sign. It is symmetric about its
middle, so its length is its mean speed times its duration.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

Phase: TypeAlias = tuple[float, float, float]
"""(T, c, d): T seconds with the jerk c + d cos(pi t / T)."""


_JERK_TIMES = 12
"""The least length of the cruise that has room for a second ramp, in jerk times at the speed, of
which none is longer than a second: the autopilot's own rule."""


@dataclass(frozen=True, slots=True)
class LegBounds:
    """What bounds the motion along a leg: m/s, m/s², m/s³.

    `rise` is t_j, s, in which the jerk goes from 0 to `jerk`: it stands for the time the aircraft
    takes to lean.
    """

    speed: float
    acceleration: float
    jerk: float
    rise: float

    @property
    def snap(self) -> float:
        """The largest rate of change of the jerk, pi J / (2 t_j), m/s⁴."""
        return math.pi * self.jerk / (2 * self.rise)

    @property
    def second_ramp(self) -> float:
        """The least duration of a cruise, s, that has room for a second ramp."""
        return _JERK_TIMES * min(self.rise, 1.0)

    def at(self, speed: float) -> "LegBounds":
        """Return these limits with another speed."""
        return LegBounds(speed, self.acceleration, self.jerk, self.rise)


@dataclass(frozen=True, slots=True)
class Ramp:
    """A change from the speed `low` to `high` >= `low`, or its mirror image.

    `jerk` is the largest jerk; `rise`, `kept` and `steady` are how long it takes to rise, is kept,
    and how long the largest acceleration lasts, s.
    """

    low: float
    high: float
    jerk: float
    rise: float
    kept: float
    steady: float

    @property
    def peak(self) -> float:
        """The largest acceleration, m/s²."""
        return self.jerk * (self.rise + self.kept)

    @property
    def duration(self) -> float:
        """D = dv/a + a/J + t_j, s."""
        return 4 * self.rise + 2 * self.kept + self.steady

    @property
    def length(self) -> float:
        """(v0 + v1)/2 D, m."""
        return (self.low + self.high) / 2 * self.duration

    def phases(self, *, down: bool = False) -> list[Phase]:
        """Return the phases that last, from `low` to `high`, or from `high` to `low`."""
        jerk = -self.jerk if down else self.jerk
        half = jerk / 2
        phases = [
            (self.rise, half, -half), (self.kept, jerk, 0.0), (self.rise, half, half),
            (self.steady, 0.0, 0.0),
            (self.rise, -half, half), (self.kept, -jerk, 0.0), (self.rise, -half, -half),
        ]  # fmt: skip
        return [phase for phase in phases if phase[0] > 0]


@lru_cache(maxsize=4096)  # a leg asks for the same ramp several times, flights share legs
def ramp_from_rest(limits: LegBounds, room: float) -> Ramp:
    """Return the ramp from rest to the highest speed that `limits` and `room` metres allow.

    With the full jerk and the peak acceleration a, v = a (a/J + t_j + steady) over v/2 D. Where
    less is enough the snap s stays and t_j shrinks: a = 2 s t_j²/pi, v = 2 a t_j, 2 v t_j metres.
    """
    A, J, rise, snap = limits.acceleration, limits.jerk, limits.rise, limits.snap
    shorter = min(
        (room * math.pi / (8 * snap)) ** 0.25,
        (limits.speed * math.pi / (4 * snap)) ** (1 / 3),
        math.sqrt(A * math.pi / (2 * snap)),
    )
    if shorter < rise:
        rise, J = shorter, 2 * snap * shorter / math.pi
        A = J * rise
    speed = min(limits.speed, _reached(A, J, rise, room))
    return _ramp(0.0, speed, A, J, rise)


def ramp_between(low: float, high: float, limits: LegBounds, room: float) -> Ramp:
    """Return the ramp from `low` > 0 up to `high`, or to what `room` metres allow.

    t_j is kept: a change too small for the full jerk has a smaller one. Without room for any the
    ramp takes no time.
    """
    A, rise = limits.acceleration, limits.rise
    J = min(limits.jerk, A / rise)
    change = high - low
    if change <= 0 or 4 * rise * low >= room:
        return Ramp(low, low, 0.0, 0.0, 0.0, 0.0)
    if (low + change / 2) * _duration(change, A, J, rise) > room:
        least, most = 0.0, change
        for _ in range(50):
            change = (least + most) / 2
            if (low + change / 2) * _duration(change, A, J, rise) > room:
                most = change
            else:
                least = change
        change = least
    return _ramp(low, low + change, A, J, rise)


def _ramp(low: float, high: float, A: float, J: float, rise: float) -> Ramp:
    change = high - low
    if change <= 2 * J * rise**2:
        return Ramp(low, high, change / (2 * rise**2), rise, 0.0, 0.0)
    peak = min(A, _peak(change, J, rise))
    steady = max(0.0, change / peak - peak / J - rise)
    return Ramp(low, high, J, rise, max(0.0, peak / J - rise), steady)


def _peak(change: float, J: float, rise: float) -> float:
    """The acceleration a with a²/J + a t_j = change: a ramp without a steady phase."""
    return J * (math.sqrt(rise**2 + 4 * change / J) - rise) / 2


def _duration(change: float, A: float, J: float, rise: float) -> float:
    if change <= 2 * J * rise**2:
        return 4 * rise
    a = min(A, _peak(change, J, rise))
    return change / a + a / J + rise


def _reached(A: float, J: float, rise: float, room: float) -> float:
    """The speed reached from rest in `room` metres, with t_j and at most A."""
    b = A / J + rise
    speed = A * (math.sqrt(b**2 + 8 * room / A) - b) / 2
    if speed >= A * b:
        return speed
    # a (a/J + t_j)² = room is convex and rising in a: Newton's steps come down from A
    a = A
    for _ in range(30):
        q = a / J + rise
        step = (a * q * q - room) / (q * (q + 2 * a / J))
        a -= step
        if abs(step) <= 1e-13 * A:
            break
    return a * (a / J + rise)
