"""A streamed flight from the ground to its end: which setpoint is due, and whether it may be sent.

The `Gate` of all setpoints says where an aircraft can be, and where it may be sent to from there.
The `Itinerary` asks it about each.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.schedule.assemble import way_between, way_home, way_out

NEAR, LEVEL = 2.0, 1.0
"""Metres across and up within which an aircraft is on course; chosen: a stream that nothing
disturbs keeps its plan to 0.5 m rms in the simulators."""

CLIMB = 2.0, 1.0
"""The speed, m/s, and acceleration, m/s², of a climb by setpoints; chosen: below all defaults."""

_AROUND, _QUICKER, _BORNE = 2.0, 2.0, 3.0
"""A place may be so many metres farther from the last one than the aircraft flies meanwhile at so
many times the plan's top speed: a failsafe may fly faster than the plan, a wind carry it. Places
are doubted for so many seconds until they are given up. Chosen."""

_MOVES, _STANDS = 0.5, 1.0
"""An aircraft that tells at least so many m/s cannot be at the same place for so many seconds, to
the last digit. Chosen."""

Part: TypeAlias = Literal["take-off", "out", "relay", "back", "over"]

_TOLD = {
    "out": "on the way to flight.start",
    "relay": "the relay flight begins",
    "back": "the relay flight is over",
    "over": "setpoints end",
}

_BELOW, _LEVEL = 1.0, 0.5
"""A take-off is over from so many metres below the planned height on, when it climbs slower than so
many m/s. Chosen."""

_SETTLED, _STILL, _REST, _UNSETTLED = 0.6, 0.15, 2.0, 30.0
"""The relay flight begins when the aircraft has been within so many metres of its beginning, slower
than so many m/s, for so many seconds: it then keeps the plan to 0.4 m rms in the simulator. It
begins all the same after so many seconds there, as in gusts; chosen."""

_LEAST, _GROUNDED = 1.0, 0.5
"""The least speed, m/s, of ways by setpoints, whatever the wind; and metres above home below which
an aircraft is not taken off again. Chosen."""

_STUCK, _MISSED = 60.0, 2.0
"""Seconds for which an aircraft may be on its way longer than twice what that takes, led to it anew
or not, until it is given up; and after which the plan has passed by where it was to be met. Chosen.
"""


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


class Gate:
    """The gate of the setpoints for a flight of `plan`: see `believes` and `passes`.

    Times are the vehicle's. `tell` is told when a place is doubted, and believed again.
    """

    def __init__(self, plan: Plan, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._fence, self._speed = plan.keep_in, plan.max_ground_speed
        self._acceleration = plan.vehicle.max_acceleration
        self._on_course: float | None = None
        self._last: tuple[float, Real] | None = None
        self._jumped_from: tuple[float, Real] | None = None
        self._moved, self._doubted_since = 0.0, math.inf
        self.has_lost_it = False
        """Whether its places have been doubted for too long."""

    def passes(self, t: float, place: Real, setpoint: Setpoint) -> bool:
        """Tell whether an aircraft at `place` (3,), m, at `t`, s, may be sent to `setpoint`.

        It may be within `NEAR` and `LEVEL` of it, or off by as much more as it can have fallen
        behind since it last was; the straight way there has to keep inside the fence.
        """
        off = setpoint.position - place
        across, up = math.hypot(off[0], off[1]), abs(float(off[2]))
        if self._on_course is None or (across <= NEAR and up <= LEVEL):
            self._on_course = t
        since = t - self._on_course
        far = NEAR + _lag(since, self._speed, self._acceleration)
        if across > far or up > LEVEL + _lag(since, *CLIMB):
            return False
        straight = np.array([place[:2], setpoint.position[:2]])
        return across <= NEAR or self._fence is None or self._fence.covers_path(straight)

    def believes(self, t: float, place: Real, velocity: Real) -> bool:
        """Tell whether it can be at `place` (3,), m, with `velocity` (3,), m/s, at `t`, s.

        After a jump it is doubted until it jumps back; so is one that moves and stays where it is.
        """
        last, self._last = self._last, (t, place)
        if last is None or np.linalg.norm(velocity) < _MOVES or (place != last[1]).any():
            self._moved = t
        if last is not None and self._jumps(last, t, place):
            if self._jumped_from is None:
                self._jumped_from = last
            elif not self._jumps(self._jumped_from, t, place):
                self._jumped_from = None
        stands = t - self._moved >= _STANDS
        doubted = stands or self._jumped_from is not None
        if doubted and self._doubted_since == math.inf:
            self._doubted_since = t
            why = "does not change, though it moves" if stands else "has jumped"
            self._tell(f"its place {why}: no setpoints are sent")
        elif not doubted and self._doubted_since < math.inf:
            self._doubted_since = math.inf
            self._tell("its place is believed again")
        self.has_lost_it = t >= self._doubted_since + _BORNE
        return not doubted

    def _jumps(self, before: tuple[float, Real], t: float, place: Real) -> bool:
        within = _AROUND + _QUICKER * self._speed * (t - before[0])
        return float(np.linalg.norm(place - before[1])) > within


def _lag(seconds: float, speed: float, acceleration: float) -> float:
    """Return the greatest lag, m, of an aircraft that was on course so many seconds ago.

    One that stays where it is falls behind by at most the speed; one that follows from rest, by
    the way that it takes to be as fast.
    """
    return min(speed * max(seconds, 0.0), speed**2 / (2 * acceleration))


class Itinerary:
    """The flight of `solution` in parts, on the vehicle's clock; `tell` is told what happens.

    The parts: "take-off", which a vehicle that `takes_off` does by itself; "out" around the fence
    to where the relay flight begins, and a rest there; "relay"; "back" around the fence, until the
    way home is straight; "over". `relay_start` is when the plan's clock reads 0, None before that.

    All but the relay flight waits for the aircraft. One that the `gate` does not let follow it is
    led to it on a way of its own: up or down to the plan's height, and inside the fence to where
    the part ends, or meets the plan, which goes on meanwhile. `trouble` is why it cannot be led,
    None while it can.

    Raises `InfeasibleError` where the flight would leave the plan's fence.
    """

    def __init__(
        self, solution: Solution, tell: Callable[[str], object], *, takes_off: bool
    ) -> None:
        plan = solution.plan
        self._plan, self._tell, self._takes_off = plan, tell, takes_off
        self.gate = Gate(plan, tell)
        self.relay = Course.of(solution)
        first, last = self.relay.p[[0, -1]]
        if plan.keep_in is not None and not plan.keep_in.covers_path(self.relay.p[:, :2]):
            where = "where it speeds up before flight.start or slows down after flight.end"
            do = "give hover for both, or move them"
            raise InfeasibleError(f"the streamed flight leaves the plan's fence {where}: {do}")
        way_out(plan, first[:2])  # raises
        home = np.vstack([last[:2], way_home(plan, last[:2])])
        end = np.append(home[-1], plan.flight.altitude)
        self._ends: dict[Part, Real] = {"out": first, "back": end, "over": end}
        calm = plan.max_airspeed - plan.site.wind.speed
        self._speed = max(_LEAST, min(plan.vehicle.max_speed, calm))
        self.part: Part = "take-off"
        self.relay_start: float | None = None
        self.trouble: str | None = None
        self._time = math.nan
        self._settled: float | None = None
        self._led, self._meets = False, 0.0
        self._follow(None, 0.0)

    def setpoint(self, t: float, place: Real, velocity: Real) -> Setpoint | None:
        """Return where an aircraft at `place` (3,), m, is to be at `t`, s; None: nowhere.

        `velocity` (3,) is in m/s; all are east, north and up of the plan's origin.
        """
        passed, self._time = 0.0 if math.isnan(self._time) else t - self._time, t
        low = place[2] < self._plan.flight.altitude - _BELOW
        late = self._arrived is not None and t >= self._arrived + _UNSETTLED
        away, speed = np.linalg.norm(place - self._ends["out"]), np.linalg.norm(velocity)
        rests = self._arrived is not None and away <= _SETTLED and speed <= _STILL
        self._settled = (self._settled or t) if rests else None
        match self.part:
            case "take-off" if self._takes_off and (low or abs(velocity[2]) >= _LEVEL):
                return None
            case "take-off":
                self._enter("out", t, place)
            case "out" if late or (self._settled is not None and t >= self._settled + _REST):
                self.relay_start = t - self.relay.begin
                self._enter("relay", t, place)
            case "relay" if self._plans(t) >= max(self.relay.end, self._plan.flight.duration):
                self._enter("back", t, self.relay.p[-1])
            case "back" if self._arrived is not None and (
                late or np.linalg.norm(place - self._ends["back"]) <= NEAR
            ):
                self.part = "over"
                self._tell(_TOLD["over"])
        return self._followed(t, place, passed) or self._led_back(t, place)

    def _plans(self, t: float) -> float:
        """Return what the plan's clock reads at `t`, s."""
        assert self.relay_start is not None
        return t - self.relay_start

    def _enter(self, part: Part, t: float, begin: Real) -> None:
        """Begin a part, with its way from where it begins."""
        self.part, self._led = part, False
        self._tell(_TOLD[part])
        end = self._ends.get(part)
        self._follow(None if end is None else self._way_to(begin, end), t)

    def _follow(self, way: Course | None, t: float) -> None:
        """Follow `way` from its beginning; None: the plan."""
        self._way, self._gone = way, 0.0
        self._arrived: float | None = None
        if not self._led:
            self._until = t + _STUCK + (0.0 if way is None else 2 * way.end)

    def _followed(self, t: float, place: Real, passed: float) -> Setpoint | None:
        """Return where the plan has it at `t`, or else its way, on which it is `passed` s later.

        Where it may not be sent on, it waits on its way; None where it may not be sent there.
        """
        if self.part == "relay":
            setpoint = self.relay.at(self._plans(t))
            if self.gate.passes(t, place, setpoint):
                self._led = False
                if self._way is not None:
                    self._tell("it is on its plan again")
                    self._follow(None, t)
                return setpoint
        way, ahead = self._way, self._gone + passed
        if way is None or (self.part == "relay" and self._plans(t) > self._meets + _MISSED):
            return None
        if self.gate.passes(t, place, way.at(ahead)):
            self._gone = ahead
            if ahead >= way.end:
                self._arrived, self._led = self._arrived or t, False
            return way.at(ahead)
        waiting = at_rest(way.at(self._gone).position)
        return waiting if t < self._until and self.gate.passes(t, place, waiting) else None

    def _led_back(self, t: float, place: Real) -> Setpoint | None:
        """Return the beginning of a new way to the present part; None, and why, without one."""
        if place[2] < _GROUNDED:
            self.trouble = "it has come down to the ground"
        elif self._way is not None and t >= self._until and self._arrived is None:
            self.trouble = "it does not follow"
        elif (way := self._leading(t, place)) is None:
            self.trouble = "no way inside the fence leads it back"
        else:
            if not self._led:
                self._tell("it is off its flight, and led back to it")
            self._follow(way, t)
            self._led = True
            return way.at(0.0)
        return None

    def _leading(self, t: float, place: Real) -> Course | None:
        """Return a way to the end of the part, or to the plan, that is there no sooner; or None."""
        if self.part != "relay":
            return self._way_to(place, self._ends[self.part])
        now = self._meets = self._plans(t)
        while self._meets < self.relay.end:
            meeting = self.relay.at(self._meets).position
            soonest = now + float(np.linalg.norm((meeting - place)[:2])) / self._speed
            if soonest <= self._meets:
                way = self._way_to(place, meeting)
                if way is None or now + way.end <= self._meets:
                    return way
                soonest = now + way.end
            self._meets = max(self._meets + 1.0, soonest)
        self._meets = self.relay.end
        return self._way_to(place, self.relay.p[-1])

    def _way_to(self, place: Real, end: Real) -> Course | None:
        """Return the way from `place` (3,) to `end` (3,) inside the fence; None: there is none.

        It leads up or down to the plan's height first, at the plan's speed then, or at what the
        wind leaves of it.
        """
        corners = way_between(self._plan, place[:2], end[:2])
        if corners is None:
            return None
        high = np.column_stack([corners, np.full(len(corners), self._plan.flight.altitude)])
        limits = self._speed, self._plan.vehicle.max_acceleration
        return Course.through(np.vstack([place, high]), [CLIMB, *[limits] * (len(corners) - 1)])
