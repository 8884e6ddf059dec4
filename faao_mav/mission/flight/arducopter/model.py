"""ArduCopter in AUTO: legs, corners, holds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.flight.arducopter.leg import Leg, changed_leg, plain_leg
from faao_mav.mission.flight.arducopter.ramp import Ramp, top_speed
from faao_mav.mission.flight.arducopter.section import Section, sections
from faao_mav.mission.flight.parameters import Parameter, limits_of
from faao_mav.mission.flight.path import FlightPath, Flown
from faao_mav.mission.vehicle import Vehicle

START_LAG, STOP_LAG = 0.27, 0.15
"""From leaving the first point to moving, from the end of a leg to being at its point, s."""

PASS_LAG = 0.07
"""From passing a point to the autopilot taking it as reached, s."""

HOLD_LAG, HOLD_LAG_PER_RISE = 0.05, 0.12
"""After a hold: s, and of A / J."""

CHANGE_LAG = 0.08
"""What a change of speed by 1 m/s or more costs beyond its ramps, s."""

SPLINE_TURN, SPLINE_START = 0.11, 0.8
"""Runs of splines: the share of speed lost per radian of turn at a point; a start's cost, s."""

REVERSAL, OVERLOAD = 1.0, 1.4
LEAN_ACCELERATION = 9.81 * math.tan(math.radians(30))
"""At the default lean limit, m/s²."""

_PARAMETERS = {
    "cruise_speed": Parameter({"WP_SPD": 1.0, "WPNAV_SPEED": 0.01}, 0.1),
    "climb_speed": Parameter({"WP_SPD_UP": 1.0, "WPNAV_SPEED_UP": 0.01}, 0.1),
    "descent_speed": Parameter({"WP_SPD_DN": 1.0, "WPNAV_SPEED_DN": 0.01}, 0.1),
    "acceleration": Parameter({"WP_ACC": 1.0, "WPNAV_ACCEL": 0.01}, 0.1),
    "climb_acceleration": Parameter({"WP_ACC_Z": 1.0, "WPNAV_ACCEL_Z": 0.01}, 0.1),
    "jerk": Parameter({"WP_JERK": 1.0, "WPNAV_JERK": 1.0}, 0.1),
    "radius": Parameter({"WP_RADIUS_M": 1.0, "WPNAV_RADIUS": 0.01}, 0.05),
}


@dataclass(frozen=True, slots=True)
class ArduCopter:
    """How ArduCopter flies plain and spline waypoints in AUTO, without wind.

    Every leg is planned as if it began and ended at rest, with jerk-limited ramps (`ramp`,
    `leg`). At a corner the next leg begins before this one ends, and the aircraft is where the
    sum of both is: by tau = min(D, 2 t(s)), D the ramp's duration and t(s) the time in which a
    ramp from rest covers s = R / (2 sin(theta / 2)); the point counts as passed tau / 2 before
    the end. Limits are SI: m, m/s, m/s², m/s³; the defaults are those of ArduCopter 4.7.
    Fitted to recorded flights: `ramp.JERK_LAG`, `leg.SWITCH_LAG`, and the lags of this module.
    """

    calibrated: ClassVar[bool] = True

    cruise_speed: float = 10.0
    climb_speed: float = 2.5
    descent_speed: float = 1.5
    acceleration: float = 2.5
    climb_acceleration: float = 1.0
    jerk: float = 1.0
    radius: float = 2.0

    @classmethod
    def from_vehicle(cls, vehicle: Vehicle) -> "ArduCopter":
        """Return the model with the limits that `vehicle.parameters` set, of either generation.

        Raises `InputError` for a value that is too small to fly with or not finite.
        """
        return cls(**limits_of(vehicle, _PARAMETERS))

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        Holds lose their fractions, delays keep them.
        """
        waits = np.floor(path.holds) + path.delays
        return self.fly_many(path, path.speeds[None], waits[None], step)[0]

    def fly_many(
        self, path: FlightPath, speeds: Real, waits: Real, step: float = 0.1
    ) -> Sequence[Flown]:
        """Return the flights of variants with other `speeds` (B, m - 1) and `waits` (B, m), s."""
        flight = _Flight.along(self, path, speeds, waits)
        ends = flight.departures[:, -1]
        t = step * np.arange(int(np.ceil(ends.max() / step)) + 2, dtype=np.float64)
        position, velocity = flight.sampled(t)
        return [
            Flown(flight.arrivals[k], flight.departures[k], t, position[k], velocity[k])
            for k in range(len(speeds))
        ]


@dataclass(frozen=True, slots=True, eq=False)
class _Flight:
    """Sections with their legs and the times (B,) at which these begin."""

    points: Real
    parts: list[Section]
    legs: list[Leg]
    begins: list[Real]
    arrivals: Real
    departures: Real

    @classmethod
    def along(cls, model: ArduCopter, path: FlightPath, speeds: Real, waits: Real) -> "_Flight":
        stops = np.any(waits > 0, axis=0)
        stops[[0, -1]] = True
        parts = list(sections(path.points, path.splines, stops))
        lag = HOLD_LAG + HOLD_LAG_PER_RISE * model.acceleration / model.jerk
        arrivals, departures = np.zeros_like(waits), np.zeros_like(waits)
        departures[:, 0] = waits[:, 0]
        begin = departures[:, 0] + np.where(waits[:, 0] > 0, lag, START_LAG)
        before = model.cruise_speed if math.isnan(path.before) else path.before
        commanded = np.full(len(speeds), before)
        legs, begins, tau = [], [], 0 * begin
        for part, after in zip_longest(parts, parts[1:]):
            share, acceleration = _along(model, part)
            old, new = commanded, _commanded(part, speeds)
            commanded = new
            if (waits[:, part.first] > 0).any() or part.spline:
                new = np.minimum(new, share)
                leg = plain_leg(part.length, new, acceleration, model.jerk)
            else:
                old, new = np.minimum(old, share), np.minimum(new, share)
                leg = changed_leg(part.length, old, new, tau / 2, acceleration, model.jerk)
            if part.spline and stops[part.first]:
                begin = begin + SPLINE_START
            legs.append(leg)
            begins.append(begin)
            end = begin + leg.duration
            k = part.last
            if part.spline:
                _pass(leg, begin, part, arrivals, departures)
            if after is None or stops[k]:
                arrivals[:, k] = end + STOP_LAG
                departures[:, k] = arrivals[:, k] + waits[:, k]
                begin = departures[:, k] + lag
            else:
                # the next leg is planned before its own speed is commanded
                room, up = _along(model, after)
                top = top_speed(
                    np.full_like(new, after.length), np.minimum(commanded, room), up, model.jerk
                )
                ramp = Ramp.between(0 * top, top, up, model.jerk)
                half = _half_turn(part.direction(part.way[-1]), after.direction(after.way[0]))
                cut = model.radius / (2 * max(half, 1e-9))
                tau = np.minimum(
                    np.minimum(ramp.duration, leg.last.duration),
                    2 * ramp.time_to(np.full_like(top, cut)),
                )
                begin = end - tau + _loss(half, max(acceleration, up))
                change = np.abs(_commanded(after, speeds) - commanded)
                begin = begin + CHANGE_LAG * np.minimum(1.0, change)
                arrivals[:, k] = departures[:, k] = end - tau / 2 + PASS_LAG
        return cls(path.points, parts, legs, begins, arrivals, departures)

    def sampled(self, t: Real) -> tuple[Real, Real]:
        """Return positions and velocities (B, k, 3) at the times `t` (k,)."""
        count = len(self.arrivals)
        position = np.tile(self.points[0], (count, len(t), 1)).astype(float)
        velocity = np.zeros_like(position)
        for part, leg, begin in zip(self.parts, self.legs, self.begins, strict=True):
            if leg.length == 0:
                continue
            first = int(np.searchsorted(t, begin.min()))
            last = int(np.searchsorted(t, (begin + leg.duration).max()))
            along, speed = leg.at(t[first:last] - begin[:, None])
            position[:, first:last] += part.at(along) - part.curve[0]
            velocity[:, first:last] += speed[..., None] * part.direction(along)
            position[:, last:] += part.curve[-1] - part.curve[0]
        return position, velocity


def _commanded(part: Section, speeds: Real) -> Real:
    """Return the speed (B,) flown on a section; a run of splines has the mean of its speeds."""
    mean: Real = speeds[:, part.first : part.last].mean(axis=1)
    return (1 - SPLINE_TURN * part.turn) * mean if part.spline else mean


def _pass(leg: Leg, begin: Real, part: Section, arrivals: Real, departures: Real) -> None:
    """Fill in when the points within a run of splines are passed."""
    t = leg.duration[:, None] * np.linspace(0.0, 1.0, 20 * len(part.passed) + 1)
    ways = leg.at(t)[0]
    for k in range(len(begin)):
        passed = begin[k] + np.interp(part.passed[:-1], ways[k], t[k])
        inner = slice(part.first + 1, part.last)
        arrivals[k, inner] = departures[k, inner] = passed + PASS_LAG


def _along(model: ArduCopter, part: Section) -> tuple[float, float]:
    """Return the limits of speed (m/s) and acceleration (m/s²) along a section that may climb."""
    if part.length == 0:
        return np.inf, model.acceleration
    up = float(part.curve[-1, 2] - part.curve[0, 2]) / part.length
    level = math.sqrt(max(0.0, 1 - up**2))
    vertical = model.climb_speed if up > 0 else model.descent_speed
    speed = vertical / abs(up) if up else np.inf
    acceleration = min(
        model.acceleration / level if level else np.inf,
        model.climb_acceleration / abs(up) if up else np.inf,
    )
    return speed, acceleration


def _loss(half_turn: float, acceleration: float) -> float:
    """Return what a corner costs beyond its geometry, s, at sin(theta / 2) = `half_turn`.

    A turn back on itself costs REVERSAL / 2; and where the ramps of both legs together ask for
    more than the lean limit gives, the aircraft falls behind and the autopilot waits for it.
    """
    asked = 2 * acceleration * half_turn / LEAN_ACCELERATION
    return REVERSAL * max(0.0, half_turn**2 - 0.5) + OVERLOAD * math.sqrt(max(0.0, asked - 1))


def _half_turn(before: Real, after: Real) -> float:
    """Return sin(theta / 2) of the turn between two directions; 0 if one has no length."""
    cosine = float(before @ after) if before.any() and after.any() else 1.0
    return math.sqrt(max(0.0, (1 - cosine) / 2))
