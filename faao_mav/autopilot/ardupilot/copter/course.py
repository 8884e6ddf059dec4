"""The course: where the target that the aircraft follows is, on the target's own clock."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.ardupilot.copter.leg import StraightLeg
from faao_mav.autopilot.ardupilot.copter.spline import CurvedLeg

GRID = 0.1
"""The step of the target's clock and of the pursuit, s."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedLeg:
    """A leg from `origin` on by `step`, both (3,) m, that begins `start` s into the course."""

    leg: StraightLeg | CurvedLeg
    start: float
    origin: Real
    step: Real

    @property
    def end(self) -> float:
        """When the target comes to the leg's end, s into the course."""
        return self.start + self.leg.duration


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop at a point, by its index: the clock stands at `time` while the aircraft waits."""

    point: int
    time: float
    wait: float


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The way of the target, whose clock stands still while the aircraft is told to wait.

    `legs` lead on from `origin` (3,), m; where they overlap their motions add up. `passed` (m,) is
    when the autopilot takes the points as reached, s on that clock: up to each but the first it has
    been told `speeds` (m - 1,), m/s. It begins at 0 after `wait` s.
    """

    origin: Real
    legs: Sequence[PlacedLeg]
    passed: Real
    speeds: Sequence[float]
    wait: float
    stops: Sequence[Stop]

    @property
    def end(self) -> float:
        """When the target comes to its end, s on its clock."""
        return max([placed.end for placed in self.legs], default=0.0)


def motion_of(course: Course, clock: Real) -> Real:
    """Return the target's position, velocity and acceleration (n, 9), SI, at `clock` (n,) s.

    The times increase. The acceleration on splines is not fed forward, so it is left out.
    """
    legs = course.legs
    begins, ends = np.searchsorted(
        clock, [[placed.start for placed in legs], [placed.end for placed in legs]]
    )
    motion: Real = np.zeros((len(clock) + 1, 9))
    motion[0, :3] = course.origin
    np.add.at(motion[:, :3], ends, np.reshape([placed.step for placed in legs], (-1, 3)))
    np.cumsum(motion[:, :3], axis=0, out=motion[:, :3])
    motion = motion[:-1]
    straight: list[tuple[PlacedLeg, StraightLeg, int, int]] = []
    for placed, begin, end in zip(legs, begins.tolist(), ends.tolist(), strict=True):
        if isinstance(placed.leg, StraightLeg):
            straight.append((placed, placed.leg, begin, end - begin))
        else:
            _add_curved(motion[begin:end], clock[begin:end] - placed.start, placed, placed.leg)
    if straight:
        _add_straight(motion, clock, straight)
    return motion


def grid_of(course: Course) -> Real:
    """Return the target's clock from 0 past the end of `course` in steps of `GRID`, s."""
    grid: Real = GRID * np.arange(math.ceil(course.end / GRID) + 2, dtype=float)
    return grid


def _add_straight(
    motion: Real, clock: Real, legs: Sequence[tuple[PlacedLeg, StraightLeg, int, int]]
) -> None:
    """Add the motion under way on straight legs to `motion` (n, 9).

    Each comes with its first sample and the number of its samples.
    """
    placed, flown, firsts, each = zip(*legs, strict=True)
    starts, counts = np.array([one.start for one in placed]), np.array(each)
    which = np.repeat(np.arange(len(legs)), counts)
    sample = np.arange(len(which)) + np.repeat(firsts + counts - np.cumsum(counts), counts)
    local = clock[sample] - starts[which]
    # the phases of all legs in one sorted list: no leg lasts as long as `far`
    far = 2 * max(leg.duration for leg in flown) + 1
    table = np.array([row for leg in flown for row in leg.rows()])
    table_of_leg = np.repeat(np.arange(len(legs)), [len(leg.phases) for leg in flown])
    found = np.searchsorted(table_of_leg * far + table[:, 0], which * far + local, "right") - 1
    begin, w, q, c, s, v, a = table[found].T
    t = local - begin
    sine = np.sin(w * t)
    along = (
        s + t * (v + t * (a / 2 + t * c / 6)) + q * (t - sine / w),
        v + t * (a + t * c / 2) + q * (1 - np.cos(w * t)),
        a + t * c + q * w * sine,
    )
    steps = np.array([one.step for one in placed])
    directions = steps / np.array([[leg.length] for leg in flown])
    for axis in np.flatnonzero(directions.any(axis=0)):
        share = directions[which, axis]
        for kind, scalar in enumerate(along):
            motion[:, 3 * kind + axis] += np.bincount(sample, share * scalar, len(motion))


def _add_curved(motion: Real, local: Real, placed: PlacedLeg, leg: CurvedLeg) -> None:
    """Add position and velocity of a spline leg at its times `local` (n,), s, to `motion`."""
    along = np.hstack([leg.curve.points - placed.origin, leg.curve.tangents * leg.speeds[:, None]])
    for k, values in enumerate(along.T):
        motion[:, k] += np.interp(local, leg.times, values)
