"""ArduCopter as a flight model."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.errors import InputError
from faao_mav.vehicle.ardupilot.copter.course import Course, grid_of, motions, table_of
from faao_mav.vehicle.ardupilot.copter.follow import Follower, pursue
from faao_mav.vehicle.ardupilot.copter.parameters import TABLE
from faao_mav.vehicle.ardupilot.copter.ramp import rise_time
from faao_mav.vehicle.ardupilot.copter.route import Bounds, Router
from faao_mav.vehicle.flight_path import FlightPath, Flown
from faao_mav.vehicle.parameter import ParameterValues

_G = 9.80665
_DEGREE = 111_318.845
"""Metres to a degree, north, and times the cosine of the latitude east, to the autopilot."""


@dataclass(frozen=True, slots=True)
class ArduCopter:
    """ArduCopter 4.1 and later in AUTO, without wind. SI units; the defaults are its own.

    What is flown: a target moves along jerk-limited legs, each planned from rest to rest, which
    overlap at corners; its clock waits for an aircraft that falls behind; a position controller
    with limited lean angle follows it. The aircraft therefore starts late, overshoots stops by up
    to a metre, and comes to its full speed only seconds after its target. Acceptance radii of
    waypoints are not stored by this autopilot, so `FlightPath.radii` do not count; holds are
    whole seconds (fractions are dropped), delays are kept to the fraction.

    `corner_acceleration` 0 stands for twice `acceleration`. `lean_angle` is in radians, the gains
    are those of the horizontal position controller. `east_metre` and `north_metre` are its metres
    per metre: it takes the Earth for a sphere. The last three describe the aircraft and are no
    parameters of the autopilot: the time constant of leaning, s, and the drag per mass
    `linear_drag` v + `quadratic_drag` v², m/s². They are fitted to flights of the autopilot's
    simulated quadrotor.
    """

    cruise_speed: float = TABLE["cruise_speed"].default
    climb_speed: float = TABLE["climb_speed"].default
    descent_speed: float = TABLE["descent_speed"].default
    acceleration: float = TABLE["acceleration"].default
    climb_acceleration: float = TABLE["climb_acceleration"].default
    corner_acceleration: float = TABLE["corner_acceleration"].default
    jerk: float = TABLE["jerk"].default
    radius: float = TABLE["radius"].default
    lean_angle: float = TABLE["lean_angle"].default
    input_time: float = TABLE["input_time"].default
    position_gain: float = TABLE["position_gain"].default
    velocity_gain: float = TABLE["velocity_gain"].default
    velocity_integral: float = TABLE["velocity_integral"].default
    east_metre: float = 1.0
    north_metre: float = 1.0
    lag: float = 0.17
    linear_drag: float = 0.28
    quadratic_drag: float = 0.026

    _routers: list[Router] = field(default_factory=list, init=False, repr=False, compare=False)
    """The last one: flights along the same points come one after the other."""

    @classmethod
    def from_vehicle(cls, vehicle: ParameterValues, latitude: float | None = None) -> "ArduCopter":
        """Return the model with the parameters of `vehicle`.

        With the `latitude` of the flight, degrees, it counts metres as the autopilot does.
        Raises `InputError` for a value that is too small to fly with or not finite.
        """
        model = cls(**{key: vehicle.value(key) for key in cls.__slots__ if key in TABLE})
        if latitude is None:
            return model
        east, north = _metres(latitude)
        return replace(model, east_metre=east, north_metre=north)

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        Raises `InputError` for speeds that are not positive, and for what is not finite.
        """
        waits = np.floor(path.holds) + path.delays
        _check(path, waits, step)
        return self.fly_many(path, path.speeds[None], waits[None], step)[0]

    def fly_many(
        self,
        path: FlightPath,
        speeds: Real,
        waits: Real,
        step: float = 0.1,
        *,
        rough: bool = False,
    ) -> Sequence[Flown]:
        """Return the flights of variants with other `speeds` (B, m - 1) and `waits` (B, m), s.

        A `rough` flight is that of the target, as if it never waited for the aircraft.
        """
        stopping = np.any(waits > 0, axis=0)
        stopping[[0, -1]] = True
        scale = np.array([self.east_metre, self.north_metre, 1.0])
        router = self._router(path.points * scale, path.splines, stopping)
        courses = [
            router.course(speed, wait)
            for speed, wait in zip(speeds.tolist(), waits.tolist(), strict=True)
        ]
        if rough:
            flights = _targets(courses, step)
        else:
            flights = [self._followed(course, step) for course in courses]
        return [
            replace(flown, position=flown.position / scale, velocity=flown.velocity / scale)
            for flown in flights
        ]

    def _router(self, points: Real, splines: Flags, stopping: Flags) -> Router:
        """Return what knows the legs along `points` already, if they are those of the last call."""
        if not (self._routers and self._routers[0].leads_along(points, splines, stopping)):
            self._routers[:] = [Router(points, splines, stopping, self._bounds())]
        return self._routers[0]

    def _followed(self, course: Course, step: float) -> Flown:
        """Return the flight of the aircraft after its target."""
        grid = grid_of(course)
        (target,) = motions([course], [grid], 2)
        pursuit = pursue(course, table_of(target), self._follower(), self.acceleration / self.jerk)
        arrivals = np.interp(course.passed, pursuit.clock, pursuit.t)
        departures = _stopped(course, arrivals, pursuit.arrivals)
        motion = np.column_stack(
            [
                pursuit.position,
                np.interp(pursuit.clock, grid, target[:, 2]),
                pursuit.velocity,
                pursuit.rate * np.interp(pursuit.clock, grid, target[:, 5]),
            ]
        )
        t = _times(departures, step)
        flown = np.column_stack([np.interp(t, pursuit.t, column) for column in motion.T])
        return Flown(arrivals, departures, t, flown[:, :3], flown[:, 3:])

    def _bounds(self) -> Bounds:
        return Bounds(
            up=self.climb_speed,
            down=self.descent_speed,
            acceleration=self.acceleration,
            vertical=self.climb_acceleration,
            corner=self.corner_acceleration or 2 * self.acceleration,
            jerk=self.jerk,
            rise=rise_time(self.input_time),
            radius=self.radius,
        )

    def _follower(self) -> Follower:
        return Follower(
            position=self.position_gain,
            velocity=self.velocity_gain,
            integral=self.velocity_integral,
            lean=_G * math.tan(self.lean_angle),
            lag=self.lag,
            linear=self.linear_drag,
            quadratic=self.quadratic_drag,
        )


def _targets(courses: Sequence[Course], step: float) -> list[Flown]:
    """Return the flights of the targets, whose clocks only stand still where they have to wait."""
    timings = [_timing(course, step) for course in courses]
    found = motions(courses, [clock for *_, clock in timings], 1)
    return [
        Flown(arrivals, departures, t, motion[:, :3], motion[:, 3:])
        for (arrivals, departures, t, _), motion in zip(timings, found, strict=True)
    ]


def _timing(course: Course, step: float) -> tuple[Real, Real, Real, Real]:
    """Return arrivals and departures, times, and the target's clock then."""
    times = [stop.time for stop in course.stops]
    waited = np.cumsum([course.wait] + [stop.wait for stop in course.stops])
    arrivals = course.passed + waited[np.searchsorted(times, course.passed)]
    departures = _stopped(course, arrivals, waited[:-1] + times)
    t = _times(departures, step)
    knots = np.column_stack([times + waited[:-1], times + waited[1:]]).ravel()
    clock = np.interp(
        t, np.append([0.0, course.wait], knots), np.append([0.0, 0.0], np.repeat(times, 2))
    )
    return arrivals, departures, t, clock


def _stopped(course: Course, arrivals: Real, stops: Real) -> Real:
    """Put the arrivals at `stops`, s, into `arrivals` (m,); return the departures (m,)."""
    departures = arrivals.copy()
    arrivals[0], departures[0] = 0.0, course.wait
    for stop, arrival in zip(course.stops, stops.tolist(), strict=True):
        arrivals[stop.point], departures[stop.point] = arrival, arrival + stop.wait
    return departures


def _times(departures: Real, step: float) -> Real:
    return step * np.arange(math.ceil(departures[-1] / step - 1e-9) + 1)


def _metres(latitude: float) -> tuple[float, float]:
    """The autopilot's metres per metre of WGS84 at `latitude` degrees, east and north."""
    a, e2 = 6_378_137.0, 6.69437999014e-3
    w = 1 - e2 * math.sin(math.radians(latitude)) ** 2
    degree = math.pi / 180 * a / math.sqrt(w)
    return _DEGREE / degree, _DEGREE * w / (degree * (1 - e2))


def _check(path: FlightPath, waits: Real, step: float) -> None:
    finite = all(np.all(np.isfinite(values)) for values in (path.points, path.speeds, waits))
    if not (finite and np.all(path.speeds > 0) and np.all(waits >= 0) and step > 0):
        raise InputError(
            "flight path: expected finite points, speeds and steps above 0, and holds of 0 or more"
        )
