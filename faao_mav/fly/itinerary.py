"""A streamed flight from the ground to its end: which setpoint is due where and when."""

from collections.abc import Callable
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.fly.course import Course, Setpoint, at_rest
from faao_mav.fly.gate import CLIMB, NEAR, Gate
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.transit import way_between, way_home, way_out

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


class Itinerary:
    """The flight of `solution` in parts, on the vehicle's clock; `tell` is told what happens.

    The parts: "take-off", which a vehicle that `takes_off` does by itself; "out" around the fence
    to where the relay flight begins, and a rest there; "relay"; "back" around the fence, until the
    way home is straight; "over". `relay_start` is when the plan's clock reads 0, None before that.

    All but the relay flight waits for the aircraft. One that `gate` does not let follow its part is
    led to it on a way of its own: up or down to the plan's height, and inside the fence to where
    the part ends, or meets the plan, which goes on meanwhile. `trouble` is why it cannot be led,
    None while it can.

    Raises `InfeasibleError` where the flight would leave the plan's fence.
    """

    def __init__(
        self, solution: Solution, gate: Gate, tell: Callable[[str], object], *, takes_off: bool
    ) -> None:
        plan = solution.plan
        self._plan, self._gate, self._tell, self._takes_off = plan, gate, tell, takes_off
        self.relay = Course.of(solution)
        first, last = self.relay.p[[0, -1]]
        if plan.keep_in is not None and not plan.keep_in.covers_path(self.relay.p[:, :2]):
            raise InfeasibleError(
                "the streamed flight leaves the plan's fence where it speeds up before flight.start"
                " or slows down after flight.end: give hover for both, or move them"
            )
        way_out(plan, first[:2])  # raises
        home = np.vstack([last[:2], way_home(plan, last[:2])])
        self._ends = {"out": first, "back": self._high(home)[-1]}
        self.part: Part = "take-off"
        self.relay_start: float | None = None
        self.trouble: str | None = None
        self._time: float | None = None
        self._led, self._meets = False, 0.0
        self._follow(None, 0.0)

    def setpoint(self, t: float, place: Real, velocity: Real) -> Setpoint | None:
        """Return where an aircraft at `place` (3,), m, is to be at `t`, s; None: nowhere.

        `velocity` (3,) is in m/s; all are east, north and up of the plan's origin.
        """
        passed = 0.0 if self._time is None else t - self._time
        self._time = t
        low = place[2] < self._plan.flight.altitude - _BELOW
        match self.part:
            case "take-off" if self._takes_off and (low or abs(velocity[2]) >= _LEVEL):
                return None
            case "take-off":
                self._enter("out", t, place)
            case "out" if self._rests(t, place, velocity):
                self.relay_start = t - self.relay.begin
                self._enter("relay", t, place)
            case "relay" if self._plans(t) >= max(self.relay.end, self._plan.flight.duration):
                self._enter("back", t, self.relay.p[-1])
            case "back" if self._arrived is not None and (
                np.linalg.norm(place - self._ends["back"]) <= NEAR or self._is_late(t)
            ):
                self.part = "over"
                self._tell(_TOLD["over"])
        return self._on_plan(t, place) or self._on_way(t, place, passed)

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
        self._course, self._gone = way, 0.0
        self._settled: float | None = None
        self._arrived: float | None = None
        if not self._led:
            self._until = t + _STUCK + (0.0 if way is None else 2 * way.end)

    def _on_plan(self, t: float, place: Real) -> Setpoint | None:
        """Return where the plan has it at `t`; None where it may not be sent there."""
        if self.part != "relay":
            return None
        setpoint = self.relay.at(self._plans(t))
        if not self._gate.passes(t, place, setpoint):
            return None
        self._led = False
        if self._course is not None:
            self._tell("it is on its plan again")
            self._follow(None, t)
        return setpoint

    def _on_way(self, t: float, place: Real, passed: float) -> Setpoint | None:
        """Return where it is to be on its way, `passed` s later than before, or on a new one."""
        way, ahead = self._course, self._gone + passed
        missed = self.part == "relay" and self._plans(t) > self._meets + _MISSED
        if way is not None and not missed:
            if self._gate.passes(t, place, way.at(ahead)):
                self._gone = ahead
                if ahead >= way.end:
                    self._arrived, self._led = self._arrived or t, False
                return way.at(ahead)
            waiting = at_rest(way.at(self._gone).position)
            if t < self._until and self._gate.passes(t, place, waiting):
                return waiting
        return self._led_back(t, place)

    def _led_back(self, t: float, place: Real) -> Setpoint | None:
        """Return the beginning of a new way to the present part; None, and why, without one."""
        if place[2] < _GROUNDED:
            self.trouble = "it has come down to the ground"
        elif self._course is not None and t >= self._until and self._arrived is None:
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
            return self._way_to(place, self._ends["out" if self.part == "out" else "back"])
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

    def _high(self, corners: Real) -> Real:
        """Return `corners` (k, 2) at the plan's height."""
        return np.column_stack([corners, np.full(len(corners), self._plan.flight.altitude)])

    def _way_to(self, place: Real, end: Real) -> Course | None:
        """Return the way from `place` (3,) to `end` (3,) inside the fence; None: there is none.

        It leads up or down to the plan's height first.
        """
        corners = way_between(self._plan, place[:2], end[:2])
        if corners is None:
            return None
        limits = self._speed, self._plan.vehicle.max_acceleration
        places = np.vstack([place, self._high(corners)])
        return Course.through(places, [CLIMB, *[limits] * (len(corners) - 1)])

    @property
    def _speed(self) -> float:
        """The speed of ways, m/s: the plan's, or what the wind leaves of it."""
        calm = self._plan.max_airspeed - self._plan.site.wind.speed
        return max(_LEAST, min(self._plan.vehicle.max_speed, calm))

    def _rests(self, t: float, place: Real, velocity: Real) -> bool:
        """Tell whether the aircraft rests where the relay flight begins, or takes too long."""
        away, speed = np.linalg.norm(place - self._ends["out"]), np.linalg.norm(velocity)
        if self._arrived is None or away > _SETTLED or speed > _STILL:
            self._settled = None
        else:
            self._settled = self._settled or t
        return (self._settled is not None and t >= self._settled + _REST) or self._is_late(t)

    def _is_late(self, t: float) -> bool:
        """Tell whether it has been at the end of its way for longer than it should take."""
        return self._arrived is not None and t >= self._arrived + _UNSETTLED
