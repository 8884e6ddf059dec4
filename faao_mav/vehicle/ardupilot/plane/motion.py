"""An aeroplane as a point in coordinated turns, and the guidance that banks it."""

import cmath
import math

from faao_mav.vehicle.ardupilot.plane.parameters import ArduPlaneLimits

STEP = 0.1
"""The step of the simulation, s. Chosen; what a change costs is not measured."""

_GRAVITY = 9.80665
"""Standard gravity, m/s²."""

_ROLL_LAG = 0.5
"""Time constant of the bank, s: ArduPlane's default RLL2SRV_TCONST."""

_ENERGY_LAG = 5.0
"""Time constant of airspeed and height, s: ArduPlane's default TECS_TIME_CONST."""

_INTERCEPT = math.radians(45)
"""Steepest angle at which a track is approached."""


class Motion:
    """Where the aircraft is and how it moves on.

    Guidance is Park, Deyst and How's (AIAA 2004-4900) in ArduPilot's form: with damping ζ and
    period T the aircraft aims at a point L = ζ T V / π ahead on its track, by the lateral
    acceleration 4 ζ² V² / L sin η, η the angle from its course to that point.
    """

    def __init__(
        self, limits: ArduPlaneLimits, place: complex, height: float, course: float, speed: float
    ) -> None:
        self.time = 0.0
        self.place = place
        self.course = course
        self._limits, self._height, self._speed = limits, height, speed
        self._bank = self._climb = 0.0

    def sample(self) -> tuple[float, ...]:
        """Return time, place (east, north, up) and velocity, SI."""
        velocity = cmath.rect(self._ground_speed(), self.course)
        place = self.place
        return (
            self.time,
            place.real,
            place.imag,
            self._height,
            velocity.real,
            velocity.imag,
            self._climb,
        )

    def look_ahead(self) -> float:
        """Return L, m."""
        return self._limits.look_ahead * self._speed

    def bearing_to(self, place: complex) -> float:
        """Return the angle from the course to `place`, rad, positive to the left."""
        return cmath.phase((place - self.place) * cmath.rect(1.0, -self.course))

    def along(
        self, start: complex, end: complex, heights: tuple[float, float], speed: float
    ) -> None:
        """Go on by one step along the track from `start` to `end`, between `heights`, m."""
        leg = end - start
        if leg == 0:
            self._go(self._towards(end), heights[1], 0.0, speed)
            return
        track = leg / abs(leg)
        offset = (self.place - start) * track.conjugate()
        limit = math.sin(_INTERCEPT)
        approach = math.asin(min(max(offset.imag / self.look_ahead(), -limit), limit))
        eta = cmath.phase(track * cmath.rect(1.0, -approach - self.course))
        done = min(max(offset.real / abs(leg), 0.0), 1.0)
        slope = (heights[1] - heights[0]) / abs(leg) if 0 < done < 1 else 0.0
        height = heights[0] + done * (heights[1] - heights[0])
        self._go(self._lateral(eta), height, slope * self._speed, speed)

    def round(self, centre: complex, radius: float, height: float, speed: float) -> bool:
        """Go on by one step towards and round the circle; return whether it is being flown.

        The circle's acceleration is V²/d plus a spring and damper on d - R with the guidance's
        period and damping, d the distance from `centre`; a negative `radius` turns left. From
        outside, the straight way to the centre is flown until that asks for less of a turn.
        """
        side = -math.copysign(1.0, radius)
        offset = self.place - centre
        distance = max(abs(offset), abs(radius) / 2)
        velocity = cmath.rect(self._speed, self.course)
        outward = (velocity * offset.conjugate()).real / distance
        stiffness = 2 * math.pi / self._limits.period
        excess = abs(offset) - abs(radius)
        inward = (
            self._speed**2 / distance
            + stiffness**2 * excess
            + 2 * self._limits.damping * stiffness * outward
        )
        straight = self._towards(centre)
        circling = excess <= 0 or side * straight >= inward
        self._go(side * inward if circling else straight, height, 0.0, speed)
        return circling

    def _towards(self, place: complex) -> float:
        return self._lateral(self.bearing_to(place))

    def _lateral(self, eta: float) -> float:
        """Return the acceleration to the left that turns the course by `eta` rad."""
        bounded = min(max(eta, -math.pi / 2), math.pi / 2)
        gain = 4 * self._limits.damping**2
        return gain * self._speed**2 / self.look_ahead() * math.sin(bounded)

    def _go(self, lateral: float, height: float, climb: float, speed: float) -> None:
        """Move on for one step with `lateral` acceleration to the left, m/s², as far as it goes."""
        limits = self._limits
        bank = math.atan2(lateral, _GRAVITY)
        bank = min(max(bank, -limits.roll_limit), limits.roll_limit)
        self._bank += (bank - self._bank) * (1 - math.exp(-STEP / _ROLL_LAG))
        self._speed += (speed - self._speed) * (1 - math.exp(-STEP / _ENERGY_LAG))
        rate = climb + (height - self._height) / _ENERGY_LAG
        self._climb = min(max(rate, -limits.descent_speed), limits.climb_speed)
        turn = _GRAVITY * math.tan(self._bank) / self._speed * STEP
        self.place += cmath.rect(self._ground_speed() * STEP, self.course + turn / 2)
        self.course += turn
        self._height += self._climb * STEP
        self.time += STEP

    def _ground_speed(self) -> float:
        return math.sqrt(max(self._speed**2 - self._climb**2, 0.0))
