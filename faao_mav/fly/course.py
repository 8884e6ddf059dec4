"""A flight as a function of time: what a stream of setpoints has the aircraft follow."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.solution import Solution


class Setpoint(NamedTuple):
    """Position, m, velocity, m/s, and acceleration, m/s², each (3,) east, north, up."""

    position: Real
    velocity: Real
    acceleration: Real


def at_rest(place: Real) -> Setpoint:
    """Return the setpoint of an aircraft that stays at `place` (3,), m."""
    return Setpoint(place, np.zeros(3), np.zeros(3))


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Pieces of constant acceleration: from `t` (k,), s, on the aircraft flies by `start` and `a`.

    It is at `p` (k, 3), m east, north, up, with the velocity `v` (k, 3), m/s, when a piece begins,
    and has the acceleration `a` (k, 3), m/s², until the next. In the last piece it stands still.

    >>> course = Course.through([[0, 0, 10], [20, 0, 10]], [(4.0, 2.0)])
    >>> course.end
    7.0
    >>> course.at(3.0).position.tolist(), course.at(3.0).velocity.tolist()
    ([8.0, 0.0, 10.0], [4.0, 0.0, 0.0])
    """

    t: Real
    p: Real
    v: Real
    a: Real

    @classmethod
    def through(
        cls, places: Sequence[Sequence[float]] | Real, limits: Sequence[tuple[float, float]]
    ) -> "Course":
        """Return the quickest flight from rest to rest along each of the legs between `places`.

        They are (k, 3), m; a leg has `limits` of speed, m/s, and acceleration, m/s². It begins at
        0 s.
        """
        corners, rest = np.asarray(places, dtype=float), np.zeros(3)
        t, pieces = 0.0, list[tuple[float, Real, Real, Real]]()
        for start, leg, (speed, push) in zip(
            corners[:-1], np.diff(corners, axis=0), limits, strict=True
        ):
            length = float(np.linalg.norm(leg))
            if length < 1e-6:
                continue
            along, top = leg / length, min(speed, (push * length) ** 0.5)
            ramp, even = top / push, length / top - top / push
            early = start + along * top * ramp / 2
            late = early + along * top * even
            pieces += [
                (t, start, rest, push * along),
                (t + ramp, early, top * along, rest),
                (t + ramp + even, late, top * along, -push * along),
            ]
            t += 2 * ramp + even
        pieces.append((t, corners[-1], rest, rest))
        return cls(*(np.array(column) for column in zip(*pieces, strict=True)))

    @classmethod
    def of(cls, solution: Solution) -> "Course":
        """Return the planned flight on the plan's clock, from rest to rest at the planned height.

        A flight that begins or ends at speed has a run-in before 0 s, or a run-out, on which it
        speeds up or slows down along that velocity by half of `vehicle.max_acceleration`.
        """
        flight, limit = solution.plan.flight, solution.plan.vehicle.max_acceleration / 2
        slots = len(solution.t)
        level = np.full((slots, 1), flight.altitude), np.zeros((slots, 1)), np.zeros((slots, 1))
        w, v, a = (
            np.hstack([each, up])
            for each, up in zip((solution.w, solution.v, solution.a), level, strict=True)
        )
        run_in, run_out = (float(np.linalg.norm(v[n])) / limit for n in (0, -1))
        t = [float(solution.t[0]) - run_in, *solution.t, float(solution.t[-1]) + run_out]
        p = [w[0] - v[0] * run_in / 2, *w, w[-1] + v[-1] * run_out / 2]
        rest = np.zeros(3)
        pushes = [v[0] / max(run_in, 1e-9), *a[:-1], -v[-1] / max(run_out, 1e-9), rest]
        return cls(np.array(t), np.array(p), np.array([rest, *v, rest]), np.array(pushes))

    @property
    def begin(self) -> float:
        """When it begins, s."""
        return float(self.t[0])

    @property
    def end(self) -> float:
        """From when on it stands still, s."""
        return float(self.t[-1])

    def at(self, time: float) -> Setpoint:
        """Return where the aircraft is to be at `time`, s; before it begins, at rest there."""
        k = int(np.searchsorted(self.t, time, side="right")) - 1
        if k < 0:
            return at_rest(self.p[0])
        p, v, a, since = self.p[k], self.v[k], self.a[k], time - float(self.t[k])
        return Setpoint(p + v * since + a * since**2 / 2, v + a * since, a)
