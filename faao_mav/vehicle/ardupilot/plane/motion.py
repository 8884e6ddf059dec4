"""An aeroplane with the guidance that banks it and the energy that carries it."""

import cmath
import math

from faao_mav.power import GRAVITY
from faao_mav.vehicle.ardupilot.plane.energy import Energy
from faao_mav.vehicle.ardupilot.plane.parameters import ArduPlaneLimits
from faao_mav.vehicle.atmosphere import density_ratio

STEP = 0.1
"""The longest step of the simulation, s. Chosen; what a change costs is not measured."""

_INTERCEPT = math.sin(math.radians(45))
"""The sine of the steepest angle at which a track is approached (ArduPilot's L1 navigation)."""


class Track:
    """The leg from `start` to `end`, at the heights `begin` and `finish`, m."""

    def __init__(self, start: complex, end: complex, begin: float, finish: float) -> None:
        self.start, self.end, self.begin, self.finish = start, end, begin, finish
        self.leg = end - start
        self.length = abs(self.leg)
        self.course = self.leg / self.length if self.leg else 0j

    def passed(self, place: complex) -> float:
        """Return how far `place` is beyond the perpendicular through the end, m, below 0 before.

        It is 0 for a leg without a length.
        """
        if not self.leg:
            return 0.0
        return ((place - self.end) * self.leg.conjugate()).real / self.length


class Motion:
    """Where the aircraft is and how it moves on.

    Guidance is Park, Deyst and How's (AIAA 2004-4900) in ArduPilot's form: with damping ζ and
    period T the aircraft aims at a point L = ζ T V / π ahead on its track, by the lateral
    acceleration 4 ζ² V² / L sin η, η the angle from its course to that point. It banks for that
    as in a coordinated turn.

    Speed and height are held by total energy control: see `energy`.

    Banks and energy turn and speed up the flight through the air, which moves steadily at `wind`;
    guidance sees the flight over ground, the sum of both.

    Places and horizontal velocities are complex, east + i north, m and m/s; `climb` is m/s, angles
    are rad, positive to the left.
    """

    def __init__(
        self,
        limits: ArduPlaneLimits,
        altitude: float,
        place: complex,
        height: float,
        airspeed: complex,
        climb: float = 0.0,
        speed: float | None = None,
        wind: complex = 0j,
    ) -> None:
        """Start at `place` and `height` with the velocity `airspeed` through the air and a `climb`.

        `altitude`, m above sea level, is that of the air. `speed` is the true airspeed that is
        demanded so far, m/s; the flown one if it is not given.
        """
        self.time = 0.0
        self.place, self.heading = place, cmath.phase(airspeed)
        self._limits, self._wind, self._ahead = limits, wind, limits.look_ahead
        self._gain = 4 * limits.damping**2 / limits.look_ahead
        self._bank, density, flown = 0.0, density_ratio(altitude), math.hypot(abs(airspeed), climb)
        demand = flown if speed is None else speed
        self._energy = Energy(limits, density, height, flown, climb, demand)
        self._body, self._sideslip = limits.body, limits.body.sideslip * density
        self._look(self._airspeed())

    def sample(self) -> tuple[float, ...]:
        """Return time, place (east, north, up) and velocity, SI."""
        velocity = self._velocity
        place = (self.place.real, self.place.imag, self._energy.height)
        return (self.time, *place, velocity.real, velocity.imag, self._energy.climb)

    def _airspeed(self) -> float:
        """Return the horizontal part of the airspeed, m/s."""
        square = self._energy.speed**2 - self._energy.climb**2
        return math.sqrt(square) if square > 1.0 else 1.0

    def _look(self, airspeed: float) -> None:
        """Take in the velocity over ground, and L of it; `airspeed` is its horizontal part, m/s."""
        self._velocity = cmath.rect(airspeed, self.heading) + self._wind
        self._speed = abs(self._velocity)
        self.look_ahead = self._ahead * self._speed

    def bearing_to(self, place: complex) -> float:
        """Return the angle from the course over ground to `place`."""
        return cmath.phase((place - self.place) * self._velocity.conjugate())

    def along(self, track: Track, speed: float, step: float) -> None:
        """Go on by `step` seconds along the `track`."""
        if not track.leg:
            self.towards(track.end, track.finish, speed, step)
            return
        offset = (self.place - track.start) * track.course.conjugate()
        sine = offset.imag / self.look_ahead
        sine = -_INTERCEPT if sine < -_INTERCEPT else _INTERCEPT if sine > _INTERCEPT else sine
        aim = track.course * cmath.rect(1.0, -math.asin(sine))
        done = offset.real / track.length
        done = 0.0 if done < 0.0 else 1.0 if done > 1.0 else done
        height = track.begin + done * (track.finish - track.begin)
        self._go(self._lateral(cmath.phase(aim * self._velocity.conjugate())), height, speed, step)

    def towards(self, end: complex, height: float, speed: float, step: float) -> None:
        """Go on by `step` seconds straight to `end`."""
        self._go(self._lateral(self.bearing_to(end)), height, speed, step)

    def round(self, centre: complex, height: float, speed: float, step: float) -> bool:
        """Go on by `step` seconds towards and round a circle; return whether it is being flown.

        The circle has the vehicle's `loiter_radius` R. Its acceleration is V²/d plus a spring and
        damper on d - R with the guidance's period and damping, d the distance from `centre`; a
        negative R turns left. From outside, the straight way to the centre is flown until that asks
        for less of a turn.
        """
        limits = self._limits
        side = -math.copysign(1.0, limits.loiter_radius)
        offset, radius = self.place - centre, abs(limits.loiter_radius)
        distance = max(abs(offset), radius / 2)
        velocity = self._velocity
        outward = (velocity * offset.conjugate()).real / distance
        stiffness = 2 * math.pi / limits.period
        excess = abs(offset) - radius
        inward = self._speed**2 / distance + stiffness**2 * excess
        inward += 2 * limits.damping * stiffness * outward
        straight = self._lateral(self.bearing_to(centre))
        circling = excess <= 0 or side * straight >= inward
        self._go(side * inward if circling else straight, height, speed, step)
        return circling

    def _lateral(self, eta: float) -> float:
        """Return the acceleration to the left that turns the course by `eta`, m/s²."""
        square = math.pi / 2
        bounded = -square if eta < -square else square if eta > square else eta
        return self._gain * self._speed * math.sin(bounded)

    def _go(self, lateral: float, height: float, speed: float, step: float) -> None:
        """Move on with `lateral` acceleration to the left, m/s², as far as it goes."""
        energy, limits = self._energy, self._limits
        before, most = energy.climb, limits.roll_limit
        energy.hold(height, speed, 1 / math.cos(self._bank), step)
        bank = math.atan2(lateral, GRAVITY)
        bank = -most if bank < -most else most if bank > most else bank
        change = (bank - self._bank) * -math.expm1(-step / limits.roll_time)
        self._bank += change
        airspeed = self._airspeed()
        lift = GRAVITY + (energy.climb - before) / step
        slow = self._body.sideslip_airspeed
        turning = 1 - self._sideslip * (1.0 if airspeed > slow else airspeed / slow)
        turn = turning * lift * math.tan(self._bank) / airspeed * step
        turn += self._body.roll_turn * change
        self.place += (cmath.rect(airspeed, self.heading + turn / 2) + self._wind) * step
        self.heading += turn
        self.time += step
        self._look(airspeed)
