"""The target that ArduCopter follows: where it is on its own clock, along legs and splines."""

import math

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.copter.legs import StraightLegs, largest
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.autopilot.ardupilot.copter.spline import Curve, speed_along, within
from faao_mav.autopilot.stepper import STEP

_POINT = 1e-6
"""The length, m, below which a leg is none: its end counts as reached where it begins."""


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
        flown = lengths > _POINT
        ways = steps / np.where(flown, lengths, 1.0)[:, None]
        straight = flown & ~splines[1:]
        joined = straight & np.append(False, straight[:-1])[:count] & ~stopping[:-1]
        own = within(ways, limits.acceleration, limits.climb_acceleration)
        legs = StraightLegs(lengths, joined, limits, own)
        told = speed_along(ways, speeds, limits)
        in_force = speed_along(ways, np.where(joined, np.roll(speeds, 1), speeds), limits)
        early: Real = np.zeros(count)
        begun, planned, top = legs.speeds(in_force, told)
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
        counts = np.where(straight, lasts - firsts, 0)
        which = np.repeat(np.arange(count), counts)
        sample = np.arange(len(which)) + np.repeat(firsts + counts - np.cumsum(counts), counts)
        t = clock[sample] - starts[which]
        along = np.array([entry[which] * t, entry[which], np.zeros(len(which))])
        for each, change, begin in zip(ramps, changes, begins, strict=True):
            along += change[which] * each[which].at(t - begin[which])
        for kind, axis in np.ndindex(3, 3):
            values = ways[which, axis] * along[kind]
            motion[:, 3 * kind + axis] += np.bincount(sample, values, len(motion))
        for k, curve in curves.items():  # their acceleration is not fed forward
            flight = slice(firsts[k], lasts[k])
            motion[flight, :6] += curve.motion(clock[flight] - starts[k])
            motion[flight, :3] -= points[k]
        self.motion: Real = motion[:-1]


def _half_overlaps(legs: StraightLegs, ways: Real, top: Real, begun: Real, slowest: Real) -> Real:
    """Return h (m - 2,), s: each leg but the first begins 2 h before the one before it ends.

    The target moves by the sum of both, along the unit vectors `ways` (m - 1, 3). h is the largest,
    up to half of either's ramp, at which after h s of the overlap it is within the radius of the
    point between them, within the acceleration in a corner, and no faster than `slowest`, m/s.
    """
    ending, beginning = legs.ramp(top)[:-1], legs.ramp(begun)[1:]
    cosine, limits = np.sum(ways[:-1] * ways[1:], axis=1), legs.limits

    def excess(h: Real) -> Real:
        left, slow, brake = top[:-1] * ending.at(h)
        gone, fast, push = begun[1:] * beginning.at(h)
        apart = left**2 + gone**2 - 2 * left * gone * cosine
        speed = slow**2 + fast**2 + 2 * slow * fast * cosine
        turn = brake**2 + push**2 - 2 * brake * push * cosine
        limit = limits.radius**2, slowest**2, limits.corner**2
        worst: Real = np.max(np.array([apart, speed, turn]) / np.broadcast_arrays(*limit), axis=0)
        return worst

    longest = np.minimum(ending.duration, beginning.duration) / 2
    return largest(excess, np.full(len(longest), 1 + 1e-9), longest)
