"""How an ArduPlane flies a mission."""

import cmath
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.plane.motion import STEP, Motion, Track
from faao_mav.autopilot.ardupilot.plane.parameters import ArduPlaneLimits
from faao_mav.autopilot.atmosphere import density_ratio
from faao_mav.autopilot.flight_path import FlightPath, Flown
from faao_mav.errors import InputError


@dataclass(frozen=True, slots=True)
class ArduPlaneLegs(ArduPlaneLimits):
    """How ArduPlane flies a leg."""

    least: ClassVar[float] = 0.0
    slowest: ClassVar[float] = 0.1
    run_in: ClassVar[float] = 8.0  # with 4 missions were still 5 m off their track at w_I

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

_NOTICED = 0.05
"""How long after it is passed a waypoint counts as reached, s. Fitted to the flights that the
airframe is, and to eleven of missions that circle: with 0.12 these were flown up to 2 m inside."""


@dataclass(frozen=True, slots=True)
class ArduPlane(ArduPlaneLimits):
    """How ArduPlane flies plain waypoints in AUTO, in a steady wind.

    After ArduPilot's documentation (Plane: navigation tuning, parameter list), with constants from
    flights of its simulator: lateral guidance `NAVL1` within the roll limit, airspeed and height by
    total energy control. A waypoint is reached within its acceptance radius or on passing the
    perpendicular through it. Where the waypoint gives no radius it is the least of WP_RADIUS, over
    the density's ratio, and the guidance's look-ahead, for turns below 90 degrees in proportion to
    the turn. Commanded speeds are equivalent airspeeds. Holds are loiters: ArduPlane has no hold at
    a plain waypoint. Limits are SI, angles radians; a negative `loiter_radius` turns left.
    """

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        An aeroplane is never at rest: it starts over the first point at the path's `entry`
        velocity, as after a take-off, and then flies straight to the second point; without one, at
        the first leg's speed and course. A hold counts from when the circle is reached, and ends
        when the course is within 10 degrees of the next waypoint. Speeds of 0 or less mean
        `cruise_speed`.

        Raises `InputError` for a flight that takes more than `path.longest`, as in a wind that
        carries it away.
        """
        return _Flight(self, path).flown(step)


class _Flight:
    """One flight under way, its track kept step by step."""

    def __init__(self, plane: ArduPlane, path: FlightPath) -> None:
        self._plane, self._path = plane, path
        self._places = [complex(east, north) for east, north in path.points[:, :2].tolist()]
        self._heights, self._holds = path.points[:, 2].tolist(), path.holds.tolist()
        ends = zip(pairwise(self._places), pairwise(self._heights), strict=True)
        self._tracks = [Track(*places, *heights) for places, heights in ends]
        altitude = path.elevation + max(self._heights)
        commands = path.speeds.tolist() or [0.0]
        self._speeds = [plane.true_airspeed(command, altitude) for command in commands]
        self._full_radius = plane.waypoint_radius / density_ratio(altitude)
        height = self._heights[0]
        wind, climb, demanded = complex(*path.wind), 0.0, None
        if path.entry is None:
            moves = [b - a for a, b in pairwise(self._places) if b != a]
            airspeed = _headed(moves[0] if moves else 1j, self._speeds[0], wind)
        else:
            east, north, climb = path.entry.tolist()
            airspeed, demanded = complex(east, north) - wind, plane.true_airspeed(0.0, altitude)
        self._motion = Motion(
            plane, altitude, self._places[0], height, airspeed, climb, speed=demanded, wind=wind
        )
        self._track = [self._motion.sample()]

    def flown(self, step: float) -> Flown:
        count = len(self._places)
        arrivals, departures = np.zeros(count), np.zeros(count)
        for k in range(count):
            if k > 0:
                arrivals[k] = self._fly_leg(k)
            departures[k] = arrivals[k]
            if self._holds[k] > 0:
                began = self._circle(k)
                arrivals[k] = began if k > 0 else 0.0
                departures[k] = self._loiter(k, arrivals[k] + self._holds[k])
        t = np.arange(math.ceil(departures[-1] / step - 1e-9) + 1, dtype=float) * step
        while self._motion.time < t[-1]:
            self._step_on(count - 1, STEP)
        return self._sampled(arrivals, departures, t)

    def _fly_leg(self, k: int) -> float:
        """Fly to point `k` and return when it is reached; a loiter's point is only approached."""
        motion = self._motion
        if self._holds[k] > 0:
            return motion.time
        turn, given = self._turn(k), float(self._path.radii[k])
        before = self._beyond(k, turn, given)
        due = motion.time + _NOTICED if before >= 0 else math.inf
        while motion.time < due - 1e-9:
            step = min(STEP, due - motion.time)
            self._step_on(k, step)
            if due == math.inf and (after := self._beyond(k, turn, given)) >= 0:
                due = motion.time - step * after / (after - before) + _NOTICED
            elif due == math.inf:
                before = after
        return due

    def _beyond(self, k: int, turn: float, given: float) -> float:
        """Return how far beyond where point `k` is reached the aircraft is, m, below 0 before it.

        `turn` is the angle there over 90 degrees, at most 1; `given` is the acceptance radius, m,
        or 0.
        """
        motion = self._motion
        radius = given if given > 0 else min(self._full_radius, motion.look_ahead) * turn
        passed = self._tracks[k - 1].passed(motion.place)
        return max(passed, radius - abs(motion.place - self._places[k]))

    def _turn(self, k: int) -> float:
        if k + 1 == len(self._places):
            return 1.0
        here, onward = self._places[k] - self._places[k - 1], self._places[k + 1] - self._places[k]
        return min(abs(cmath.phase(here.conjugate() * onward)) / (math.pi / 2), 1.0)

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
            full_turn = self._motion.heading - math.copysign(2 * math.pi, self._plane.loiter_radius)
            while abs(self._motion.bearing_to(onward)) > _HEADED and (
                (self._motion.heading - full_turn) * self._plane.loiter_radius > 0
            ):
                self._step_round(k)
        return max(until, self._motion.time)

    def _step_on(self, k: int, step: float) -> None:
        """Go on by `step` seconds along the leg that ends at point `k`."""
        if k == 0 or self._holds[k] > 0:
            self._step_round(k)
            return
        if k == 1 and self._path.entry is not None:
            self._motion.towards(self._places[1], self._heights[1], self._speeds[0], step)
        else:
            self._motion.along(self._tracks[k - 1], self._speeds[k - 1], step)
        self._keep()

    def _step_round(self, k: int) -> bool:
        """Go on by one step round point `k` and return whether the circle is being flown."""
        speed = self._speeds[max(k - 1, 0)]
        circling = self._motion.round(self._places[k], self._heights[k], speed, STEP)
        self._keep()
        return circling

    def _keep(self) -> None:
        """Keep where the aircraft is now."""
        if self._motion.time > self._path.longest:
            raise InputError(
                f"the flight would take more than {self._motion.time:.0f} s, perhaps for the wind"
            )
        self._track.append(self._motion.sample())

    def _sampled(self, arrivals: Real, departures: Real, t: Real) -> Flown:
        track = np.array(self._track)
        columns = [np.interp(t, track[:, 0], column) for column in track[:, 1:].T]
        return Flown(
            arrivals, departures, t, np.stack(columns[:3], axis=-1), np.stack(columns[3:], axis=-1)
        )


def _headed(course: complex, speed: float, wind: complex) -> complex:
    """Return the velocity through the air that leads along `course` at an airspeed of `speed`, m/s.

    In a `wind` across that is stronger, the aircraft heads against it.
    """
    along = course / abs(course)
    across = (wind * along.conjugate()).imag
    against = math.asin(min(max(across / speed, -1.0), 1.0))
    return along * cmath.rect(speed, -against)
