"""The course: where the target that the aircraft follows is, on the target's own clock."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.vehicle.ardupilot.copter.leg import StraightLeg
from faao_mav.vehicle.ardupilot.copter.spline import CurvedLeg

GRID = 0.1
"""The step of the target's clock and of the pursuit, s."""

TargetRow: TypeAlias = Sequence[float]
"""What the target does at a sample, each value with its change up to the next sample: position
east, north; speed east, north; climb rate squared; acceleration east, north."""


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
    when the autopilot takes the points as reached, s on that clock. It begins at 0 after `wait` s.
    """

    origin: Real
    legs: Sequence[PlacedLeg]
    passed: Real
    wait: float
    stops: Sequence[Stop]

    @property
    def end(self) -> float:
        """When the target comes to its end, s on its clock."""
        return max([placed.end for placed in self.legs], default=0.0)


def motions(courses: Sequence[Course], clocks: Sequence[Real], derivatives: int) -> list[Real]:
    """Return for every course positions, m, and so many of their `derivatives`, up to 2.

    The clocks (n,) increase; the shapes are (n, 3 (1 + derivatives)). The acceleration on splines
    is not fed forward, so it is left out.
    """
    bounds = np.cumsum([0, *map(len, clocks)])
    motion: Real = np.zeros((bounds[-1], 3 * (derivatives + 1)))
    parts = [motion[first:last] for first, last in pairwise(bounds.tolist())]
    under_way: list[tuple[PlacedLeg, StraightLeg, int, int]] = []
    for course, clock, part, first in zip(
        courses, clocks, parts, bounds[:-1].tolist(), strict=True
    ):
        begins, ends = np.searchsorted(
            clock,
            [[placed.start for placed in course.legs], [placed.end for placed in course.legs]],
        )
        steps = np.zeros((len(clock) + 1, 3))
        steps[0] = course.origin
        np.add.at(steps, ends, np.reshape([placed.step for placed in course.legs], (-1, 3)))
        np.cumsum(steps[:-1], axis=0, out=part[:, :3])
        for placed, begin, end in zip(course.legs, begins.tolist(), ends.tolist(), strict=True):
            if isinstance(placed.leg, StraightLeg):
                under_way.append((placed, placed.leg, first + begin, end - begin))
            else:
                _add_curved(part, clock, slice(begin, end), placed, placed.leg)
    if under_way:
        _add_straight(motion, np.concatenate(clocks), under_way)
    return parts


def table_of(motion: Real) -> Sequence[TargetRow]:
    """Return the rows of `motion` (n, 9) across the ground."""
    values = np.column_stack([motion[:, :2], motion[:, 3:5], motion[:, 5] ** 2, motion[:, 6:8]])
    rows = np.stack([values[:-1], np.diff(values, axis=0)], axis=2).reshape(len(motion) - 1, -1)
    return list(rows.tolist())


def grid_of(course: Course) -> Real:
    """Return the target's clock from 0 past the end of `course` in steps of `GRID`, s."""
    grid: Real = GRID * np.arange(math.ceil(course.end / GRID) + 2, dtype=float)
    return grid


def _add_straight(
    motion: Real, clock: Real, legs: Sequence[tuple[PlacedLeg, StraightLeg, int, int]]
) -> None:
    """Add the motion under way on straight legs to `motion` (n, 3 to 9).

    Each comes with its first sample and the number of its samples.
    """
    placed, flown, firsts, each = zip(*legs, strict=True)
    starts, counts = np.array([one.start for one in placed]), np.array(each)
    which = np.repeat(np.arange(len(legs)), counts)
    sample = np.arange(len(which)) + np.repeat(firsts + counts - np.cumsum(counts), counts)
    local = clock[sample] - starts[which]
    # the phases of all legs in one sorted list: no leg lasts as long as `far`
    far = 2 * max(leg.duration for leg in flown) + 1
    table = np.concatenate([leg.table for leg in flown])
    table_of_leg = np.repeat(np.arange(len(legs)), [len(leg.table) for leg in flown])
    found = np.searchsorted(table_of_leg * far + table[:, 0], which * far + local, "right") - 1
    begin, w, q, c, s, v, a = table[found].T
    t = local - begin
    sine = np.sin(w * t)
    along = [s + t * (v + t * (a / 2 + t * c / 6)) + q * (t - sine / w)]
    if motion.shape[1] > 3:
        along.append(v + t * (a + t * c / 2) + q * (1 - np.cos(w * t)))
    if motion.shape[1] > 6:
        along.append(a + t * c + q * w * sine)
    steps = np.array([one.step for one in placed])
    directions = steps / np.array([[leg.length] for leg in flown])
    for axis in np.flatnonzero(directions.any(axis=0)):
        share = directions[which, axis]
        for kind, scalar in enumerate(along):
            motion[:, 3 * kind + axis] += np.bincount(sample, share * scalar, len(motion))


def _add_curved(
    motion: Real, clock: Real, under_way: slice, placed: PlacedLeg, leg: CurvedLeg
) -> None:
    """Add position and velocity under way on a spline leg."""
    local = clock[under_way] - placed.start
    kinds = [leg.curve.points - placed.origin]
    if motion.shape[1] > 3:
        kinds.append(leg.curve.tangents * leg.speeds[:, None])
    for kind, values in enumerate(kinds):
        for axis in range(3):
            motion[under_way, 3 * kind + axis] += np.interp(local, leg.times, values[:, axis])
