"""What bounds a flight of ArduCopter, and how its target moves along straight legs.

It goes in ramps and cruises, which overlap at corners.

A ramp changes the speed by d within the acceleration A and the jerk J, which takes t_j s to rise.
Its acceleration grows for r s, stays at a, and falls as it grew; in all it takes D s:

    r = a/J + t_j,    a = min(A, d/r),    D = d/a + r

The autopilot's jerk rises along half a cosine; here it steps, half of t_j later.

A leg of l metres is planned from rest to rest at the speed that is in force when it begins: that of
the leg before, where they are joined. Its own comes into force half-way through their overlap. A
lower one shortens what is left of the first ramp, which ends at p then; from p a second ramp leads
to the speed e, if the cruise has room for one. A last ramp ends at rest.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.body import ARDUCOPTER_BODY, CopterBody
from faao_mav.autopilot.model import Model, parameter
from faao_mav.files import numbers
from faao_mav.geodesy import LocalFrame
from faao_mav.power import GRAVITY

FACTS = numbers("autopilot/constants.tsv", model="arducopter")


@dataclass(frozen=True, slots=True)
class ArduCopterLimits(Model):
    """What bounds a flight of ArduCopter, in SI units.

    A `corner_acceleration` of 0 stands for twice `acceleration`. `latitude` is that of the flight,
    degrees, None where metres are the autopilot's, which takes the Earth for a sphere. `body` is
    the aircraft.
    """

    cruise_speed: float = parameter("m/s", 10.0, "WP_SPD", "WPNAV_SPEED")
    climb_speed: float = parameter("m/s", 2.5, "WP_SPD_UP", "WPNAV_SPEED_UP")
    descent_speed: float = parameter("m/s", 1.5, "WP_SPD_DN", "WPNAV_SPEED_DN")
    acceleration: float = parameter("m/s^2", 2.5, "WP_ACC", "WPNAV_ACCEL")
    climb_acceleration: float = parameter("m/s^2", 1.0, "WP_ACC_Z", "WPNAV_ACCEL_Z")
    corner_acceleration: float = parameter("m/s^2", 0.0, "WP_ACC_CNR", "WPNAV_ACCEL_C", least=0.0)
    jerk: float = parameter("m/s^3", 1.0, "WP_JERK", "WPNAV_JERK", 1.0)
    radius: float = parameter("m", 2.0, "WP_RADIUS_M", "WPNAV_RADIUS", least=0.05)
    lean_angle: float = parameter("rad", 30, "ATC_ANGLE_MAX", "ANGLE_MAX", least=5, greatest=85)
    input_time: float = parameter("s", 0.15, "ATC_INPUT_TC", least=0.0)
    roll_acceleration: float = parameter(
        "rad/s^2", 1100, "ATC_ACC_R_MAX", "ATC_ACCEL_R_MAX", least=0.0
    )
    pitch_acceleration: float = parameter(
        "rad/s^2", 1100, "ATC_ACC_P_MAX", "ATC_ACCEL_P_MAX", least=0.0
    )
    position_gain: float = parameter("1/s", 1.0, "PSC_NE_POS_P", "PSC_POSXY_P", 1.0)
    velocity_gain: float = parameter("1/s", 2.0, "PSC_NE_VEL_P", "PSC_VELXY_P", 1.0)
    velocity_integral: float = parameter("1/s^2", 1.0, "PSC_NE_VEL_I", "PSC_VELXY_I", 1.0, least=0)
    latitude: float | None = None
    body: CopterBody = ARDUCOPTER_BODY

    @property
    def scale(self) -> Real:
        """The autopilot's metres per metre, east, north and up, (3,)."""
        if self.latitude is None:
            return np.ones(3)
        there = LocalFrame(self.latitude, 0.0).to_geodetic([1.0, 1.0])
        return np.append(ARDUPILOT.local_frame(self.latitude, 0.0).to_local(*there), 1.0)

    @property
    def rise(self) -> float:
        """t_j: how long the jerk takes to rise, s: twice ATC_INPUT_TC, or what leaning allows."""
        agility = min(self.roll_acceleration or math.inf, self.pitch_acceleration or math.inf)
        asked = 2 * max(self.input_time, FACTS.least_input_time)
        return max(asked, math.pi * self.jerk / (GRAVITY * agility))

    def ramp(self, change: Real, acceleration: Real | float | None = None) -> "Ramp":
        """Return ramps by `change` >= 0, m/s, within its own or another `acceleration`, m/s²."""
        most, jerk, rise = acceleration, self.jerk, self.rise
        most = self.acceleration if most is None else most
        free = (rise + np.sqrt(rise**2 + 4 * change / jerk)) / 2
        full = most / jerk + rise
        steady = change > most * full
        duration = np.where(steady, change / most + full, 2 * free) * (change > 0)
        return Ramp(duration, np.where(steady, full, free), rise / 2)


def largest(function: Callable[[Real], Real], value: Real, most: Real | float) -> Real:
    """Return the largest x, 0 to `most`, at which the rising `function` is at most `value`."""
    low = np.zeros(np.broadcast_shapes(np.shape(value), np.shape(most)))
    high = low + most
    if np.all(function(high) <= value):  # as for most legs
        return high
    for _ in range(int(FACTS.halvings)):
        middle = (low + high) / 2
        under = function(middle) <= value
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    begin, end = function(low), function(high)
    share = np.clip((value - begin) / np.maximum(end - begin, 1e-12), 0.0, 1.0)
    found: Real = low + share * (high - low)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Ramp:
    """Ramps: how long they last, `duration`, and their accelerations grow, `edge`, s, one shape.

    For `dead` seconds, t_j / 2, at either end of what grows hardly anything happens.
    """

    duration: Real
    edge: Real
    dead: float

    def __getitem__(self, which: Any) -> "Ramp":
        """Return some of them."""
        return Ramp(self.duration[which], self.edge[which], self.dead)

    def at(self, t: Real) -> Real:
        """Return distance, speed and acceleration at `t` s from their beginnings, for d = 1 m/s.

        They are (3, ...). Before all are 0, afterwards the speed is 1.
        """
        x = np.clip(t, 0.0, self.duration)
        y = np.minimum(x, self.duration - x) - self.dead  # the second half mirrors the first
        edge = np.maximum(self.edge - 2 * self.dead, 1e-9)
        rising, peak = np.clip(y, 0.0, edge), 1 / (self.duration - self.edge)
        steady = np.maximum(y, 0.0) - rising
        way = rising**3 / edge / 6 + steady * (edge + steady) / 2
        speed = rising**2 / edge / 2 + steady
        acceleration = peak * rising / edge
        late = x > self.duration / 2
        distance = np.where(late, x - self.duration / 2, 0.0) + peak * way + np.maximum(t - x, 0.0)
        return np.array([distance, np.where(late, 1 - peak * speed, peak * speed), acceleration])


@dataclass(frozen=True, eq=False)
class StraightLegs:
    """Legs of `lengths` (m - 1,), m, along which `accelerations`, m/s², are the greatest.

    `joined` (m - 1,) marks those that follow one without a stop.

    >>> from faao_mav.autopilot.ardupilot.copter import ArduCopter
    >>> joined, limits = np.array([False, True, True]), ArduCopter(acceleration=3.0, jerk=5.0)
    >>> legs = StraightLegs(np.array([50.0, 12.0, 50.0]), joined, limits)
    >>> flown, durations = legs.flown(np.array([4.0, 8.0, 8.0]))
    >>> flown, durations.round(1)  # the second leg is too short to be faster than the first
    (array([4., 4., 8.]), array([13.6,  3. ,  8.7]))
    """

    lengths: Real
    joined: Flags
    limits: ArduCopterLimits
    accelerations: Real | None = None

    def ramp(self, change: Real) -> Ramp:
        """Return ramps by `change` (..., m - 1), m/s."""
        return self.limits.ramp(change, self.accelerations)

    @cached_property
    def top(self) -> Real:
        """The greatest speeds that the legs come to, (m - 1,), m/s; above 0 without a length."""
        found = largest(lambda v: v * self.ramp(v).duration, self.lengths, FACTS.fastest)
        return np.maximum(found, 1e-3)

    @property
    def most(self) -> Real:
        """The greatest commands that make a difference, (m - 1,), m/s.

        A command above what a leg comes to still tells how the next one begins.
        """
        following: Real = np.append(self.top[1:] * self.joined[1:], 0.0)
        return np.maximum(self.top, following)

    def speeds(
        self, begun: Real, told: Real, elapsed: Real | None = None
    ) -> tuple[Real, Real, Real]:
        """Return the speeds that the legs are planned at, p and e, (..., m - 1), m/s.

        `begun` are those in force when they begin, `told` their own, m/s, of one shape.
        """
        begun = np.minimum(begun, self.top)
        first = self.ramp(begun)
        elapsed = first.duration / 2 if elapsed is None else elapsed
        edge, rest = first.edge, first.duration - first.edge
        lowered = begun * np.maximum(elapsed, edge) / rest
        planned = np.minimum(begun, np.maximum(told, lowered))
        cruise = self.lengths - planned * self.ramp(planned).duration
        room = cruise / (FACTS.jerk_times * min(self.limits.rise, 1.0))
        wanted = np.where(room > planned, np.minimum(told, room), planned)
        slower, change = np.minimum(planned, wanted), np.abs(wanted - planned)
        fits = largest(lambda d: (slower + d / 2) * self.ramp(d).duration, cruise / 2, change)
        return begun, planned, planned + np.copysign(fits, wanted - planned)

    def flown(self, speeds: Real) -> tuple[Real, Real]:
        """Return e, m/s, and how long the legs take, s, at level commands `speeds` (..., m - 1).

        That is from passing one end to passing the other. An overlap is as long as the shorter of
        its ramps; that it is shorter in a sharp corner is left out.
        """
        begun = speeds.copy()
        begun[..., 1:] = np.where(self.joined[1:], speeds[..., :-1], speeds[..., 1:])
        begun, planned, top = self.speeds(begun, speeds)
        first, second, last = (self.ramp(d).duration for d in (planned, abs(top - planned), top))
        lasting = self.lengths / top + last / 2 + first * (1 - planned / (2 * top))
        lasting += second * (top - planned) / (2 * top)
        half = np.minimum(last[..., :-1], self.ramp(begun).duration[..., 1:]) / 2 * self.joined[1:]
        lasting[..., :-1] -= half
        lasting[..., 1:] -= half
        return top, lasting
