"""How an ArduPlane flies a mission: from its documentation, not compared with flights."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.vehicle.ardupilot.plane.motion import Motion
from faao_mav.vehicle.ardupilot.plane.parameters import ArduPlaneLimits
from faao_mav.vehicle.flight_path import FlightPath, Flown


@dataclass(frozen=True, slots=True)
class ArduPlaneLegs(ArduPlaneLimits):
    """How ArduPlane flies a leg."""

    least: ClassVar[float] = 0.0
    slowest: ClassVar[float] = 0.1
    run_in: ClassVar[float] = 4.0  # chosen: room to come onto a track, whatever its course

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg flown at `speed`, m: one look-ahead; same shape."""
        return self.look_ahead * speed

    def reachable_speed(self, length: Real) -> Real:
        """Return the speed at which legs of `length`, m, are not cut short, m/s; same shape."""
        return length / self.look_ahead

    def radii(self, room: Real, turn: Real, stops: Flags) -> Real:  # noqa: ARG002
        """Return acceptance radii, m: 0, ArduPlane's own; the shape of `turn`."""
        return np.zeros_like(turn)


_HEADED = math.radians(10)
"""A loiter is left when the course is this close to the next waypoint."""


@dataclass(frozen=True, slots=True)
class ArduPlane(ArduPlaneLimits):
    """How ArduPlane flies plain waypoints in AUTO, without wind. Not calibrated against flights.

    After ArduPilot's documentation (Plane: navigation tuning, parameter list): lateral guidance
    `NAVL1` in coordinated turns within the roll limit, airspeed within AIRSPEED_MIN and
    AIRSPEED_MAX, heights along the leg within TECS_CLMB_MAX and, with an idling engine,
    TECS_SINK_MIN. A waypoint is reached within its acceptance radius or on passing the
    perpendicular through it. Where the waypoint gives no radius it is the least of WP_RADIUS and
    the guidance's look-ahead, for turns below 90 degrees in proportion to the turn. Holds are
    loiters: ArduPlane has no hold at a plain waypoint. Limits are SI, angles radians; a negative
    `loiter_radius` turns left.
    """

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        An aeroplane is never at rest: it starts over the first point at the first leg's speed and
        course. A hold counts from when the circle is reached, and ends when the course is within
        10 degrees of the next waypoint. Speeds of 0 or less mean `cruise_speed`.
        """
        flight = _Flight(self, path)
        return flight.flown(step)

    def airspeed(self, command: float) -> float:
        """Return the airspeed flown for a commanded one, m/s."""
        wanted = command if command > 0 else self.cruise_speed
        return min(max(wanted, self.min_speed), self.max_speed)


class _Flight:
    """One flight under way, its track kept step by step."""

    def __init__(self, plane: ArduPlane, path: FlightPath) -> None:
        self._plane, self._path = plane, path
        self._places = [complex(east, north) for east, north in path.points[:, :2]]
        speed = plane.airspeed(float(path.speeds[0]) if len(path.speeds) else 0.0)
        moves = [b - a for a, b in zip(self._places, self._places[1:], strict=False) if b != a]
        course = math.atan2(moves[0].imag, moves[0].real) if moves else math.pi / 2
        self._motion = Motion(plane, self._places[0], float(path.points[0, 2]), course, speed)
        self._track = [self._motion.sample()]

    def flown(self, step: float) -> Flown:
        count = len(self._places)
        arrivals, departures = np.zeros(count), np.zeros(count)
        for k in range(count):
            if k > 0:
                arrivals[k] = self._fly_leg(k)
            departures[k] = arrivals[k]
            if self._path.holds[k] > 0:
                began = self._circle(k)
                arrivals[k] = began if k > 0 else 0.0
                departures[k] = self._loiter(k, arrivals[k] + float(self._path.holds[k]))
        t = np.arange(math.ceil(departures[-1] / step - 1e-9) + 1, dtype=float) * step
        while self._motion.time < t[-1]:
            self._step_on(count - 1)
        return self._sampled(arrivals, departures, t)

    def _fly_leg(self, k: int) -> float:
        """Fly to point `k` and return when it is reached; a loiter's point is only approached."""
        if self._path.holds[k] > 0:
            return self._motion.time
        start, end = self._places[k - 1], self._places[k]
        length = abs(end - start)
        while True:
            radius = self._radius(k)
            passed = self._passed(start, end, length)
            near = radius - abs(end - self._motion.place)
            before = self._motion.time
            if max(passed, near) >= 0:
                return before
            self._step_on(k)
            after = max(
                self._passed(start, end, length), self._radius(k) - abs(end - self._motion.place)
            )
            if after >= 0:
                share = -max(passed, near) / (after - max(passed, near))
                return before + share * (self._motion.time - before)

    def _passed(self, start: complex, end: complex, length: float) -> float:
        """Return how far past the perpendicular through `end` the aircraft is, m."""
        if length == 0:
            return 0.0
        return ((self._motion.place - end) * (end - start).conjugate()).real / length

    def _radius(self, k: int) -> float:
        if self._path.radii[k] > 0:
            return float(self._path.radii[k])
        full = min(self._plane.waypoint_radius, self._motion.look_ahead())
        if k + 1 == len(self._places):
            return full
        here, onward = self._places[k] - self._places[k - 1], self._places[k + 1] - self._places[k]
        turn = abs(math.atan2((here.conjugate() * onward).imag, (here.conjugate() * onward).real))
        return full * min(turn / (math.pi / 2), 1.0)

    def _circle(self, k: int) -> float:
        """Fly to the circle about point `k` and return when it is reached."""
        while not self._step_round(k):
            pass
        return self._motion.time

    def _loiter(self, k: int, until: float) -> float:
        """Circle point `k` until the time is over and the course fits; return when that is.

        No course fits a next waypoint within the circle: the aircraft leaves when the time is over.
        """
        while self._motion.time < until - 1e-9:
            self._step_round(k)
        if k + 1 == len(self._places):
            return until
        onward = self._places[k + 1]
        if abs(onward - self._places[k]) > abs(self._motion.place - self._places[k]):
            full_turn = self._motion.course - math.copysign(2 * math.pi, self._plane.loiter_radius)
            while abs(self._motion.bearing_to(onward)) > _HEADED and (
                (self._motion.course - full_turn) * self._plane.loiter_radius > 0
            ):
                self._step_round(k)
        return max(until, self._motion.time)

    def _step_on(self, k: int) -> None:
        """Go on by one step along the leg that ends at point `k`."""
        if k == 0 or self._path.holds[k] > 0:
            self._step_round(k)
            return
        begin, end = self._path.points[k - 1], self._path.points[k]
        speed = self._plane.airspeed(float(self._path.speeds[k - 1]))
        self._motion.along(
            self._places[k - 1], self._places[k], (float(begin[2]), float(end[2])), speed
        )
        self._track.append(self._motion.sample())

    def _step_round(self, k: int) -> bool:
        """Go on by one step round point `k` and return whether the circle is being flown."""
        command = self._path.speeds[max(k - 1, 0)] if len(self._path.speeds) else 0.0
        circling = self._motion.round(
            self._places[k],
            self._plane.loiter_radius,
            float(self._path.points[k, 2]),
            self._plane.airspeed(float(command)),
        )
        self._track.append(self._motion.sample())
        return circling

    def _sampled(self, arrivals: Real, departures: Real, t: Real) -> Flown:
        track = np.array(self._track)
        columns = [np.interp(t, track[:, 0], column) for column in track[:, 1:].T]
        return Flown(
            arrivals, departures, t, np.stack(columns[:3], axis=-1), np.stack(columns[3:], axis=-1)
        )
