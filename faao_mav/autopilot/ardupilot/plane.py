"""ArduPlane: what it is, and how it flies a mission."""

import cmath
import math
from dataclasses import dataclass
from functools import partial
from math import pi, radians
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.ardupilot import PLANE_DIALECT, ardupilot_type, at_fence
from faao_mav.autopilot.body import ARDUPLANE_BODY, PlaneBody, density_ratio
from faao_mav.autopilot.manners import Modes, failsafes
from faao_mav.autopilot.model import (
    SHORTEST,
    STEP,
    Flight,
    FlightPath,
    Flown,
    Model,
    Orbit,
    SpeedRates,
    parameter,
    unit,
)
from faao_mav.autopilot.parameter import parameters_of, table
from faao_mav.autopilot.vehicle_type import orbit_at
from faao_mav.files import numbers
from faao_mav.mission.command import Command
from faao_mav.power import GRAVITY

FACTS = numbers("autopilot/constants.tsv", model="arduplane")
_INTERCEPT = math.sin(radians(FACTS.intercept))


@dataclass(frozen=True, slots=True)
class ArduPlane(Model):
    """How ArduPlane flies plain waypoints in AUTO, in a steady wind; SI units, angles in radians.

    After ArduPilot's documentation (Plane: navigation tuning, parameter list of 4.7; newer names
    first), with constants from flights of its simulator: lateral guidance `NAVL1` within the roll
    limit, airspeed and height by total energy control. A waypoint is reached within its acceptance
    radius or on passing the perpendicular through it. Where the waypoint gives no radius it is the
    least of WP_RADIUS, over the density's ratio, and the guidance's look-ahead, for turns below 90
    degrees in proportion to the turn. Commanded speeds are equivalent airspeeds. ArduPlane has no
    hold at a plain waypoint, so `FlightPath.holds` do not count. `descent_speed` is the sink rate
    with an idling engine.
    """

    cruise_speed: float = parameter("m/s", 12.0, "AIRSPEED_CRUISE", "TRIM_ARSPD_CM", least=1)
    min_speed: float = parameter("m/s", 9.0, "AIRSPEED_MIN", "ARSPD_FBW_MIN", 1.0, least=1)
    max_speed: float = parameter("m/s", 22.0, "AIRSPEED_MAX", "ARSPD_FBW_MAX", 1.0, least=1)
    roll_limit: float = parameter("rad", 45, "ROLL_LIMIT_DEG", "LIM_ROLL_CD", least=5, greatest=85)
    roll_time: float = parameter("s", 0.5, "RLL2SRV_TCONST", least=0.05)
    waypoint_radius: float = parameter("m", 90.0, "WP_RADIUS", least=1)
    climb_speed: float = parameter("m/s", 5.0, "TECS_CLMB_MAX")
    descent_speed: float = parameter("m/s", 2.0, "TECS_SINK_MIN")
    period: float = parameter("s", 17.0, "NAVL1_PERIOD", least=1)
    damping: float = parameter("", 0.75, "NAVL1_DAMPING")
    body: PlaneBody = ARDUPLANE_BODY

    least: ClassVar[float] = 0.0
    slowest: ClassVar[float] = 0.1
    run_in: ClassVar[float] = 8.0  # with 4 missions were still 5 m off their track at w_I

    @property
    def look_ahead(self) -> float:
        """How far ahead the guidance aims, s: ζ T / π."""
        return self.damping * self.period / pi

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg flown at `speed`, m: one look-ahead; same shape."""
        return self.look_ahead * speed

    def true_airspeed(self, commanded: float, altitude: float) -> float:
        """Return the true airspeed, m/s, at which a `commanded` one is flown.

        The equivalent airspeed is within `min_speed` and `max_speed`; 0 or less is `cruise_speed`.
        `altitude` is m above sea level.
        """
        wanted = commanded if commanded > 0 else self.cruise_speed
        held = min(max(wanted, self.min_speed), self.max_speed)
        return held * self.true_over_commanded(altitude)

    def true_over_commanded(self, altitude: float) -> float:
        """Return true over commanded airspeed at `altitude`, m above sea level."""
        return math.pow(density_ratio(altitude), -self.body.airspeed_exponent)

    @property
    def speed_rates(self) -> SpeedRates:
        """How fast the demanded true airspeed changes at most.

        At a true airspeed V, m/s, total energy control lets it fall by 0.9 g s / V_c and rise by
        0.5 g c / V, with the `descent_speed` s, the `cruise_speed` V_c and the `climb_speed` c (as
        its logs show; in falls from above V_c it counts TECS_SINK_MAX too, which is left out). A
        turn takes `turn` times the look-ahead or longer for a radian.
        """
        fall = 0.9 * GRAVITY * self.descent_speed / self.cruise_speed
        turn = 1 / (FACTS.turn * self.look_ahead)
        return SpeedRates(fall, 0.5 * GRAVITY * self.climb_speed, turn)

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        An aeroplane is never at rest: it starts over the first point at the path's `entry`
        velocity, as after a take-off, and then flies straight to the second point; without one, at
        the first leg's speed and course. Speeds of 0 or less mean `cruise_speed`.

        Raises `InputError` for a flight that takes more than `path.longest`, as in a wind that
        carries it away.
        """
        flight, arrivals = _Flight(self, path), [0.0]
        for k in range(1, len(path.points)):
            flight.arrive(k)
            arrivals.append(flight.time)
        if len(arrivals) > 1:
            flight.move(len(arrivals) - 1, step)  # the last sample is up to a step later
        return flight.flown(arrivals, arrivals, step)


class _Flight(Flight):
    """A flight by ArduPlane.

    Guidance is Park, Deyst and How's (AIAA 2004-4900) in ArduPilot's form: with damping ζ and
    period T the aircraft aims at a point L = ζ T V / π ahead on its track, by the lateral
    acceleration 4 ζ² V² / L sin η, η the angle from its course to that point. It banks for that
    as in a coordinated turn. Around a circle the track is its tangent, and sin η has what turns at
    the distance r from the middle, V² / r, beside; from afar it flies to the middle.

    The airspeed follows with the lag of the `body` a demand, which goes to what is commanded within
    `speed_rates`. The height is approached within the greatest climb and descent.

    Banks and throttle turn and speed up the flight through the air, which moves steadily at the
    wind; guidance sees the flight over ground, the sum of both. Angles are positive to the left.
    """

    def __init__(self, plane: ArduPlane, path: FlightPath) -> None:
        super().__init__(path.longest)
        self._plane, self._path, self._wind = plane, path, complex(*path.wind)
        self._places = [complex(east, north) for east, north in path.points[:, :2].tolist()]
        self._heights: list[float] = path.points[:, 2].tolist()
        altitude = path.elevation + max(self._heights)
        commands = path.speeds.tolist() or [0.0]
        self._speeds = [plane.true_airspeed(command, altitude) for command in commands]
        self._full_radius = plane.waypoint_radius / density_ratio(altitude)
        self._place, self._height, self._climb = self._places[0], self._heights[0], 0.0
        self._bank, self._demand, self._rates = 0.0, self._speeds[0], plane.speed_rates
        self._circling = False
        if path.entry is None:
            way = next(filter(None, map(unit, np.diff(self._places).tolist())), 1j)
            across = (self._wind * way.conjugate()).imag / self._demand
            against = math.asin(min(max(across, -1.0), 1.0))  # as far as it can
            airspeed = way * cmath.rect(self._demand, -against)
        else:
            east, north, self._climb = path.entry.tolist()
            airspeed = complex(east, north) - self._wind
            self._demand = plane.true_airspeed(0.0, altitude)
        self._airspeed = max(abs(airspeed), FACTS.slowest)
        self._heading = cmath.phase(airspeed)
        self.keep(self._place, self._height, self._velocity, self._climb)

    def arrive(self, k: int) -> None:
        """Fly along the leg to point `k` until that is reached."""
        before = self._places[k] - self._places[k - 1]
        turn = 1.0  # over 90 degrees
        if k + 1 < len(self._places):
            onward = self._places[k + 1] - self._places[k]
            turn = min(abs(cmath.phase(before.conjugate() * onward)) / (pi / 2), 1.0)
        while (away := self._away(k, unit(before), turn)) > 0:
            self.move(k, min(STEP, max(away / abs(self._velocity), SHORTEST)))
        if (orbit := self._path.orbits.get(k)) is not None:
            self._circle(k, orbit)
        self.move(k, FACTS.noticed)

    def _circle(self, k: int, orbit: Orbit) -> None:
        """Circle about point `k`; where that is too tight, turns of the heading count.

        Then it goes on until it heads for the next point, of one inside for the circle before it.
        """
        end, start, turned = self.time + orbit.seconds, self._heading, 0.0
        onward = self._places[min(k + 1, len(self._places) - 1)] - self._places[k]
        left, self._circling = -1 if orbit.clockwise else 1, True
        while (
            self.time < end
            or max(turned, left * (self._heading - start)) < 2 * pi * orbit.turns
            or (orbit.climbs and abs(self._heights[k] - self._height) > FACTS.climbed)
            or (onward and not self._heads(onward, self._place - self._places[k], orbit.radius))
        ):
            out = self._place - self._places[k]
            self.move(k, STEP)
            turned += left * cmath.phase((self._place - self._places[k]) * out.conjugate())
        self._circling, self._places[k] = False, self._place if orbit.tangent else self._places[k]

    def _heads(self, onward: complex, out: complex, radius: float) -> bool:
        """Say whether it heads `onward`, seen from the place of the circle that is nearest, m."""
        ahead = max(abs(onward), radius) * unit(onward) - radius * unit(out)
        return abs(cmath.phase(ahead * self._velocity.conjugate())) < radians(FACTS.aligned)

    def _away(self, k: int, way: complex, turn: float) -> float:
        """Return how far the aircraft is from where point `k` counts as reached, m."""
        radius, offset = float(self._path.radii[k]), self._places[k] - self._place
        if radius <= 0:
            look_ahead = self._plane.look_ahead * abs(self._velocity)
            radius = min(self._full_radius, look_ahead) * turn
        if (orbit := self._path.orbits.get(k)) is not None:
            return abs(offset) - radius - orbit.radius
        return min((offset * way.conjugate()).real, abs(offset) - radius)

    @property
    def _velocity(self) -> complex:
        """The velocity over ground, m/s."""
        return cmath.rect(self._airspeed, self._heading) + self._wind

    def _aim(self, k: int) -> tuple[complex, float]:
        """Return the direction to aim in on the leg to point `k`, and the height to be at, m."""
        start, end = self._places[k - 1 : k + 1]
        before, height = self._heights[k - 1 : k + 1]
        orbit, ahead = self._path.orbits.get(k), self._plane.look_ahead * abs(self._velocity)
        if orbit is not None and self._circling:
            out = self._place - end
            bend = 4 * self._plane.damping**2 * abs(out)
            inwards = (abs(out) - orbit.radius) / ahead + ahead / max(bend, ahead)
            turn = pi / 2 + math.asin(min(max(inwards, -1.0), 1.0))
            return unit(out) * cmath.rect(1.0, -turn if orbit.clockwise else turn), height
        if orbit is not None and orbit.climbs:
            before = height
        if start == end or (k == 1 and self._path.entry is not None):
            return end - self._place, height
        way = unit(end - start)
        offset = (self._place - start) * way.conjugate()
        sine = offset.imag / ahead
        sine = min(max(sine, -_INTERCEPT), _INTERCEPT)
        done = min(max(offset.real / abs(end - start), 0.0), 1.0)
        return way * cmath.rect(1.0, -math.asin(sine)), before + done * (height - before)

    def move(self, k: int, step: float) -> None:
        """Go on by `step` seconds on the leg to point `k`."""
        plane, body, velocity = self._plane, self._plane.body, self._velocity
        aim, height = self._aim(k)
        rise, fall = self._rates.power / self._airspeed * step, self._rates.fall * step
        self._demand += min(max(self._speeds[k - 1] - self._demand, -fall), rise)
        heeded = -math.expm1(-step / body.airspeed_lag)
        self._airspeed += (self._demand - self._airspeed) * heeded
        climb = (height - self._height) / FACTS.height_time
        climb = min(max(climb, -plane.descent_speed), plane.climb_speed)
        self._climb += (climb - self._climb) * -math.expm1(-step / FACTS.climb_lag)
        self._height += self._climb * step
        turned = aim * velocity.conjugate()
        turn = min(max(math.atan2(turned.imag, turned.real), -pi / 2), pi / 2)
        gain = 4 * plane.damping**2 / plane.look_ahead
        bank = math.atan2(gain * abs(velocity) * math.sin(turn), GRAVITY)
        bank = min(max(bank, -plane.roll_limit), plane.roll_limit)
        self._bank += (bank - self._bank) * -math.expm1(-step / plane.roll_time)
        slipping = body.sideslip * min(self._airspeed / body.sideslip_airspeed, 1.0)
        change = (1 - slipping) * GRAVITY * math.tan(self._bank) / self._airspeed * step
        through_air = cmath.rect(self._airspeed, self._heading + change / 2)
        self._place += (through_air + self._wind) * step
        self._heading += change
        self.time += step
        self.keep(self._place, self._height, self._velocity, self._climb)


_LOITER, _RTL = 12, frozenset({11})
# PLANE_MODE of MAVLink; ArduPlane 4.7 does not arm in RTL, to which a mission's return changes.
_MODES = Modes(2, 10, _LOITER, {"return": 11}, at_end=_RTL, not_to_arm_in=_RTL)

ARDUPLANE = ardupilot_type(
    kind="plane",
    name="ArduPlane",
    mav_types=(1,),
    modes=_MODES,
    hovers=False,
    parameters=table(*ArduPlane.parameters(), *parameters_of("arduplane")),
    dialect=PLANE_DIALECT,
    returns_at_least=False,
    at_fence=at_fence({0: "report"}),
    failsafes=failsafes("arduplane"),
    flight_model=ArduPlane.from_vehicle,
    ceilings={"max_acceleration": ("roll_limit",)},
    body=ARDUPLANE_BODY,
    orbits=partial(orbit_at, sided=Command.NAV_LOITER_TIME),
)
"""ArduPlane 4.7. How it turns and how fast it may fly is tuned on each aircraft: no parameters are
recommended."""
