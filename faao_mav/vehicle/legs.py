"""What autopilots do with the legs between waypoints: the limits that shape them.

Models and defaults as measured on ArduCopter 4.7 and PX4 1.16 in simulation; ArduPlane's are
those of its documentation.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.mission.vehicle import Vehicle
from faao_mav.vehicle.ardupilot.plane.model import ArduPlane

Name: TypeAlias = tuple[str, float]
"""A parameter's name and the factor that makes its value SI."""

# Newer names first: a vehicle has one generation, a parameter file may carry both.
_ARDUPILOT_ACCELERATION: tuple[Name, ...] = (("WP_ACC", 1.0), ("WPNAV_ACCEL", 0.01))
_ARDUPILOT_JERK: tuple[Name, ...] = (("WP_JERK", 1.0), ("WPNAV_JERK", 1.0))
_PX4_ACCELERATION: tuple[Name, ...] = (("MPC_ACC_HOR", 1.0),)
_PX4_JERK: tuple[Name, ...] = (("MPC_JERK_AUTO", 1.0),)

_NARROW_RADIUS, _RADIUS_SHARE = 4.0, 0.45
_CUT, _LIVELY_CUT, _LIVELY = 1.3, 1.0, 10.0
"""Metres of a corner that a wide radius may cut, and at a jerk from the last, m/s³, on: an aircraft
that is soon at speed again loses less in a corner."""

_JERK_LAG = 0.30
"""ArduCopter's t_j: what a ramp takes beyond the ideal jerk-limited one, s."""


@dataclass(frozen=True, slots=True)
class ArduCopterLegs:
    """How ArduCopter flies a leg between plain waypoints: A in m/s², J in m/s³."""

    whole_seconds: ClassVar[bool] = True
    """Whether holds lose their fractions."""
    least: ClassVar[float] = 0.0
    """Shorter legs, m, are not flown: both their ends count as reached at once."""
    run_in: ClassVar[float] = 1.2
    """Of the shortest leg: what it takes to be at speed, and on the leg, for sure."""

    acceleration: float = 2.5
    jerk: float = 1.0

    def ramp_duration(self, change: Real) -> Real:
        """Return the time in which the speed changes by `change` m/s >= 0, s; same shape.

        D = dv/A + A/J + t_j; when dv is too small to reach A, D = 2 (a/J + t_j) with the peak
        acceleration a from a²/J + a t_j = dv.
        """
        a, j, lag = self.acceleration, self.jerk, _JERK_LAG
        peak = j * (np.sqrt(lag**2 + 4 * change / j) - lag) / 2
        return np.where(peak >= a, change / a + a / j + lag, 2 * (peak / j + lag))

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg that reaches `speed`, m; same shape.

        Two ramps of v/2 D each: every leg is planned as if it began and ended at rest.
        """
        return speed * self.ramp_duration(speed)

    def radii(self, room: Real, turn: Real) -> Real:  # noqa: ARG002
        """Return acceptance radii, m: 0, for ArduCopter stores none; the shape of `turn`."""
        return np.zeros_like(turn)


@dataclass(frozen=True, slots=True)
class Px4Legs:
    """How PX4 flies a leg between plain waypoints: a in m/s², j in m/s³."""

    whole_seconds: ClassVar[bool] = False
    least: ClassVar[float] = 3.0  # NAV_ACC_RAD is 2 m
    run_in: ClassVar[float] = 1.2

    acceleration: float = 3.0
    jerk: float = 4.0

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg that is flown at `speed`, m; same shape.

        It must be able to stop at the next waypoint, d metres ahead, so its speed is
        v = (-b + sqrt(b² + 8 a d)) / 2 with b = 4 a² / j; this is that, solved for d.
        """
        b = 4 * self.acceleration**2 / self.jerk
        return speed * (speed + b) / (2 * self.acceleration)

    def radii(self, room: Real, turn: Real) -> Real:
        """Return acceptance radii, m, for waypoints whose shorter leg is `room` (n,), m.

        A wider one costs less speed in a corner, of sqrt(a r tan(alpha / 2)) at the inner angle
        alpha, but cuts it: by r tan(turn / 4) about, `turn` (n,) in radians. One as long as its
        leg would count at once.
        """
        cut = (_CUT if self.jerk < _LIVELY else _LIVELY_CUT) / np.maximum(np.tan(turn / 4), 1e-9)
        return np.minimum(np.maximum(_NARROW_RADIUS, cut), _RADIUS_SHARE * room)


@dataclass(frozen=True, slots=True)
class ArduPlaneLegs:
    """How ArduPlane flies a leg: `look_ahead`, s, is how far ahead its guidance aims."""

    whole_seconds: ClassVar[bool] = False
    least: ClassVar[float] = 0.0
    run_in: ClassVar[float] = 4.0  # to come onto a track, whatever its course

    look_ahead: float

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg that is flown at `speed`, m; same shape.

        One look-ahead: shorter ones are cut.
        """
        return self.look_ahead * speed

    def radii(self, room: Real, turn: Real) -> Real:  # noqa: ARG002
        """Return acceptance radii, m: 0, ArduPlane's own; the shape of `turn`."""
        return np.zeros_like(turn)


Legs: TypeAlias = ArduCopterLegs | Px4Legs | ArduPlaneLegs


def legs_of(vehicle: Vehicle) -> Legs:
    """Return how `vehicle` flies legs, by its autopilot and its parameters.

    Parameters of either generation of names are known: WP_ACC and WP_JERK in metres,
    WPNAV_ACCEL in centimetres and WPNAV_JERK in metres; MPC_ACC_HOR and MPC_JERK_AUTO for PX4.
    Raises `InputError` if the one that counts is not a positive number.
    """
    if vehicle.kind == "plane":
        plane = ArduPlane.from_vehicle(vehicle)
        return ArduPlaneLegs(plane.damping * plane.period / math.pi)
    if vehicle.autopilot == "px4":
        px4 = Px4Legs()
        return Px4Legs(
            acceleration=_value(vehicle, _PX4_ACCELERATION, px4.acceleration),
            jerk=_value(vehicle, _PX4_JERK, px4.jerk),
        )
    copter = ArduCopterLegs()
    return ArduCopterLegs(
        acceleration=_value(vehicle, _ARDUPILOT_ACCELERATION, copter.acceleration),
        jerk=_value(vehicle, _ARDUPILOT_JERK, copter.jerk),
    )


def _value(vehicle: Vehicle, names: tuple[Name, ...], default: float) -> float:
    for name, unit in names:
        if name in vehicle.parameters:
            value = vehicle.parameters[name]
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{vehicle.source}.{name}: {value:g}; give a number above 0")
            return value * unit
    return default
