"""ArduCopter: what it is, and how it flies: a target, a controller that follows it, an airframe."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot import COPTER_DIALECT, ardupilot_type, at_fence
from faao_mav.autopilot.ardupilot.legs import FACTS, ArduCopterLimits, StraightLegs
from faao_mav.autopilot.ardupilot.target import Target
from faao_mav.autopilot.body import ARDUCOPTER_BODY
from faao_mav.autopilot.manners import Modes, failsafes
from faao_mav.autopilot.model import STEP, Copter, Flight, FlightPath, Flown, Orbit
from faao_mav.autopilot.parameter import ParameterValues, Recommended, parameters_of, table
from faao_mav.autopilot.vehicle_type import lean_acceleration, orbit_at
from faao_mav.errors import InputError
from faao_mav.mission.command import Command
from faao_mav.mission.item import MissionItem


@dataclass(frozen=True, slots=True)
class ArduCopter(ArduCopterLimits):
    """ArduCopter 4.1 and later in AUTO, in steady wind. SI units; the defaults are its own.

    What is flown: a target moves along jerk-limited legs, each planned from rest to rest, which
    overlap at corners; its clock waits for an aircraft that falls behind; a position controller
    with limited lean angle follows it. The aircraft therefore starts late, overshoots stops by up
    to a metre, and comes to its full speed only seconds after its target. Acceptance radii of
    waypoints are not stored by this autopilot, so `FlightPath.radii` do not count.
    """

    # Centimetres decide on shorter legs how long the target waits for an aircraft that has passed
    # it. Flown: a mission with 1.1 m before a hover left there 4.1 s late, one with 2.3 m 0.4 s.
    least: ClassVar[float] = 4.0
    # Measured, flown and planned, m rms, on a plan with two hovers at 9 m/s: with 0.4 6.0, with
    # 0.75 1.6, with 1.5 1.3; with 1.5 other plans need more items and twice the time to convert.
    slowest: ClassVar[float] = 0.75

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg that reaches `speed`, m: two ramps; same shape.

        >>> float(ArduCopter().shortest_leg(np.array(8.0)).round(1))
        48.0
        """
        return speed * self.ramp(speed).duration

    def leg_durations(self, lengths: Real, joined: Flags) -> StraightLegs:
        """Return how long straight legs of `lengths`, m, take."""
        return StraightLegs(lengths, joined, self)

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        The flight begins in a hover, nose to the north, held against the wind by the integral.
        Raises `InputError` for speeds that are not positive and finite, and for a flight that takes
        more than `path.longest`.
        """
        if not np.all(np.isfinite(path.speeds) & (path.speeds > 0)):
            raise InputError("flight path: expected speeds above 0")
        stopping, scale = path.holds > 0, self.scale
        stopping[[0, -1]] = True
        target = Target(path.points * scale, path.speeds, path.splines, stopping, self)
        flight = _Flight(self, path, target, stopping)
        shown = flight.follow(target.motion)
        arrivals = np.interp(target.passed, shown, STEP * np.arange(len(shown)))
        arrivals[stopping] = flight.arrivals
        flown = flight.flown(arrivals, arrivals + path.holds, step)
        return replace(flown, position=flown.position / scale, velocity=flown.velocity / scale)


class _Flight(Flight):
    """An aircraft that follows a target, whose clock slows down for it and stands at stops.

    The `clock`, s, goes on at the `rate`, which follows what is asked for with the time constant
    A/J; at stops it goes on when the flight has taken `resume` s. `arrivals`, s of the flight, are
    when it came to the stops so far. A position controller asks for the target's acceleration plus
    what the errors call for, up to the lean limit, where its `integral`, m/s², does not grow.
    """

    def __init__(
        self, limits: ArduCopterLimits, path: FlightPath, target: Target, stopping: Flags
    ) -> None:
        super().__init__(path.longest)
        stops, waits = target.passed[stopping].tolist(), path.holds[stopping].tolist()
        self._limits, self._lean = limits, lean_acceleration(limits.lean_angle)
        self._stops = list(zip(stops, waits, strict=True))
        self._clock, self._rate, self._resume, self.arrivals = 0.0, 1.0, waits[0], [0.0]
        self._adapting = -math.expm1(-STEP * limits.jerk / limits.acceleration)
        self._body = Copter(limits.body, complex(*target.motion[0, :2]), complex(*path.wind))
        self._integral = self._body.lean

    def follow(self, motion: Real) -> list[float]:
        """Follow the target's `motion` (n, 9), return what the clock shows at each step.

        The target's height is the aircraft's.
        """
        body, shown = self._body, list[float]()
        target = motion[:, ::3] + 1j * motion[:, 1::3]
        rows = list(zip(*target.T.tolist(), *motion[:, 2:6:3].T.tolist(), strict=True))
        while True:
            k = min(int(self._clock / STEP), len(rows) - 2)
            share = self._clock / STEP - k
            place, velocity, push, height, climb = (
                a + share * (b - a) for a, b in zip(rows[k], rows[k + 1], strict=True)
            )
            self.keep(body.place, height, body.velocity, self._rate * climb)
            shown.append(self._clock)
            if len(self.arrivals) == len(self._stops) and self.time >= self._resume:
                return shown
            error = place - body.place
            self._rate += (self._pace(error, velocity, climb) - self._rate) * self._adapting
            if abs(velocity) > FACTS.headed:
                body.nose = velocity / abs(velocity)
            body.move(self._asked(error, velocity, push), STEP)
            begin, self.time = self.time, STEP * len(shown)
            self._run(max(begin, self._resume))

    def _run(self, free: float) -> None:
        """Let the clock go on from `free`, s of the flight, until now, but for what is a stop."""
        while free < self.time and len(self.arrivals) < len(self._stops):
            stop, wait = self._stops[len(self.arrivals)]
            if (ahead := self._clock + self._rate * (self.time - free)) < stop:
                self._clock = ahead
                return
            free += (stop - self._clock) / self._rate if self._rate > 0 else 0.0
            self.arrivals.append(free)
            self._clock, self._resume = stop, free + wait
            free = self._resume

    def _pace(self, error: complex, target: complex, climb: float) -> float:
        """Return the rate asked of the target's clock, 0 to 1.

        It is the aircraft's speed along the target's, less the position error times its gain, over
        the target's speed, plus a margin.
        """
        square = abs(target) ** 2 + climb**2
        if square <= 1e-9:
            return 1.0
        kept = (self._body.velocity - self._limits.position_gain * error) * target.conjugate()
        return min(max(FACTS.margin + (kept.real + climb**2) / square, 0.0), 1.0)

    def _asked(self, error: complex, target: complex, push: complex) -> complex:
        """Return the acceleration that is asked for, m/s²; `push` is the target's."""
        limits, held, most = self._limits, self._integral, self._lean
        lack = target + limits.position_gain * error - self._body.velocity
        asked = push + limits.velocity_gain * lack + held
        self._integral += limits.velocity_integral * lack * STEP
        if abs(asked) <= most:
            return asked
        self._integral *= abs(held) / max(abs(held), abs(self._integral), 1e-9)
        if abs(target) < 1e-6:
            return asked * most / abs(asked)
        way = target / abs(target)
        turned = asked * way.conjugate()  # what is across the target's way comes first
        across = min(most, max(-most, turned.imag))
        along = math.sqrt(most**2 - across**2)
        return complex(min(along, max(-along, turned.real)), across) * way


_BRAKE = 17
_MODES = Modes(
    rest=0,
    mission=3,
    hold=_BRAKE,
    at_fence={"return": 6, "land": 9, "hold": _BRAKE},
    guided=4,
    not_to_arm_in=frozenset({3, 6, 7, 9, 14, 15, _BRAKE, 18, 21, 27}),
)
"""COPTER_MODE of MAVLink. ArduCopter 4.7 does not arm in AUTO (unless AUTO_OPTIONS is odd), RTL,
CIRCLE, LAND, FLIP, AUTOTUNE, BRAKE, SMART_RTL and AUTO_RTL, and takes off when thrown in THROW."""


def _orbit(vehicle: ParameterValues, item: MissionItem, _: float) -> Orbit | None:
    """Return how a NAV_LOITER_TURNS is flown (AC_Circle), turning by half of the acceleration.

    Negative radii turn left, and without one a negative CIRCLE_RATE does.
    """
    if item.command != Command.NAV_LOITER_TURNS:
        return None
    rate, orbit = vehicle.value("circle_rate"), orbit_at(vehicle, item)
    if orbit is None or orbit.radius == 0 or rate == 0:
        return None
    told = math.isfinite(item.params[2]) and item.params[2] != 0
    most = math.sqrt(vehicle.value("acceleration") / (2 * orbit.radius))
    clockwise = orbit.clockwise if told else rate > 0
    return replace(orbit, clockwise=clockwise, turn_rate=min(abs(rate), most))


ARDUCOPTER = ardupilot_type(
    kind="copter",
    name="ArduCopter",
    mav_types=(2, 3, 4, 13, 14, 15, 29, 35),
    modes=_MODES,
    hovers=True,
    parameters=table(*ArduCopter.parameters(), *parameters_of("arducopter")),
    dialect=COPTER_DIALECT,
    whole_second_holds=True,
    at_fence=at_fence({0: "report", 2: "land", 4: "hold"}),
    failsafes=failsafes("arducopter"),
    flight_model=ArduCopter.from_vehicle,
    recommendation=Recommended(4.0, (0.5, 5.0), {"jerk": FACTS.jerk}, {"jerk": FACTS.liveliest}),
    ceilings={"max_acceleration": ("lean_angle", "acceleration")},
    body=ARDUCOPTER_BODY,
    orbits=_orbit,
)
"""ArduCopter 4.1 and later; measured on 4.7."""
