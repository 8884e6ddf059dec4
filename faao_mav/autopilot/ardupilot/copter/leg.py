"""A straight leg: how far along it the target is at which time."""

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import ClassVar, TypeAlias

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.copter.durations import ramps
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.autopilot.ardupilot.copter.ramp import (
    LegBounds,
    Phase,
    Ramp,
    ramp_between,
    ramp_from_rest,
)

LegState: TypeAlias = tuple[float, float, float]
"""Distance along the leg, m; speed, m/s; acceleration, m/s²."""

_SLOWEST = 0.75
"""The least speed that is commanded, m/s. Measured, flown and planned, m rms, on a plan with two
hovers at 9 m/s: with 0.4 6.0, with 0.75 1.6, with 1.5 1.3; with 1.5 other plans need more items and
twice the time to convert."""

_SHORTEST = 4.0
"""The least length of a leg, m, where the path needs no shorter one: on such centimetres decide how
long the target waits for an aircraft that has passed it. Flown: a mission with 1.1 m before a hover
left there 4.1 s late, one with 2.3 m 0.4 s."""


@dataclass(frozen=True)
class StraightLeg:
    """A leg of `length` metres: a ramp up, perhaps a second ramp, a cruise, a ramp down.

    `times` and `states` are those at the beginning of every phase, and at the end.
    """

    length: float
    limits: LegBounds
    up: Ramp
    down: Ramp
    phases: tuple[Phase, ...] = field(repr=False)
    times: tuple[float, ...] = field(repr=False)
    states: tuple[LegState, ...] = field(repr=False)

    @property
    def duration(self) -> float:
        """From the beginning to the end, s."""
        return self.times[-1]

    @property
    def final(self) -> float:
        """The speed at the end, m/s."""
        return self.down.low

    @property
    def braking(self) -> float:
        """When the ramp down begins, s."""
        return self.times[-1] - self.down.duration

    def rows(self) -> Iterator[tuple[float, ...]]:
        """Yield for each phase its begin, s; w = pi / T; q = d / w²; c; s, v, a then."""
        for time, (span, c, d), state in zip(self.times, self.phases, self.states, strict=False):
            yield time, math.pi / span, d * (span / math.pi) ** 2, c, *state

    def at(self, time: float) -> LegState:
        """Return where the target is `time` s, 0 to `duration`, after the beginning."""
        k = min(bisect_right(self.times, time), len(self.phases)) - 1
        span, c, d = self.phases[k]
        s, v, a = self.states[k]
        t = time - self.times[k]
        if d == 0.0:
            return s + t * (v + t * (a / 2 + t * c / 6)), v + t * (a + t * c / 2), a + t * c
        w = math.pi / span
        wave, q = math.sin(w * t) / w, d / w**2
        return (
            s + t * (v + t * (a / 2 + t * c / 6)) + q * (t - wave),
            v + t * (a + t * c / 2) + q * (1 - math.cos(w * t)),
            a + t * c + d * wave,
        )


def planned(
    length: float, limits: LegBounds, *, start: float = 0.0, end: float = 0.0
) -> StraightLeg:
    """Return the leg that begins at the speed `start` and ends at `end`, m/s: 0 except at splines.

    A ramp from rest that does not fit in half of the leg ends at a lower speed, which is the
    highest for the other ramps as well; one of these that does not fit is left out.
    """
    up = ramp_from_rest(limits, length / 2)
    if start > 0:
        up = ramp_between(min(start, up.high), up.high, limits, length / 2)
    return _assembled(length, limits, up, up.high, up.phases(), up.length, end)


def at_speed(leg: StraightLeg, speed: float, elapsed: float) -> StraightLeg:
    """Return how `leg` goes on when its speed limit becomes `speed` after `elapsed` s.

    Before its beginning it is planned anew, on its ramp down nothing changes. Otherwise the ramp
    up is finished, for a lower speed with as little steady acceleration as still possible; a
    second ramp follows if the cruise is long enough for it.
    """
    if leg.limits.speed == speed or elapsed >= leg.braking:
        return leg
    limits = leg.limits.at(speed)
    if elapsed <= 0:
        return planned(leg.length, limits, end=leg.final)
    up, down = leg.up, leg.down
    early = 2 * up.rise + up.kept
    late = early + up.steady
    if speed < up.high and up.steady > 0 and elapsed <= late:
        slowest = up.high - up.peak * (late - max(elapsed, early))
        up = ramp_from_rest(limits.at(max(speed, slowest)), leg.length / 2)
        down = down if down.low > 0 else up
    cruise = leg.length - up.length - down.length  # before another speed changes the ramp down
    phases, covered, reached = up.phases(), up.length, up.high
    if (second := _second(up.high, limits, cruise)) is not None:
        slower = second.low < up.high
        phases += second.phases(down=slower)
        covered += second.length
        reached = second.low if slower else second.high
    return _assembled(leg.length, limits, up, reached, phases, covered, leg.final)


def _second(speed: float, limits: LegBounds, cruise: float) -> Ramp | None:
    """The ramp between `speed` and the limit that the `cruise` metres have room for."""
    room = limits.second_ramp
    if limits.speed == speed or speed * room >= cruise:
        return None
    if limits.speed < speed:
        second = ramp_between(limits.speed, speed, limits, cruise / 2)
        return replace(second, low=speed - (second.high - second.low), high=speed)
    fastest = min(limits.speed, cruise / room)
    return ramp_between(speed, fastest, limits, cruise / 2)


def _assembled(
    length: float,
    limits: LegBounds,
    up: Ramp,
    speed: float,
    phases: list[Phase],
    covered: float,
    end: float,
) -> StraightLeg:
    if end > 0:
        down = ramp_between(min(end, speed), speed, limits, length / 2)
        if down.high < speed:
            down = ramp_between(speed, speed, limits, length / 2)
    else:
        down = ramp_from_rest(limits.at(speed), length / 2)
    cruise = (length - covered - down.length) / speed
    if cruise > 0:
        phases.append((cruise, 0.0, 0.0))
    phases += down.phases(down=True)
    times = tuple(accumulate((phase[0] for phase in phases), initial=0.0))
    return StraightLeg(length, limits, up, down, tuple(phases), times, _states(phases, up.low))


def _states(phases: list[Phase], speed: float) -> tuple[LegState, ...]:
    s, v, a = 0.0, speed, 0.0
    states = [(s, v, a)]
    for span, c, d in phases:
        q = d * (span / math.pi) ** 2
        s += span * (v + span * (a / 2 + span * c / 6) + q)
        v += span * (a + span * c / 2) + 2 * q
        a += span * c
        states.append((s, v, a))
    return tuple(states)


@dataclass(frozen=True, slots=True)
class ArduCopterLegs(ArduCopterLimits):
    """How ArduCopter flies a leg between plain waypoints.

    Every leg is planned as if it began and ended at rest, with the ramps of the flight model.
    """

    least: ClassVar[float] = _SHORTEST
    slowest: ClassVar[float] = _SLOWEST
    run_in: ClassVar[float] = 1.2

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg that reaches `speed`, m: two ramps; same shape.

        >>> float(ArduCopterLegs().shortest_leg(np.array(8.0)).round(1))
        48.0
        """
        return ramps(self.bounds).at(speed, "lengths")

    def reachable_speed(self, length: Real) -> Real:
        """Return the speed that legs of `length`, m, reach, m/s; same shape."""
        return ramps(self.bounds).reached(length)

    def radii(self, room: Real, turn: Real, stops: Flags) -> Real:  # noqa: ARG002
        """Return acceptance radii, m: 0, for ArduCopter stores none; the shape of `turn`."""
        return np.zeros_like(turn)

    @property
    def bounds(self) -> LegBounds:
        """What bounds the motion along a level leg at any speed."""
        return LegBounds(math.inf, self.acceleration, self.jerk, self.rise)
