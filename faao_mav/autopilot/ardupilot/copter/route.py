"""The legs of a flight: planned one after the other, as the autopilot does."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.autopilot.ardupilot.copter.course import Course, PlacedLeg, Stop
from faao_mav.autopilot.ardupilot.copter.leg import StraightLeg, at_speed, planned
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.autopilot.ardupilot.copter.ramp import LegBounds
from faao_mav.autopilot.ardupilot.copter.spline import Curve, CurvedLeg, flown, hermite

Direction: TypeAlias = tuple[float, float, float]
"""A unit vector: east, north, up."""

_TICKS = 1 << 24
"""The number of steps into which the longest overlap of two legs is divided to find it."""


def half_overlap(
    leg: StraightLeg, u: Direction, following: StraightLeg, w: Direction, limits: ArduCopterLimits
) -> float:
    """Return h, s: the `following` leg begins 2 h before `leg` ends, along `u` and `w`.

    The target moves by the sum of both. h is the largest, up to half of either leg's ramp, at
    which after h s of the overlap it is within `radius` of the waypoint, within the accelerations
    in a corner and of a climb, and slower than both legs' limits.
    """
    longest = min(leg.down.duration, following.up.duration) / 2
    end, length = leg.duration, leg.length
    slowest, corner = min(leg.limits.speed, following.limits.speed), limits.corner
    across = u[0] * w[0] + u[1] * w[1]
    along = across + u[2] * w[2]
    u_ground, w_ground = u[0] ** 2 + u[1] ** 2, w[0] ** 2 + w[1] ** 2

    def excess(h: float) -> float:
        s, v, a = leg.at(end - h)
        t, x, b = following.at(h)
        left = length - s
        position = math.sqrt(max(0.0, left * left + t * t - 2 * left * t * along))
        velocity = math.sqrt(max(0.0, v * v + x * x + 2 * v * x * along))
        ground = math.sqrt(max(0.0, a * a * u_ground + b * b * w_ground + 2 * a * b * across))
        return (
            max(
                position / limits.radius,
                velocity / slowest,
                ground / corner,
                abs(a * u[2] + b * w[2]) / limits.climb_acceleration,
            )
            - 1
        )

    if excess(longest) <= 1e-9:
        return longest
    tick = longest / _TICKS
    return tick * bisect_left(range(_TICKS), 0.0, key=lambda ticks: excess(ticks * tick))


_POINT = 1e-6
"""The length, m, below which a leg is none: its end counts as reached where it begins."""


@dataclass(frozen=True, slots=True)
class _PlannedLeg:
    """A leg, if there is one, and how the flight goes on after it.

    The next leg begins 2 `early` seconds before this one ends, planned at this one's speed if it
    `overlaps`; a leg that does not begins at the speed `entry`, m/s.
    """

    leg: StraightLeg | CurvedLeg | None
    early: float = 0.0
    overlaps: bool = False
    entry: float = 0.0


class Router:
    """The legs along points (m, 3) in m, flown at any speeds and with any waits.

    `splines` (m,) marks spline waypoints, `stopping` (m,) the points at which the aircraft stops.
    A leg is planned when the one before it begins, at the speed in force then. Where the aircraft
    does not stop, a straight leg begins before the straight leg ahead of it ends; half-way through
    their overlap the point between them counts as reached, and the next speed comes into force.
    """

    def __init__(
        self,
        points: Real,
        splines: NDArray[np.bool_],
        stopping: NDArray[np.bool_],
        limits: ArduCopterLimits,
    ) -> None:
        self._points, self._limits = points, limits
        self._marks = np.stack([splines, stopping])
        self._stopping: list[bool] = stopping.tolist()
        self._steps = np.diff(points, axis=0)
        self._lengths: list[float] = np.linalg.norm(self._steps, axis=1).tolist()
        self._directions = [_direction(step) for step in self._steps.tolist()]
        self._curves = [self._curve(k, splines) for k in range(len(self._steps))]
        # flights that differ in a few speeds have most of their legs in common
        self._known: dict[tuple[int, float, float | None, float, float], _PlannedLeg] = {}
        self._from_rest: dict[tuple[int, float], StraightLeg] = {}

    def leads_along(
        self, points: Real, splines: NDArray[np.bool_], stopping: NDArray[np.bool_]
    ) -> bool:
        """Tell whether these are the points."""
        return np.array_equal(points, self._points) and np.array_equal(
            [splines, stopping], self._marks
        )

    def course(self, speeds: Sequence[float], waits: Sequence[float]) -> Course:
        """Return the course at `speeds` (m - 1,), m/s, with `waits` (m,), s, at the stops."""
        legs: list[PlacedLeg] = []
        stops: list[Stop] = []
        passed = [0.0]
        start, planned_at, early, entry = 0.0, None, 0.0, 0.0
        for k, speed in enumerate(speeds):
            key = (k, speed, planned_at, early, entry)
            if (step := self._known.get(key)) is None:
                step = self._known[key] = self._step(*key)
            end = start
            if step.leg is not None:
                legs.append(PlacedLeg(step.leg, start, self._points[k], self._steps[k]))
                end = legs[-1].end
            if self._stopping[k + 1]:
                stops.append(Stop(k + 1, end, waits[k + 1]))
            early, entry, planned_at = step.early, step.entry, speed if step.overlaps else None
            passed.append(end - early)
            start = end - 2 * early
        return Course(self._points[0], legs, np.array(passed), speeds, waits[0], stops)

    def _step(
        self, k: int, speed: float, planned_at: float | None, elapsed: float, entry: float
    ) -> _PlannedLeg:
        """Leg k at `speed`: if it was planned at another speed it has begun `elapsed` s ago."""
        leg: StraightLeg | CurvedLeg | None = None
        if planned_at is not None:
            begun = self._begun(k, planned_at)
            leg = at_speed(begun, _along(self._limits, self._directions[k], speed).speed, elapsed)
        elif self._lengths[k] > _POINT:
            leg = self._planned(k, speed, entry)
        if leg is None or self._stopping[k + 1]:
            return _PlannedLeg(leg)
        if isinstance(leg, StraightLeg) and self._is_straight(k + 1):
            following = self._begun(k + 1, speed)
            u, w = self._directions[k], self._directions[k + 1]
            return _PlannedLeg(leg, half_overlap(leg, u, following, w, self._limits), overlaps=True)
        return _PlannedLeg(leg, entry=leg.final)

    def _is_straight(self, k: int) -> bool:
        return self._curves[k] is None and self._lengths[k] > _POINT

    def _planned(self, k: int, speed: float, entry: float) -> StraightLeg | CurvedLeg:
        """Leg k, begun at the speed `entry`."""
        curve = self._curves[k]
        if curve is None:
            return self._straight(k, speed, entry)
        end = 0.0 if self._stopping[k + 1] else self._final(k, speed)
        return flown(curve, self._limits, speed, entry, end)

    def _begun(self, k: int, speed: float) -> StraightLeg:
        """Return the straight leg k that begins at rest, as the one before it ends."""
        if (leg := self._from_rest.get((k, speed))) is None:
            leg = self._from_rest[k, speed] = self._straight(k, speed)
        return leg

    def _straight(self, k: int, speed: float, entry: float = 0.0) -> StraightLeg:
        limits = _along(self._limits, self._directions[k], speed)
        end = 0.0 if self._stopping[k + 1] else self._final(k, speed)
        return planned(self._lengths[k], limits, start=entry, end=end)

    def _final(self, k: int, speed: float) -> float:
        """The speed at the end of leg k, where a spline goes on: 0 between straight legs."""
        limits, here, following = self._limits, self._curves[k], self._curves[k + 1]
        if following is not None:
            final = float(following.allowed(limits, speed)[0])
            return final if here is None else min(final, float(here.allowed(limits, speed)[-1]))
        if here is not None and self._is_straight(k + 1):
            straight = planned(self._lengths[k + 1], _along(limits, self._directions[k + 1], speed))
            return min(straight.up.high, float(here.allowed(limits, speed)[-1]))
        return 0.0

    def _curve(self, k: int, splines: NDArray[np.bool_]) -> Curve | None:
        """The curve of leg k if it leads to a spline waypoint.

        It leaves along the leg before, or as the spline before arrived, and arrives parallel to
        the line from its origin to the point after, or, before a straight leg, along that leg;
        where the aircraft stops it has no tangent.
        """
        if not splines[k + 1] or self._lengths[k] <= _POINT:
            return None
        leaving, arriving = np.zeros(3), np.zeros(3)
        if not self._stopping[k]:
            leaving = self._steps[k - 1] + (self._steps[k] if splines[k] else 0.0)
        if not self._stopping[k + 1]:
            arriving = self._steps[k + 1] + (self._steps[k] if splines[k + 2] else 0.0)
        return hermite(self._points[k], self._points[k + 1], leaving, arriving)


def _direction(step: Sequence[float]) -> Direction:
    east, north, up = step
    length = math.hypot(east, north, up)
    return (east / length, north / length, up / length) if length > 0 else (0.0, 0.0, 0.0)


def _over(limit: float, share: float) -> float:
    return limit / share if share > 0 else math.inf


def _along(limits: ArduCopterLimits, direction: Direction, speed: float) -> LegBounds:
    """Return the limits along `direction` where `speed` across the ground is commanded."""
    east, north, up = direction
    ground = math.hypot(east, north)
    return LegBounds(
        min(
            _over(speed, ground),
            _over(limits.climb_speed if up > 0 else limits.descent_speed, abs(up)),
        ),
        min(_over(limits.acceleration, ground), _over(limits.climb_acceleration, abs(up))),
        limits.jerk,
        limits.rise,
    )
