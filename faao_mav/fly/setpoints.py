"""Setpoints: a flight as a function of time, and the vehicle's own clock and frame for it."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import AutopilotFamily
from faao_mav.optimizer.solution import Solution
from faao_mav.plan.sections import Origin
from faao_mav.wire import messages
from faao_mav.wire.protocol import Address

_LOCAL_NED, _NO_YAW = 1, 1 << 10 | 1 << 11
"""MAV_FRAME_LOCAL_NED; and of POSITION_TARGET_TYPEMASK: yaw and yaw rate are ignored, all else
counts."""

_KEPT, _LONGEST, _ANOTHER_CLOCK = 9, 1.0, 60.0
"""How many round trips on the link are kept, one each half second, whose median counts; the most
that counts, s; and from how many seconds of the world on a time is one of another clock than the
answers'. Chosen."""


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
    """Pieces of constant acceleration, which begin at `t` (k,), s.

    When a piece begins the aircraft is at `p` (k, 3), m east, north, up, with the velocity `v`
    (k, 3), m/s; until the next it has the acceleration `a` (k, 3), m/s². In the last piece it
    stands still.

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
        for p, leg, (speed, push) in zip(
            corners[:-1], np.diff(corners, axis=0), limits, strict=True
        ):
            length = float(np.linalg.norm(leg))
            if length < 1e-6:
                continue
            along, top, v = leg / length, min(speed, (push * length) ** 0.5), rest
            ramp, even = top / push, length / top - top / push
            for lasting, a in ((ramp, push * along), (even, rest), (ramp, -push * along)):
                pieces.append((t, p, v, a))
                t, p, v = t + lasting, p + v * lasting + a * lasting**2 / 2, v + a * lasting
        pieces.append((t, corners[-1], rest, rest))
        return cls(*(np.array(column) for column in zip(*pieces, strict=True)))

    @classmethod
    def of(cls, solution: Solution) -> "Course":
        """Return the planned flight on the plan's clock, from rest to rest at the planned height.

        A flight that begins or ends at speed has a run-in before 0 s, or a run-out, on which it
        speeds up or slows down along that velocity by half of `vehicle.max_acceleration`.
        """
        flight, limit = solution.plan.flight, solution.plan.vehicle.max_acceleration / 2
        up, rest = [(0, 0), (0, 1)], np.zeros(3)
        w = np.pad(solution.w, up, constant_values=flight.altitude)
        v, a = np.pad(solution.v, up), np.pad(solution.a, up)
        run_in, run_out = (float(np.linalg.norm(v[n])) / limit for n in (0, -1))
        t = [float(solution.t[0]) - run_in, *solution.t, float(solution.t[-1]) + run_out]
        p = [w[0] - v[0] * run_in / 2, *w, w[-1] + v[-1] * run_out / 2]
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


class OwnClock:
    """What the answers to TIMESYNC tell; before the second one a round trip takes no time.

    Only those to own questions count: vehicles tell everybody what they answer to anybody.
    """

    def __init__(self) -> None:
        self._asked = deque[int](maxlen=_KEPT)
        self._trips = deque[float](maxlen=_KEPT)
        self._read = deque[tuple[float, float]](maxlen=_KEPT)
        """When we were in the middle of a short trip, and what the vehicle's clock read, s."""

    def ask(self, now: float) -> messages.Timesync:
        """Return the question, with the time `now` in it, which the answer repeats."""
        self._asked.append(int(now * 1e9))
        return messages.Timesync(0, self._asked[-1])

    def hear(self, answer: messages.Timesync, now: float) -> None:
        """Take note of an answer."""
        asked = answer.ts1 / 1e9
        if answer.tc1 and answer.ts1 in self._asked:
            self._trips.append(now - asked)
            if now - asked <= _LONGEST:
                self._read.append(((asked + now) / 2, answer.tc1 / 1e9))

    @property
    def speed(self) -> float:
        """How many seconds of the vehicle's clock a second of the world's has."""
        if len(self._read) < 2:
            return 1.0
        (begin, first), (end, last) = self._read[0], self._read[-1]
        return max((last - first) / max(end - begin, 1e-9), 1e-3)

    @property
    def lead(self) -> float:
        """How long a round trip takes, s of the vehicle's clock."""
        if len(self._trips) < 2:
            return 0.0
        return min(self.speed * median(self._trips), _LONGEST)

    def age(self, t: float, now: float) -> float:
        """Return how long ago, s of the world, the vehicle's clock read `t`, s; 0: not known."""
        if len(self._read) < 2:
            return 0.0
        middle, there = self._read[-1]
        age = now - middle + (there - t) / self.speed
        return age if 0 < age < _ANOTHER_CLOCK else 0.0


class OwnFrame:
    """The frame of an autopilot of `family`; `plan_origin` is the plan's, and the vehicle's home.

    `origin` is where its own frame has its origin, None until it tells. Heights are above home as
    the vehicle tells it, and once `home`, mm, is set above that: home may be set anew in flight,
    and the ground stays where it is.
    """

    def __init__(self, family: AutopilotFamily, plan_origin: Origin) -> None:
        self._family = family
        self._plans = plan_origin.frame
        self.origin: messages.GpsGlobalOrigin | None = None
        self.home: int | None = None

    def risen(self, position: messages.GlobalPositionInt) -> float:
        """Return by how many metres home is higher now than at the departure."""
        return (position.alt - position.relative_alt - self._home(position)) / 1000

    def _home(self, position: messages.GlobalPositionInt) -> int:
        return position.alt - position.relative_alt if self.home is None else self.home

    def place(self, position: messages.GlobalPositionInt) -> Real:
        """Return where it is: (3,) m east, north, up of the plan's origin, which is its home."""
        level = self._plans.to_local(position.lat / 1e7, position.lon / 1e7)
        return np.append(level, (position.alt - self._home(position)) / 1000)

    def message(
        self, setpoint: Setpoint, position: messages.GlobalPositionInt, target: Address
    ) -> messages.SetPositionTargetLocalNed:
        """Return `setpoint` for the vehicle `target` that has told its `position`."""
        assert self.origin is not None
        own = self._family.local_frame(self.origin.latitude / 1e7, self.origin.longitude / 1e7)
        p, v, a = setpoint
        east, north = own.to_local(*self._plans.to_geodetic(p[:2]))
        home = (self._home(position) - self.origin.altitude) / 1000
        values = (north, east, -(p[2] + home), v[1], v[0], -v[2], a[1], a[0], -a[2])
        return messages.SetPositionTargetLocalNed(
            target, position.time_boot_ms, _LOCAL_NED, _NO_YAW, *map(float, values)
        )
