"""A PX4 multicopter as a flight model."""

import math
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.flight_path import FlightPath, Flown
from faao_mav.autopilot.px4.parameters import Px4Limits
from faao_mav.autopilot.px4.simulation import SWITCH_DELAY, FlightLog, simulate


@dataclass(frozen=True, slots=True)
class Px4(Px4Limits):
    """How a PX4 multicopter flies plain waypoints in mission mode.

    A simulation of PX4's own chain: guidance with a look at the next waypoint only, smoothing
    within jerk and acceleration, a clock that runs slower while the aircraft lags behind, a
    cascaded controller and an aircraft with lag and drag; see the modules of this package for the
    equations. Fitted to recorded flights are the `body`, how its position estimate strays in
    `step`, `simulation.START_LAG` and `simulation.SWITCH_DELAY`; the rest is PX4's. Limits are SI:
    m, m/s, m/s², m/s³; the defaults are those of PX4 1.16. Wind and the lean limit are left out:
    with the simulator's drag the controller's integral holds against a steady wind from the
    take-off on, and drag takes all of the lean limit at 49 m/s only.
    """

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        Holds keep their fractions and count from entering the acceptance radius; speeds of 0 or
        less mean `cruise_speed`, radii of 0 `acceptance_radius`. Spline waypoints, which PX4
        refuses, are flown as plain ones. The end is when the last waypoint is done: the aircraft
        is then within its radius and may still be braking.
        """
        speeds = np.where(path.speeds > 0, path.speeds, self.cruise_speed)
        holds = path.holds + path.delays
        if len(path.points) == 1:
            return _standing(path.points[0], float(holds[0]), step)
        radii = np.where(path.radii > 0, path.radii, self.acceptance_radius)
        speeds = np.minimum(speeds, self.max_speed)
        log = simulate(self, path.points, radii, speeds, holds, step, path.longest)
        return sampled(log, path.points[0, 2], step)


def _standing(point: Real, hold: float, step: float) -> Flown:
    """Return what becomes of a path of one point (3,): `hold` s there."""
    end = hold + SWITCH_DELAY if hold > 0 else 0.0
    t = grid(end, step)
    position = np.tile(point, (len(t), 1))
    return Flown(np.zeros(1), np.array([end]), t, position, np.zeros_like(position))


def grid(end: float, step: float) -> Real:
    """Return the multiples of `step` from 0 to the first that is at least `end`."""
    return np.arange(math.ceil(end / step - 1e-9) + 1, dtype=float) * step


def sampled(log: FlightLog, height: float, step: float) -> Flown:
    """Return the flight of `log` every `step` seconds up to its end.

    `height` m is that of a path that does not climb.
    """
    t = grid(float(log.departures[-1]), step)
    place, velocity = _between(t, log.time, log.motion)
    if place.shape[1] == 2:
        place = np.column_stack([place, np.full(len(t), height)])
        velocity = np.column_stack([velocity, np.zeros(len(t))])
    return Flown(log.arrivals, log.departures, t, place, velocity)


def _between(t: Real, time: Real, motion: Real) -> tuple[Real, Real]:
    """Return places and velocities (len(t), n): cubic and linear between samples (k, 2, n)."""
    left = np.clip(np.searchsorted(time, t, side="right") - 1, 0, len(time) - 2)
    right = left + 1
    width = (time[right] - time[left])[:, None]
    s = np.clip((t - time[left])[:, None] / np.maximum(width, 1e-9), 0.0, 1.0)
    rest = 1 - s
    (place_left, velocity_left), (place_right, velocity_right) = (
        motion[side].swapaxes(0, 1) for side in (left, right)
    )
    bends = rest * velocity_left - s * velocity_right
    places = (
        rest * rest * (1 + 2 * s) * place_left
        + s * s * (3 - 2 * s) * place_right
        + s * rest * width * bends
    )
    return places, rest * velocity_left + s * velocity_right
