"""ArduCopter as a flight model."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.copter.course import Course, grid_of, motion_of
from faao_mav.autopilot.ardupilot.copter.follow import pursue
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.autopilot.ardupilot.copter.route import Router
from faao_mav.autopilot.flight_path import FlightPath, Flown
from faao_mav.errors import InputError


@dataclass(frozen=True, slots=True)
class ArduCopter(ArduCopterLimits):
    """ArduCopter 4.1 and later in AUTO, in steady wind. SI units; the defaults are its own.

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

        Raises `InputError` for speeds that are not positive, for what is not finite, and for a
        flight that takes more than `path.longest`.
        """
        waits = np.floor(path.holds) + path.delays
        _check(path, waits, step)
        stopping = waits > 0
        stopping[[0, -1]] = True
        scale = np.array([self.east_metre, self.north_metre, 1.0])
        router = self._router(path.points * scale, path.splines, stopping)
        course = router.course(path.speeds.tolist(), waits.tolist())
        flown = self._followed(course, path, step)
        return replace(flown, position=flown.position / scale, velocity=flown.velocity / scale)

    def _router(self, points: Real, splines: Flags, stopping: Flags) -> Router:
        """Return what knows the legs along `points` already, if they are those of the last call."""
        if not (self._routers and self._routers[0].leads_along(points, splines, stopping)):
            self._routers[:] = [Router(points, splines, stopping, self)]
        return self._routers[0]

    def _followed(self, course: Course, path: FlightPath, step: float) -> Flown:
        """Return the flight of the aircraft after its target."""
        grid = grid_of(course)
        target = motion_of(course, grid)
        pursuit = pursue(
            course,
            target,
            self,
            wind=path.wind,
            longest=path.longest,
        )
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
        t = step * np.arange(math.ceil(departures[-1] / step - 1e-9) + 1)
        flown = np.column_stack([np.interp(t, pursuit.t, column) for column in motion.T])
        return Flown(arrivals, departures, t, flown[:, :3], flown[:, 3:])


def _stopped(course: Course, arrivals: Real, stops: Real) -> Real:
    """Put the arrivals at `stops`, s, into `arrivals` (m,); return the departures (m,)."""
    departures = arrivals.copy()
    arrivals[0], departures[0] = 0.0, course.wait
    for stop, arrival in zip(course.stops, stops.tolist(), strict=True):
        arrivals[stop.point], departures[stop.point] = arrival, arrival + stop.wait
    return departures


def _check(path: FlightPath, waits: Real, step: float) -> None:
    finite = all(np.all(np.isfinite(values)) for values in (path.points, path.speeds, waits))
    if not (finite and np.all(path.speeds > 0) and np.all(waits >= 0) and step > 0):
        raise InputError(
            "flight path: expected finite points, speeds and steps above 0, and holds of 0 or more"
        )
