"""ArduCopter in AUTO: legs, corners, holds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.flight.arducopter.leg import Leg, changed_leg, plain_leg
from faao_mav.mission.flight.arducopter.ramp import Ramp, top_speed
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
    """How ArduCopter flies plain waypoints in AUTO, without wind.

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
    """Legs with the times (m - 1, B) at which they begin."""

    points: Real
    legs: list[Leg]
    begins: list[Real]
    arrivals: Real
    departures: Real

    @classmethod
    def along(cls, model: ArduCopter, path: FlightPath, speeds: Real, waits: Real) -> "_Flight":
        ways = np.diff(path.points, axis=0)
        lengths = np.sqrt(np.sum(ways**2, axis=1))
        stops = np.any(waits > 0, axis=0)
        stops[[0, -1]] = True
        limits = [_along(model, way, length) for way, length in zip(ways, lengths, strict=True)]
        lag = HOLD_LAG + HOLD_LAG_PER_RISE * model.acceleration / model.jerk
        arrivals, departures = np.zeros_like(waits), np.zeros_like(waits)
        departures[:, 0] = waits[:, 0]
        begin = departures[:, 0] + START_LAG
        before = model.cruise_speed if math.isnan(path.before) else path.before
        legs, begins, tau = [], [], 0 * begin
        for k, length in enumerate(lengths):
            share, acceleration = limits[k]
            speed = np.minimum(speeds[:, k], share)
            if (waits[:, k] > 0).any():
                leg = plain_leg(length, speed, acceleration, model.jerk)
            else:
                old = np.minimum(speeds[:, k - 1] if k else before, share)
                leg = changed_leg(length, old, speed, tau / 2, acceleration, model.jerk)
            legs.append(leg)
            begins.append(begin)
            end = begin + leg.duration
            if stops[k + 1]:
                arrivals[:, k + 1] = end + STOP_LAG
                departures[:, k + 1] = arrivals[:, k + 1] + waits[:, k + 1]
                begin = departures[:, k + 1] + lag
            else:
                # the next leg is planned before its own speed is commanded
                room, up = limits[k + 1]
                top = top_speed(
                    np.full_like(speed, lengths[k + 1]),
                    np.minimum(speeds[:, k], room),
                    up,
                    model.jerk,
                )
                ramp = Ramp.between(0 * top, top, up, model.jerk)
                half = _half_turn(ways[k], ways[k + 1])
                cut = model.radius / (2 * max(half, 1e-9))
                tau = np.minimum(
                    np.minimum(ramp.duration, leg.last.duration),
                    2 * ramp.time_to(np.full_like(top, cut)),
                )
                begin = end - tau + _loss(half, max(acceleration, up))
                begin = begin + CHANGE_LAG * np.minimum(
                    1.0, np.abs(speeds[:, k + 1] - speeds[:, k])
                )
                arrivals[:, k + 1] = departures[:, k + 1] = end - tau / 2 + PASS_LAG
        return cls(path.points, legs, begins, arrivals, departures)

    def sampled(self, t: Real) -> tuple[Real, Real]:
        """Return positions and velocities (B, k, 3) at the times `t` (k,)."""
        count = len(self.arrivals)
        position = np.tile(self.points[0], (count, len(t), 1)).astype(float)
        velocity = np.zeros_like(position)
        for k, (leg, begin) in enumerate(zip(self.legs, self.begins, strict=True)):
            way = self.points[k + 1] - self.points[k]
            if leg.length == 0:
                continue
            first = int(np.searchsorted(t, begin.min()))
            last = int(np.searchsorted(t, (begin + leg.duration).max()))
            along, speed = leg.at(t[first:last] - begin[:, None])
            position[:, first:last] += along[..., None] / leg.length * way
            velocity[:, first:last] += speed[..., None] / leg.length * way
            position[:, last:] += way
        return position, velocity


def _along(model: ArduCopter, way: Real, length: float) -> tuple[float, float]:
    """Return the limits of speed (m/s) and acceleration (m/s²) along a leg that may climb."""
    if length == 0:
        return np.inf, model.acceleration
    level, up = float(np.hypot(way[0], way[1])) / length, float(way[2]) / length
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
    """Return sin(theta / 2) of the turn between two legs."""
    sizes = float(np.linalg.norm(before) * np.linalg.norm(after))
    cosine = float(before @ after) / sizes if sizes else 1.0
    return math.sqrt(max(0.0, (1 - cosine) / 2))
