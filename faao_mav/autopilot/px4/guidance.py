"""The velocity that PX4 asks for on its way along a leg."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, sqrt
from typing import TypeVar

from faao_mav.arrays import Real
from faao_mav.autopilot.px4.parameters import Px4Limits

_ALIGNED = 0.98
"""The cosine of the angle between velocity and target from which an aircraft no longer counts as
turning (about 11 degrees). PX4's own."""

_BLEND = 0.001
"""Half the range of that cosine over which turning fades: flights then depend smoothly on their
speeds. Chosen; ten times as much ends turns up to 2 s too early in recorded flights."""

_LOOKAHEAD = 5.0
"""The least distance, m, at which a turning aircraft aims along its leg. PX4's own."""

_SLOW = 0.5
"""The least speed, m/s, to which the slower of the horizontal and the vertical motion holds up the
other. PX4's own."""

_TINY = 1e-9
"""Added to lengths, so that nothing is divided by 0."""


_Speed = TypeVar("_Speed", float, Real)


@dataclass(frozen=True, slots=True)
class GuidedLeg:
    """A leg: horizontal places and directions are complex, east + i north.

    `origin` m is where the leg begins, `target` m and `height` m are its end, `length` m is between
    them, infinite for none, `along` and `onward` are the unit directions of this leg and the next
    (0 where there is none), `speed` m/s the command, `radius` m the acceptance radius,
    `hold` s how long to wait at the end; `exit_speed` and `exit_climb` m/s bound how fast the end
    is passed; farther than `braking` m from it the command holds whatever comes next.
    """

    origin: complex
    target: complex
    height: float
    length: float
    along: complex
    onward: complex
    speed: float
    radius: float
    hold: float
    exit_speed: float
    exit_climb: float
    braking: float


def stopping_speed(jerk: float, acceleration: float, distance: float, final: float) -> float:
    """Return the speed from which PX4 trusts itself to reach `final` m/s within `distance` m.

    v = (-b + sqrt(b² + 8 a d + 4 v_f²)) / 2 with b = 4 a² / j, at least v_f.
    """
    b = 4 * acceleration * acceleration / jerk
    speed = (sqrt(b * b + 8 * acceleration * distance + 4 * final * final) - b) / 2
    return max(speed, final)


def stopping_distance(jerk: float, acceleration: float, speed: _Speed) -> _Speed:
    """Return from how far, m, `stopping_speed` to rest is `speed`: d = v (v + b) / 2 a."""
    return speed * (speed + 4 * acceleration * acceleration / jerk) / (2 * acceleration)


def legs(
    limits: Px4Limits,
    points: Real,
    radii: Sequence[float],
    speeds: Sequence[float],
    holds: Sequence[float],
) -> list[GuidedLeg]:
    """Return the legs between `points` (m, 3), m - 1 of them.

    `radii` are (m,), `speeds` (m - 1,), `holds` (m,). Only the waypoint after the target is
    looked at: the aircraft must be able to stop there, and it stops at the target if there is
    none, if it is told to hold, or if the next waypoint lies within the acceptance radius.
    """
    places = [complex(east, north) for east, north, _ in points.tolist()]
    heights = points[:, 2].tolist()
    moves = [end - start for start, end in pairwise(places)] + [0j]
    rises = [end - start for start, end in pairwise(heights)] + [0.0]
    along = [move / abs(move) if abs(move) > _TINY else 0j for move in moves]
    result = []
    for k, speed in enumerate(speeds):
        following, hold = abs(moves[k + 1]), holds[k + 1]
        ahead = stopping_speed(limits.jerk, limits.acceleration, following, 0.0)
        passable = following > 1e-3 and following >= radii[k + 1] and hold <= 0
        slopes = complex(abs(moves[k]), rises[k]), complex(following, rises[k + 1])
        result.append(
            GuidedLeg(
                origin=places[k],
                target=places[k + 1],
                height=heights[k + 1],
                length=abs(moves[k]) if along[k] else inf,
                along=along[k],
                onward=along[k + 1],
                speed=speed,
                radius=radii[k + 1],
                hold=hold,
                exit_speed=min(ahead, speed) if passable else 0.0,
                exit_climb=_exit_climb(limits, *slopes) if hold <= 0 else 0.0,
                braking=stopping_distance(limits.jerk, limits.acceleration, speed),
            )
        )
    return result


def _exit_climb(limits: Px4Limits, slope: complex, onward: complex) -> float:
    """Return the vertical speed at which the end of a leg may be passed, m/s.

    `slope` and `onward` are this leg and the next, m: along the ground + i upwards.
    """
    scale = abs(slope) * abs(onward)
    if abs(onward.imag) <= 1e-3 or scale <= _TINY:
        return 0.0
    cosine = (slope * onward.conjugate()).real / scale
    acceleration = limits.climb_acceleration if slope.imag > 0 else limits.descent_acceleration
    return sqrt(acceleration * limits.height_radius * _half_turn(cosine))


def _half_turn(cosine: float) -> float:
    """Return cot(θ/2) for the cosine of the turn θ between two legs."""
    return sqrt(max(1 + cosine, 0.0) / max(1 - cosine, 1e-9))


def level_setpoint(
    limits: Px4Limits, leg: GuidedLeg, place: complex, velocity: complex, remembered: float
) -> tuple[complex, float, float]:
    """Return the unit direction and the speed, m/s, asked for, and the speed to remember for turns.

    `place` m and `velocity` m/s are the trajectory's. The speed is the least of the command, what
    can be slowed to the passing speed at the target in time, and in a turn what was allowed before
    it. The direction is to the target, in a turn to a point of the leg max(R, 5 m) away.
    """
    offset = leg.target - place
    distance = abs(offset) + _TINY
    direction = offset / distance
    allowed = leg.speed
    if distance < leg.braking:
        allowed = min(allowed, _slowing(limits, leg, direction, distance))
    speed = abs(velocity)
    cosine = (velocity * direction.conjugate()).real / (speed + _TINY)
    if cosine >= _ALIGNED + _BLEND:
        return direction, allowed, allowed
    astray = _ramp((_ALIGNED + _BLEND - cosine) / (2 * _BLEND))
    moving = _ramp((speed - 0.1) / 0.2)
    outside = _ramp((distance - leg.radius) / 0.2 + 0.5)
    turning = astray * moving * outside
    return (
        direction + turning * (_along_leg(leg, offset, direction) - direction),
        allowed + turning * (min(remembered, allowed) - allowed),
        allowed + turning * (remembered - allowed),
    )


def corner_speed(gain: float, acceleration: float, radius: float, cosine: float) -> float:
    """Return how fast PX4 passes a waypoint of acceptance `radius`, m, where it turns, m/s.

    sqrt(g a R cot(θ/2)) with g = MPC_XY_TRAJ_P and `cosine` that of the turn θ.
    """
    return sqrt(gain * acceleration * radius * _half_turn(cosine))


def _slowing(limits: Px4Limits, leg: GuidedLeg, direction: complex, distance: float) -> float:
    """Return the speed from which the target `distance` away is passed slowly enough.

    The passing speed is the corner's, at most the leg's `exit_speed`.
    """
    cosine = (direction * leg.onward.conjugate()).real
    corner = corner_speed(limits.corner_gain, limits.acceleration, leg.radius, cosine)
    passing = min(corner, leg.exit_speed)
    return stopping_speed(limits.jerk, limits.acceleration, distance, passing)


def _ramp(share: float) -> float:
    return min(max(share, 0.0), 1.0)


def _along_leg(leg: GuidedLeg, offset: complex, straight: complex) -> complex:
    """Return the unit direction to the leg's point that is max(R, 5 m) away."""
    rest = offset * leg.along.conjugate()
    if rest.real <= 0:
        return straight
    reach = max(leg.radius, _LOOKAHEAD)
    aim = complex(sqrt(max(reach * reach - rest.imag * rest.imag, 0.0)), rest.imag)
    return aim * leg.along / (abs(aim) + _TINY)


def climb_setpoint(
    limits: Px4Limits, leg: GuidedLeg, distance: float, height: float, speed: float
) -> tuple[float, float]:
    """Return the horizontal speed and the vertical velocity asked for, m/s.

    The target is `distance` m away, `speed` m/s is asked for without regard to climbing. The slower
    of the two directions holds up the other, for a straight line to the target.
    """
    rise = leg.height - height
    up = rise > 0
    fastest = limits.climb_speed if up else limits.descent_speed
    acceleration = limits.climb_acceleration if up else limits.descent_acceleration
    left = abs(rise) + _TINY
    distance += _TINY
    slowing = stopping_speed(limits.jerk, acceleration, left, min(leg.exit_climb, fastest))
    climb = min(fastest, slowing)
    vertical = min(climb, max(speed, _SLOW) * left / distance)
    speed = min(speed, max(climb, _SLOW) * distance / left)
    return speed, vertical if up else -vertical
