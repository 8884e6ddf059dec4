"""ArduCopter as a flight model."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.errors import InputError
from faao_mav.vehicle.ardupilot.copter.course import Course, grid_of, motions, table_of
from faao_mav.vehicle.ardupilot.copter.follow import pursue
from faao_mav.vehicle.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.vehicle.ardupilot.copter.route import Router
from faao_mav.vehicle.flight_path import FlightPath, Flown


@dataclass(frozen=True, slots=True)
class ArduCopter(ArduCopterLimits):
    """ArduCopter 4.1 and later in AUTO, without wind. SI units; the defaults are its own.

    What is flown: a target moves along jerk-limited legs, each planned from rest to rest, which
    overlap at corners; its clock waits for an aircraft that falls behind; a position controller
    with limited lean angle follows it. The aircraft therefore starts late, overshoots stops by up
    to a metre, and comes to its full speed only seconds after its target. Acceptance radii of
    waypoints are not stored by this autopilot, so `FlightPath.radii` do not count; holds are
    whole seconds (fractions are dropped), delays are kept to the fraction.
    """

    _routers: list[Router] = field(default_factory=list, init=False, repr=False, compare=False)
    """The last one: flights along the same points come one after the other."""

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
            self._routers[:] = [Router(points, splines, stopping, self)]
        return self._routers[0]

    def _followed(self, course: Course, step: float) -> Flown:
        """Return the flight of the aircraft after its target."""
        grid = grid_of(course)
        (target,) = motions([course], [grid], 2)
        pursuit = pursue(course, table_of(target), self)
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


def _check(path: FlightPath, waits: Real, step: float) -> None:
    finite = all(np.all(np.isfinite(values)) for values in (path.points, path.speeds, waits))
    if not (finite and np.all(path.speeds > 0) and np.all(waits >= 0) and step > 0):
        raise InputError(
            "flight path: expected finite points, speeds and steps above 0, and holds of 0 or more"
        )
