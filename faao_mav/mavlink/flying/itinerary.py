"""A streamed flight from the ground to its end: which setpoint is due where and when."""

import math
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.mavlink.flying.course import Course, Setpoint
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.transit import way_home, way_out

Part: TypeAlias = Literal["take-off", "out", "relay", "back", "over"]

_BELOW, _LEVEL = 1.0, 0.5
"""A take-off is over from so many metres below the planned height on, when it climbs slower than so
many m/s. Chosen."""

_NEAR, _STILL, _REST = 0.6, 0.15, 2.0
"""The relay flight begins when the aircraft has been within so many metres of its beginning, slower
than so many m/s, for so many seconds: it then keeps the plan to 0.4 m rms in the simulator."""

_UNSETTLED = 30.0
"""Seconds after which it begins all the same, as in gusts; chosen."""

_CLIMB, _CLIMB_ACCELERATION = 2.0, 1.0
"""The speed, m/s, and acceleration, m/s², of a climb by setpoints; chosen: below all defaults."""

_LEAST = 1.0
"""The least speed, m/s, of the ways out and home, whatever the wind; chosen."""


class Itinerary:
    """The flight of `solution` in parts, on the vehicle's clock.

    The parts: "take-off", which a vehicle that `takes_off` does by itself; "out" around the fence
    to where the relay flight begins, and a rest there; "relay"; "back" around the fence, until the
    way home is straight; "over". `relay_start` is when the plan's clock reads 0, None before that.
    Raises `InfeasibleError` where the flight would leave the plan's fence.
    """

    def __init__(self, solution: Solution, *, takes_off: bool) -> None:
        plan = solution.plan
        self._plan, self._takes_off = plan, takes_off
        self.relay = Course.of(solution)
        self._first = self.relay.p[0]
        self._corners, back = (
            np.column_stack([way, np.full(len(way), plan.flight.altitude)])
            for way in (
                way_out(plan, self._first[:2]),
                way_home(plan, self.relay.p[-1, :2]),
            )
        )
        self._back = self._way(self.relay.p[-1], *back)
        path = np.vstack([np.zeros(3), *self._corners, self.relay.p, *back])[:, :2]
        if plan.keep_in is not None and not plan.keep_in.covers_path(path):
            raise InfeasibleError(
                "the streamed flight leaves the plan's fence where it speeds up before flight.start"
                " or slows down after flight.end: give hover for both, or move them"
            )
        self.part: Part = "take-off"
        self.relay_start: float | None = None
        self._course, self._begun = self._back, math.inf
        self._settled: float | None = None

    def setpoint(self, t: float, place: Real, velocity: Real) -> Setpoint | None:
        """Return where an aircraft at `place` (3,), m, is to be at `t`, s; None: it takes off.

        `velocity` (3,) is in m/s; all are east, north and up of the plan's origin.
        """
        height = self._plan.flight.altitude
        since = t - self._begun
        match self.part:
            case "take-off" if not self._takes_off or (
                place[2] > height - _BELOW and abs(velocity[2]) < _LEVEL
            ):
                up = np.array([*place[:2], height])
                leg, steep = np.array([place, up]), _CLIMB_ACCELERATION
                climb = Course.through(leg, speed=_CLIMB, acceleration=steep)
                way = self._way(up, *self._corners, self._first)
                self._begin("out", climb.then(way), t)
            case "take-off":
                return None
            case "out" if since >= self._course.end and self._rests(t, place, velocity):
                self._begin("relay", self.relay, t)
                self.relay_start = self._begun
            case "relay" if since >= max(self._course.end, self._plan.flight.duration):
                self._begin("back", self._back, t)
        if self.part == "back" and t - self._begun >= self._course.end:
            self.part = "over"
        return self._course.at(t - self._begun)

    def _begin(self, part: Part, course: Course, t: float) -> None:
        self.part, self._course, self._begun = part, course, t - course.begin

    def _way(self, *places: Real) -> Course:
        plan = self._plan
        calm = plan.max_airspeed - plan.site.wind.speed
        speed = max(_LEAST, min(plan.vehicle.max_speed, calm))
        return Course.through(
            np.array(places), speed=speed, acceleration=plan.vehicle.max_acceleration
        )

    def _rests(self, t: float, place: Real, velocity: Real) -> bool:
        """Tell whether the aircraft rests where the relay flight begins, or takes too long."""
        away, speed = np.linalg.norm(place - self._first), np.linalg.norm(velocity)
        if away > _NEAR or speed > _STILL:
            self._settled = None
        elif self._settled is None:
            self._settled = t
        rested = self._settled is not None and t >= self._settled + _REST
        return rested or t >= self._begun + self._course.end + _UNSETTLED
