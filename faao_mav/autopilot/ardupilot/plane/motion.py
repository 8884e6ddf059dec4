"""An aeroplane with the guidance that banks it, and how it holds airspeed and height."""

import cmath
import math

from faao_mav.autopilot.ardupilot.plane.parameters import ArduPlaneLimits
from faao_mav.autopilot.atmosphere import density_ratio
from faao_mav.power import GRAVITY

STEP = 0.1
"""The longest step of the simulation, s. Chosen; what a change costs is not measured."""

_INTERCEPT = math.sin(math.radians(45))
"""The sine of the steepest angle at which a track is approached (ArduPilot's L1 navigation)."""


_THROTTLE = 1.5
"""How much faster the airspeed rises than `speed_rates` says: throttle goes beyond them. Of 1, 1.5
and 2 the one nearest to recorded flights."""

_HEIGHT_TIME = 2.0
"""The time constant with which a height is approached, s. Chosen."""

_CLIMB_LAG = 1.0
"""The time constant with which a climb follows what the height asks for, s. Chosen."""


_SLOWEST = 1.0
"""The least airspeed with which a flight begins, m/s. Chosen: nothing is divided by 0."""


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

    The airspeed follows with the lag of `limits.body` a demand, which goes to what is commanded
    within `limits.speed_rates`, upwards faster by `_THROTTLE`. The height is approached within the
    greatest climb and descent.

    Banks and throttle turn and speed up the flight through the air, which moves steadily at `wind`;
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
        self._bank, self._height, self._climb = 0.0, height, climb
        self._flown, self._rates = max(abs(airspeed), _SLOWEST), limits.speed_rates
        self._demand = self._flown if speed is None else speed
        self._sideslip = limits.body.sideslip * density_ratio(altitude)
        self._look()

    def sample(self) -> tuple[float, ...]:
        """Return time, place (east, north, up) and velocity, SI."""
        velocity = self._velocity
        place = (self.place.real, self.place.imag, self._height)
        return (self.time, *place, velocity.real, velocity.imag, self._climb)

    def _look(self) -> None:
        """Take in the velocity over ground, and L of it."""
        self._velocity = cmath.rect(self._flown, self.heading) + self._wind
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
        limits, body = self._limits, self._limits.body
        self._speed_up(speed, step)
        self._rise(height, step)
        bank, most = math.atan2(lateral, GRAVITY), limits.roll_limit
        bank = min(max(bank, -most), most)
        self._bank += (bank - self._bank) * -math.expm1(-step / limits.roll_time)
        slipping = self._sideslip * min(self._flown / body.sideslip_airspeed, 1.0)
        turn = (1 - slipping) * GRAVITY * math.tan(self._bank) / self._flown * step
        self.place += (cmath.rect(self._flown, self.heading + turn / 2) + self._wind) * step
        self.heading += turn
        self.time += step
        self._look()

    def _speed_up(self, speed: float, step: float) -> None:
        """Let the airspeed go towards a commanded `speed`, m/s, for `step` seconds."""
        rise = _THROTTLE * self._rates.power / self._flown * step
        fall = self._rates.fall * step
        self._demand += min(max(speed - self._demand, -fall), rise)
        heeded = -math.expm1(-step / self._limits.body.airspeed_lag)
        self._flown += (self._demand - self._flown) * heeded

    def _rise(self, height: float, step: float) -> None:
        """Let the height go towards `height`, m, for `step` seconds."""
        limits = self._limits
        climb = (height - self._height) / _HEIGHT_TIME
        climb = min(max(climb, -limits.descent_speed), limits.climb_speed)
        self._climb += (climb - self._climb) * -math.expm1(-step / _CLIMB_LAG)
        self._height += self._climb * step
