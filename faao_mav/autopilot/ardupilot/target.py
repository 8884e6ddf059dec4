"""The target that ArduCopter follows: where it is on its own clock, along legs and splines."""

import math

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.legs import FACTS, ArduCopterLimits, StraightLegs, largest
from faao_mav.autopilot.model import STEP


def within(ways: Real, across: Real | float, vertical: Real | float) -> Real:
    """Return the largest values (k,) along unit vectors `ways` (k, 3) that keep both limits."""
    ground, up = np.hypot(ways[:, 0], ways[:, 1]), np.abs(ways[:, 2])
    return np.minimum(across / np.maximum(ground, 1e-12), vertical / np.maximum(up, 1e-12))


def speed_along(ways: Real, speeds: Real | float, limits: ArduCopterLimits) -> Real:
    """Return the greatest speeds (k,), m/s, where `speeds` across the ground are commanded."""
    vertical = np.where(ways[:, 2] >= 0, limits.climb_speed, limits.descent_speed)
    return within(ways, speeds, vertical)


class Curve:
    """Points (k, 3), m, of the leg to spline waypoint `to`, from its beginning, with `tangents`.

    It leaves along the leg before, or as the spline before arrived, and arrives parallel to the
    line from its origin to the point after, or, before a straight leg, along that leg; where the
    aircraft stops it has no tangent. No place is faster than its `allowed` (k,), m/s: at a speed v
    in a bend v² |curvature| is half the acceleration at most. `fly` sets the `speeds` (k,), m/s,
    with which the target passes the points, and when, `times` (k,), s from the beginning.
    """

    def __init__(
        self,
        to: int,
        points: Real,
        splines: Flags,
        stopping: Flags,
        limits: ArduCopterLimits,
        speed: float,
    ) -> None:
        k, steps = to - 1, np.diff(points, axis=0)
        step, leaving, arriving = steps[k], np.zeros(3), np.zeros(3)
        if not stopping[k]:
            leaving = steps[k - 1] + (step if splines[k] else 0.0)
        if not stopping[to]:
            arriving = steps[to] + (step if splines[to + 1] else 0.0)
        chord = float(np.linalg.norm(step))
        tangents = float(np.linalg.norm(leaving) + np.linalg.norm(arriving))
        scale = min(1.0, FACTS.tangents * chord / tangents) if tangents > 0 else 1.0
        leaving, arriving = scale * leaving, scale * arriving
        quadratic, cubic = 3 * step - 2 * leaving - arriving, leaving + arriving - 2 * step
        count = int(np.clip(np.ceil(chord / FACTS.spacing), 16, 200))
        x = np.linspace(0.0, 1.0, 1 + count)[:, None]
        self.points = x * (leaving + x * (quadratic + x * cubic))
        ways = np.gradient(self.points, axis=0)
        spacing = np.maximum(np.linalg.norm(ways, axis=1), 1e-12)[:, None]
        self.tangents = ways / spacing
        bends = np.gradient(self.tangents, axis=0) / spacing
        bend = np.maximum(np.linalg.norm(bends, axis=1), 1e-12)
        own = limits.acceleration, limits.climb_acceleration
        bent = within(bends / bend[:, None], *own) / 2
        self.allowed = np.minimum(speed_along(self.tangents, speed, limits), np.sqrt(bent / bend))
        self._slope = within(self.tangents, *own) / 2
        self.times = self.speeds = np.zeros(len(x))

    def fly(self, start: float, end: float) -> None:
        """Set `times` and `speeds` from the speed `start` to at most `end`, m/s.

        At every point it is at most as fast as it could brake, over the straight line to the end,
        to `end`; its speed changes by half the acceleration at most.
        """
        lengths = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        left = np.linalg.norm(self.points[-1] - self.points, axis=1)
        wanted = np.minimum(self.allowed**2, 2 * self._slope * left + end**2)
        squares = [start**2]
        for aim, change in zip(wanted[1:], 2 * self._slope[1:] * lengths, strict=True):
            squares.append(min(max(aim, squares[-1] - change), squares[-1] + change))
        self.speeds = np.sqrt(np.maximum(squares, 0.0))
        spans = 2 * lengths / np.maximum(self.speeds[1:] + self.speeds[:-1], 1e-3)
        self.times = np.concatenate([[0.0], np.cumsum(spans)])

    def motion(self, t: Real) -> Real:
        """Return place and velocity (n, 6), SI, at the times `t` (n,), s from the beginning."""
        told = np.hstack([self.points, self.tangents * self.speeds[:, None]])
        return np.stack([np.interp(t, self.times, column) for column in told.T], axis=-1)


class Target:
    """The target's way along `points` (m, 3), m, at `speeds` (m - 1,), m/s.

    `splines` (m,) marks spline waypoints, `stopping` (m,) the points at which the aircraft stops.
    Elsewhere a straight leg begins before the straight leg ahead of it ends, and their motions add
    up; half-way through their overlap the point between them counts as reached, and the next speed
    comes into force. `passed` (m,) is when that is, s on the target's clock; `motion` (n, 9) is
    position, velocity and acceleration, SI, every `STEP` s of it.
    """

    def __init__(
        self, points: Real, speeds: Real, splines: Flags, stopping: Flags, limits: ArduCopterLimits
    ) -> None:
        steps = np.diff(points, axis=0)
        count, lengths = len(steps), np.linalg.norm(steps, axis=1)
        flown = lengths > FACTS.point
        ways = steps / np.where(flown, lengths, 1.0)[:, None]
        straight = flown & ~splines[1:]
        joined = straight & np.append(False, straight[:-1])[:count] & ~stopping[:-1]
        own = within(ways, limits.acceleration, limits.climb_acceleration)
        legs = StraightLegs(lengths, joined, limits, own)
        told = speed_along(ways, speeds, limits)
        in_force = speed_along(ways, np.where(joined, np.roll(speeds, 1), speeds), limits)
        early: Real = np.zeros(count)
        for _ in range(2):  # how early a leg begins depends on the speed at which the last one ends
            begun, planned, top = legs.speeds(in_force, told, np.roll(early, 1))
            slowest = np.minimum(told[:-1], in_force[1:])
            early[:-1] = _half_overlaps(legs, ways, top, begun, slowest) * joined[1:]

        curves = {
            k: Curve(k + 1, points, splines, stopping, limits, float(speeds[k]))
            for k in np.flatnonzero(flown & splines[1:]).tolist()
        }
        entry, last = np.zeros(count), np.zeros(count)
        for k, curve in curves.items():
            final = 0.0
            if not stopping[k]:
                before = last[k - 1] if k - 1 in curves else top[k - 1]
                last[k - 1] = min(before, curve.allowed[0])
            if not stopping[k + 1]:
                onward = curves[k + 1].allowed[0] if k + 1 in curves else top[k + 1]
                final = min(float(onward), float(curve.allowed[-1]))
            curve.fly(0.0 if stopping[k] else float(last[k - 1]), final)
            last[k] = curve.speeds[-1]
            if not stopping[k + 1]:
                entry[k + 1] = min(last[k], planned[k + 1])
        changes = planned - entry, top - planned, np.minimum(last, top) - top
        ramps = [legs.ramp(np.abs(change)) for change in changes]
        means = entry + planned, planned + top, top + np.minimum(last, top)
        ramped = sum(each.duration * v / 2 for each, v in zip(ramps, means, strict=True))
        third = ramps[0].duration + ramps[1].duration + np.maximum(lengths - ramped, 0.0) / top
        begins = np.zeros(count), ramps[0].duration, third
        durations = np.where(straight, third + ramps[2].duration, 0.0)
        for k, curve in curves.items():
            durations[k] = curve.times[-1]
        ends = np.cumsum(durations - 2 * early) + 2 * early
        starts = ends - durations
        self.passed: Real = np.append(0.0, ends - early)

        clock = STEP * np.arange(math.ceil(ends.max(initial=0.0) / STEP) + 2)
        firsts, lasts = np.searchsorted(clock, [starts, ends])
        motion = np.zeros((len(clock) + 1, 9))
        motion[0, :3] = points[0]
        np.add.at(motion[:, :3], lasts, steps)
        np.cumsum(motion[:, :3], axis=0, out=motion[:, :3])
        for k in np.flatnonzero(flown).tolist():
            part = slice(firsts[k], lasts[k])
            t = clock[part] - starts[k]
            if k in curves:  # their acceleration is not fed forward
                motion[part, :6] += curves[k].motion(t)
                continue
            along = np.array([entry[k] * t, np.full(len(t), entry[k]), np.zeros(len(t))])
            for each, change, begin in zip(ramps, changes, begins, strict=True):
                if change[k] != 0:
                    along += change[k] * each[k].at(t - begin[k])
            motion[part] += (along.T[:, :, None] * ways[k]).reshape(-1, 9)
        self.motion: Real = motion[:-1]


def _half_overlaps(legs: StraightLegs, ways: Real, top: Real, begun: Real, slowest: Real) -> Real:
    """Return h (m - 2,), s: each leg but the first begins 2 h before the one before it ends.

    The target moves by the sum of both, along the unit vectors `ways` (m - 1, 3). h is the largest,
    up to half of either's ramp, at which after h s of the overlap it is within the radius of the
    point between them, within the acceleration in a corner, and no faster than `slowest`, m/s.
    """
    ending, beginning = legs.ramp(top)[:-1], legs.ramp(begun)[1:]
    cosine, limits = np.sum(ways[:-1] * ways[1:], axis=1), legs.limits
    corner = limits.corner_acceleration or 2 * limits.acceleration

    def excess(h: Real) -> Real:
        left, slow, brake = top[:-1] * ending.at(h)
        gone, fast, push = begun[1:] * beginning.at(h)
        apart = left**2 + gone**2 - 2 * left * gone * cosine
        speed = slow**2 + fast**2 + 2 * slow * fast * cosine
        turn = brake**2 + push**2 - 2 * brake * push * cosine
        limit = limits.radius**2, slowest**2, corner**2
        worst: Real = np.max(np.array([apart, speed, turn]) / np.broadcast_arrays(*limit), axis=0)
        return worst

    longest = np.minimum(ending.duration, beginning.duration) / 2
    return largest(excess, np.full(len(longest), 1 + 1e-9), longest)
