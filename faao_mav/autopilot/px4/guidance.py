"""What PX4 asks of a multicopter along a leg: limits, velocity, how a trajectory follows that."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import copysign, sqrt
from typing import NamedTuple

import numpy as np

from faao_mav.autopilot.body import PX4_BODY, CopterBody
from faao_mav.autopilot.model import TINY, FlightPath, Model, parameter, unit
from faao_mav.files import numbers

FACTS = numbers("autopilot/constants.tsv", model="px4")


@dataclass(frozen=True, slots=True)
class GuidedLeg:
    """A leg: horizontal places and directions are complex, east + i north.

    `origin` m is where the leg begins, `target` m and `height` m are its end, `along` and `onward`
    the unit directions of this leg and the next (0 where there is none), `speed` m/s the command,
    `radius` m the acceptance radius, `hold` s how long to wait at the end; `exit_speed` and
    `exit_climb` m/s bound how fast the end is passed.
    """

    origin: complex
    target: complex
    height: float
    along: complex
    onward: complex
    speed: float
    radius: float
    hold: float
    exit_speed: float
    exit_climb: float


@dataclass(frozen=True, slots=True)
class Px4Limits(Model):
    """What bounds a multicopter's flight, in SI units; `body` is the aircraft.

    In missions it climbs at MPC_Z_V_AUTO_UP, which PX4 lowers to MPC_Z_VEL_MAX_UP (mc_pos_control,
    parameters_update); likewise down, and over the ground.
    """

    cruise_speed: float = parameter("m/s", 5.0, "MPC_XY_CRUISE", capped_by="max_speed")
    max_speed: float = parameter("m/s", 12.0, "MPC_XY_VEL_MAX")
    acceleration: float = parameter("m/s^2", 3.0, "MPC_ACC_HOR")
    jerk: float = parameter("m/s^3", 4.0, "MPC_JERK_AUTO")
    corner_gain: float = parameter("1/s", 0.5, "MPC_XY_TRAJ_P", least=0.01)
    error_limit: float = parameter("m", 2.0, "MPC_XY_ERR_MAX")
    acceptance_radius: float = parameter("m", 2.0, "NAV_ACC_RAD", least=0.05)
    height_radius: float = parameter("m", 0.8, "NAV_MC_ALT_RAD", least=0.05)
    climb_speed: float = parameter("m/s", 3.0, "MPC_Z_V_AUTO_UP", capped_by="max_climb_speed")
    descent_speed: float = parameter("m/s", 1.5, "MPC_Z_V_AUTO_DN", capped_by="max_descent_speed")
    climb_acceleration: float = parameter("m/s^2", 4.0, "MPC_ACC_UP_MAX")
    descent_acceleration: float = parameter("m/s^2", 3.0, "MPC_ACC_DOWN_MAX")
    body: CopterBody = PX4_BODY

    def stopping_speed(
        self, distance: float, final: float = 0.0, acceleration: float | None = None
    ) -> float:
        """Return the speed from which PX4 trusts itself to reach `final` m/s within `distance` m.

        v = (-b + sqrt(b² + 8 a d + 4 v_f²)) / 2 with b = 4 a² / j, at least v_f.
        """
        a = self.acceleration if acceleration is None else acceleration
        b = 4 * a * a / self.jerk
        speed = (sqrt(b * b + 8 * a * distance + 4 * final * final) - b) / 2
        return max(speed, final)

    def vertical(self, rise: float) -> tuple[float, float]:
        """Return the greatest speed, m/s, and acceleration, m/s², of a climb by `rise`, m."""
        if rise > 0:
            return self.climb_speed, self.climb_acceleration
        return self.descent_speed, self.descent_acceleration

    def passing_speed(self, radius: float, cosine: float) -> float:
        """Return how fast PX4 passes a waypoint of acceptance `radius`, m, where it turns, m/s.

        sqrt(g a R cot(θ/2)) with g = MPC_XY_TRAJ_P and `cosine` that of the turn θ.
        """
        half_turn = sqrt(max(1 + cosine, 0.0) / max(1 - cosine, 1e-9))
        return sqrt(self.corner_gain * self.acceleration * radius * half_turn)

    def legs(self, path: FlightPath) -> list[GuidedLeg]:
        """Return the legs of `path`.

        Only the waypoint after the target is looked at: the aircraft must be able to stop there,
        and it stops at the target if there is none, if it is told to hold, or if the next waypoint
        lies within the acceptance radius. It goes on climbing there if the next leg does.
        """
        speeds = np.where(path.speeds > 0, path.speeds, self.cruise_speed)
        speeds = np.minimum(speeds, self.max_speed)
        radii = np.where(path.radii > 0, path.radii, self.acceptance_radius)[1:]
        radii = np.maximum(radii, FACTS.nearest)
        places, heights = path.points[:, 0] + 1j * path.points[:, 1], path.points[:, 2]
        moves, rises = np.append(np.diff(places), 0j), np.append(np.diff(heights), 0.0)
        following, holding = np.abs(moves[1:]), path.holds[1:] > 0
        ahead = np.array([self.stopping_speed(each) for each in following.tolist()])
        passable = (following > 1e-3) & (following >= radii) & ~holding
        climbs_on = (rises[:-1] * rises[1:] > 0) & ~holding
        climbs = np.where(rises[:-1] > 0, self.climb_speed, self.descent_speed)
        ways = np.array([unit(move) for move in moves.tolist()])
        where = places[:-1], places[1:], heights[1:], ways[:-1], ways[1:]
        exits = np.minimum(ahead, speeds) * passable, climbs * climbs_on
        how = speeds, radii, np.maximum(path.holds[1:], 0.0), *exits
        columns = (each.tolist() for each in (*where, *how))
        return [GuidedLeg(*each) for each in zip(*columns, strict=True)]

    def headed(self, leg: GuidedLeg, place: complex) -> GuidedLeg:
        """Return the leg that PX4 makes of `leg` for an aircraft at `place`, m.

        It heads for the leg's end; from behind its beginning and farther from there than the radius
        first for the beginning, from farther beside it for its nearest point: so a waypoint that
        was accepted from afar is flown to first if the next radius is small. On such a detour it
        passes towards the end, and nothing is known of what follows. (FlightTaskAuto)
        """
        way = (place - leg.origin) * leg.along.conjugate()
        if not leg.along:
            return leg
        if way.real > abs(leg.target - leg.origin):
            return replace(leg, along=unit(leg.target - place))
        if way.real < 0 and abs(way) > leg.radius:
            target = leg.origin
        elif abs(way.imag) > leg.radius:
            target = leg.origin + way.real * leg.along
        else:
            return leg
        following, exit_speed = abs(leg.target - target), 0.0
        if following >= leg.radius:
            exit_speed = min(self.stopping_speed(following), leg.speed)
        along = unit(target - place)
        return replace(leg, target=target, along=along, onward=leg.along, exit_speed=exit_speed)

    def level_setpoint(
        self, leg: GuidedLeg, place: complex, velocity: complex, remembered: float
    ) -> tuple[complex, float, float]:
        """Return unit direction and speed, m/s, asked for, and the speed to remember for turns.

        `place` m and `velocity` m/s are the trajectory's. The speed is the least of the command,
        what can be slowed to the passing speed at the target in time, and in a turn what was
        allowed before it. The direction is to the target, in a turn to a point of the leg that is
        max(R, 5 m) away. The target is passed with a corner's speed, at most its `exit_speed`.
        """
        offset = leg.target - place
        distance = abs(offset) + TINY
        direction = offset / distance
        corner = self.passing_speed(leg.radius, (direction * leg.onward.conjugate()).real)
        passing = min(corner, leg.exit_speed)
        slowing = self.stopping_speed(distance, passing)
        allowed, speed = min(leg.speed, slowing), abs(velocity)
        heading = (velocity * direction.conjugate()).real / (speed + TINY)
        if heading >= FACTS.aligned or speed <= FACTS.moving or distance <= leg.radius:
            return direction, allowed, allowed
        rest = offset * leg.along.conjugate()
        if rest.real > 0:
            reach = max(leg.radius, FACTS.look_ahead)
            aim = complex(sqrt(max(reach * reach - rest.imag * rest.imag, 0.0)), rest.imag)
            direction = unit(aim * leg.along)
        return direction, min(allowed, remembered), remembered

    def climb_setpoint(
        self, leg: GuidedLeg, distance: float, height: float, speed: float
    ) -> tuple[float, float]:
        """Return the horizontal speed and the vertical velocity asked for, m/s.

        The target is `distance` m away, `speed` m/s is asked for without regard to climbing. The
        slower of the two directions holds up the other, for a straight line to the target.
        """
        rise = leg.height - height
        fastest, acceleration = self.vertical(rise)
        left, distance = abs(rise) + TINY, distance + TINY
        climb = min(fastest, self.stopping_speed(left, leg.exit_climb, acceleration))
        vertical = min(climb, max(speed, FACTS.slow) * left / distance)
        speed = min(speed, max(climb, FACTS.slow) * distance / left)
        return speed, copysign(vertical, rise)


class Axis(NamedTuple):
    """Position, m, velocity, m/s, and acceleration, m/s², of the trajectory along one axis."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


def follow(
    axes: Sequence[Axis],
    setpoints: Sequence[float],
    limits: Sequence[float],
    jerk: float,
    dt: float,
) -> list[Axis]:
    """Return the axes after `dt` s of pursuing the velocities `setpoints`, m/s, in step.

    Every axis ramps its acceleration up, keeps it and ramps it down, by the `jerk` j, m/s³, with
    `limits` as the greatest accelerations, m/s². With direction such that the velocity must rise,
    acceleration a and velocity error e, q² = a²/2 + j e, an axis alone takes
    T = (p + q²/p - a) / j with the peak p = min(q, limit). All take the longest T, so the peaks are
    the roots p of p² - (j T + a) p + q² = 0; one that already accelerates more keeps that up. At
    the end of the step an axis accelerates as much as it loses, by the jerk, until it is there.
    """
    ramps = []
    for axis, setpoint, limit in zip(axes, setpoints, limits, strict=True):
        a = axis.acceleration
        rest = setpoint - axis.velocity - a * abs(a) / (2 * jerk)
        start = a if rest >= 0 else -a
        square = TINY**2 + jerk * abs(rest) + max(start, 0.0) ** 2
        peak = min(sqrt(square), limit)
        ramps.append((start, square, peak + square / peak - start))
    total = max([ramp[-1] for ramp in ramps])
    after = []
    for (position, velocity, a), setpoint, (start, square, _) in zip(
        axes, setpoints, ramps, strict=True
    ):
        half, error = (total + start) / 2, setpoint - velocity - a * dt / 2
        peak = max(square / (half + sqrt(max(half * half - square, 0.0))), start)
        most = jerk * (sqrt(dt * dt + 2 * abs(error) / jerk) - dt)
        change = copysign(min(peak, most), error) - a
        change = min(max(change, -jerk * dt), jerk * dt)
        moved = (velocity + a * dt / 2 + change * dt / 6) * dt
        after.append(Axis(position + moved, velocity + (a + change / 2) * dt, a + change))
    return after
