"""The velocity that PX4 asks for on its way along a leg."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Complex, Real

_ALIGNED = 0.98
"""Cosine of the angle to the target from which an aircraft no longer counts as turning."""

_BLEND = 0.01
"""Half the range of that cosine over which turning fades, so that flights depend smoothly on it."""

_LOOKAHEAD = 5.0
"""Least distance, m, at which a turning aircraft aims along the leg."""

_SLOW = 0.5
"""A direction slower than this never holds up the other, horizontal and vertical, m/s."""

_TINY = 1e-9


@dataclass(frozen=True, slots=True)
class Limits:
    """What bounds a trajectory: m/s² and m/s³, horizontally, upwards and downwards."""

    acceleration: float
    jerk: float
    corner_gain: float
    climb_acceleration: float
    climb_speed: float
    descent_acceleration: float
    descent_speed: float
    height_radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """Legs, one per element: horizontal places and directions are complex, east + i north.

    `target` m and `height` m are the end, `along` and `onward` the unit directions of this leg and
    the next (0 where there is none), `speed` m/s the command, `radius` m the acceptance radius;
    `exit_speed` and `exit_climb` m/s bound how fast the end is passed; farther than `braking` m
    from it the command holds whatever comes next.
    """

    target: Complex
    height: Real
    along: Complex
    onward: Complex
    speed: Real
    radius: Real
    exit_speed: Real
    exit_climb: Real
    braking: Real

    def of(self, index: NDArray[np.int_]) -> "Leg":
        """Return for each variant (row) its leg `index` (B,)."""
        rows = np.arange(len(index))
        return Leg(*(getattr(self, field.name)[rows, index] for field in fields(self)))


def stopping_speed(jerk: float, acceleration: Real | float, distance: Real, final: Real) -> Real:
    """Return the speed from which PX4 trusts itself to reach `final` m/s within `distance` m.

    v = (-b + sqrt(b² + 8 a d + 4 v_f²)) / 2 with b = 4 a² / j, at least v_f.
    """
    b = 4 * acceleration * acceleration / jerk
    return np.maximum(
        (np.sqrt(b * b + 8 * acceleration * distance + 4 * final * final) - b) / 2, final
    )


def stopping_distance(jerk: float, acceleration: float, speed: Real) -> Real:
    """Return from how far, m, `stopping_speed` to rest is `speed`: d = v (v + b) / 2 a."""
    return speed * (speed + 4 * acceleration * acceleration / jerk) / (2 * acceleration)


def legs(limits: Limits, points: Real, radii: Real, speeds: Real, holds: Real) -> Leg:
    """Return the legs between `points` (m, 3), each field (B, m - 1).

    `radii` are (m,), `speeds` (B, m - 1), `holds` (B, m). Only the waypoint after the target is
    looked at: the aircraft must be able to stop there, and it stops at the target if there is
    none, if it is told to hold, or if the next waypoint lies within the acceptance radius.
    """
    places = points[:, 0] + 1j * points[:, 1]
    moves, rises = np.diff(places), np.diff(points[:, 2])
    lengths = np.abs(moves)
    along = moves / np.where(lengths > _TINY, lengths, 1.0)
    following = np.append(lengths[1:], 0.0)
    passable = (following > 1e-3) & (following >= radii[1:]) & (holds[:, 1:] <= 0)
    zero = np.zeros_like(following)
    ahead = stopping_speed(limits.jerk, limits.acceleration, following, zero)
    shape = speeds.shape
    return Leg(
        target=np.broadcast_to(places[1:], shape),
        height=np.broadcast_to(points[1:, 2], shape),
        along=np.broadcast_to(along, shape),
        onward=np.broadcast_to(np.append(along[1:], 0.0), shape),
        speed=speeds,
        radius=np.broadcast_to(radii[1:], shape),
        exit_speed=np.where(passable, np.minimum(ahead, speeds), 0.0),
        exit_climb=np.where(holds[:, 1:] <= 0, _exit_climbs(limits, lengths, rises), 0.0),
        braking=stopping_distance(limits.jerk, limits.acceleration, speeds),
    )


def _exit_climbs(limits: Limits, lengths: Real, rises: Real) -> Real:
    """Return the vertical speeds (m - 1,) at which each leg's end may be passed, m/s."""
    slopes = lengths + 1j * rises
    onward = np.append(slopes[1:], 0.0)
    scale = np.abs(slopes) * np.abs(onward)
    cosine = (slopes * onward.conj()).real / np.where(scale > _TINY, scale, 1.0)
    acceleration = np.where(rises > 0, limits.climb_acceleration, limits.descent_acceleration)
    speed = np.sqrt(acceleration * limits.height_radius * _half_turn(cosine))
    steep = (np.abs(onward.imag) > 1e-3) & (scale > _TINY)
    return np.where(steep, speed, 0.0)


def _half_turn(cosine: Real) -> Real:
    """Return cot(θ/2) for the cosine of the turn θ between two legs."""
    sharp, straight = np.maximum(1 + cosine, 0.0), np.maximum(1 - cosine, 1e-9)
    return np.sqrt(sharp / straight)


def velocity_setpoint(
    limits: Limits, leg: Leg, place: Complex, velocity: Complex, heading: Complex, remembered: Real
) -> tuple[Complex, Real]:
    """Return the velocity asked for, (n, B) m/s, and the speed to remember for turns, (B,) m/s.

    `place` (n, B) m and `velocity` (n, B) m/s are the trajectory's: row 0 is horizontal, complex,
    row 1 vertical, real; n = 1 in level flight. `heading` (B,) is the direction of row 0, 0 at
    rest. The speed is the least of the command, what can be slowed to the passing speed at the
    target in time, and in a turn what was allowed before it. The direction is to the target, in a
    turn to a point of the leg max(R, 5 m) away.
    """
    offset = leg.target - place[0]
    distance = np.abs(offset) + _TINY
    direction = offset / distance
    speed = allowed = _allowed(limits, leg, direction, distance)
    cosine = (heading * direction.conj()).real
    if cosine.min() >= _ALIGNED + _BLEND:
        remembered = allowed
    else:
        turning = _turning(leg, cosine, distance, velocity[0])
        speed = allowed + turning * (np.minimum(remembered, allowed) - allowed)
        remembered = allowed + turning * (remembered - allowed)
        direction = direction + turning * (_along_leg(leg, offset, direction) - direction)
    if len(place) == 1:
        return (direction * speed)[None], remembered
    rise = leg.height - place[1].real
    climb = np.where(rise > 0, limits.climb_speed, limits.descent_speed)
    acceleration = np.where(rise > 0, limits.climb_acceleration, limits.descent_acceleration)
    height = np.abs(rise) + _TINY
    exit_climb = np.minimum(leg.exit_climb, climb)
    climb = np.minimum(climb, stopping_speed(limits.jerk, acceleration, height, exit_climb))
    vertical = np.minimum(climb, np.maximum(speed, _SLOW) * height / distance)
    speed = np.minimum(speed, np.maximum(climb, _SLOW) * distance / height)
    return np.stack([direction * speed, np.sign(rise) * vertical]), remembered


def _allowed(limits: Limits, leg: Leg, direction: Complex, distance: Real) -> Real:
    """Return the speed (B,) from which the target `distance` away is passed slowly enough.

    The passing speed is sqrt(g a R cot(θ/2)), g = MPC_XY_TRAJ_P, at most the leg's `exit_speed`.
    """
    if (distance - leg.braking).min() > 0:
        return leg.speed
    cosine = (direction * leg.onward.conj()).real
    corner = limits.corner_gain * limits.acceleration * leg.radius * _half_turn(cosine)
    passing = np.minimum(np.sqrt(corner), leg.exit_speed)
    slowing = stopping_speed(limits.jerk, limits.acceleration, distance, passing)
    return np.minimum(leg.speed, slowing)


def _turning(leg: Leg, cosine: Real, distance: Real, velocity: Complex) -> Real:
    """Return 1 where the trajectory turns towards its target, 0 where it does not, (B,).

    `cosine` is that of the angle between the two.
    """
    astray = _ramp((_ALIGNED + _BLEND - cosine) / (2 * _BLEND))
    moving = _ramp((np.abs(velocity) - 0.1) / 0.2)
    outside = _ramp((distance - leg.radius) / 0.2 + 0.5)
    return astray * moving * outside


def _ramp(share: Real) -> Real:
    return np.minimum(np.maximum(share, 0.0), 1.0)  # np.clip takes three times as long


def _along_leg(leg: Leg, offset: Complex, straight: Complex) -> Complex:
    """Return the unit direction (B,) to the leg's point that is max(R, 5 m) away."""
    rest = offset * leg.along.conj()
    reach = np.maximum(leg.radius, _LOOKAHEAD)
    ahead = np.sqrt(np.maximum(reach * reach - rest.imag * rest.imag, 0.0))
    aim = ahead + 1j * rest.imag
    return np.where(rest.real > 0, aim * leg.along / (np.abs(aim) + _TINY), straight)
