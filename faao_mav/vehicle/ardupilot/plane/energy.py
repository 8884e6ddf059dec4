"""How ArduPlane holds height and airspeed: total energy control, and the aircraft that it flies.

Total energy control (Lambregts, AIAA 83-2239; ArduPilot's documentation, TECS tuning): throttle by
the error of the sum of kinetic and potential energy, pitch by that of their difference. Each rule
here was told by the autopilot's logs of its simulator's flights (TECS, TEC2, TEC3 and TEC4), which
list its terms.
"""

import math

from faao_mav.power import GRAVITY
from faao_mav.vehicle.ardupilot.plane.parameters import ArduPlaneLimits

_TRIM = 0.5  # TRIM_THROTTLE of the simulator's plane; what is wrong about it goes with time
_LEAST_PITCH = math.radians(-20)  # PTCH_LIM_MIN_DEG of the simulator's plane
_EASE = 0.2  # TECS_THR_ERATE, 1/s: how fast the full throttle of a take-off goes at most
_CLIMBING = 1.0  # a flight that begins with so much of a climb, m/s, comes from a take-off; chosen
_KINETIC_SHARE = 0.25  # of the range of pitch, the most that the integral of kinetic energy takes


class Energy:
    """Height, m, true airspeed and climb, m/s, of an aircraft under total energy control.

    `density` is that of the air over sea level's. Demands begin at `demand`, m/s, and at `height`.
    """

    def __init__(
        self,
        limits: ArduPlaneLimits,
        density: float,
        height: float,
        speed: float,
        climb: float,
        demand: float,
    ) -> None:
        self.height, self.speed, self.climb = height, speed, climb
        self._limits, self._density, self._rates = limits, density, limits.speed_rates
        self._body = limits.body
        self._pitches = least, most = _LEAST_PITCH, limits.climb_pitch or limits.pitch_limit
        self._kinetic_weight = _KINETIC_SHARE * (most - least) * GRAVITY
        self._powers = -GRAVITY * limits.descent_speed, GRAVITY * limits.climb_speed
        self._level, self._demand = height, demand
        self._throttle_integral = self._pitch_integral = self._kinetic_integral = 0.0
        self._demanded_rate = self._flown_rate = self._rate = 0.0
        self._least_throttle = float(climb > _CLIMBING)
        if climb <= _CLIMBING:  # in trim, with what logs show that a take-off leaves behind
            self._throttle_integral = self._drag(1.0) / self._body.thrust - _TRIM
            self._kinetic_integral = self._most_kinetic()
            trim = self._attack(1.0) * GRAVITY * speed
            self._pitch_integral = trim - self._kinetic_integral

    def hold(self, height: float, speed: float, load: float, step: float) -> None:
        """Fly on towards `height` and the true airspeed `speed` for `step` seconds.

        `load` is the load factor.
        """
        limits, rates, flown = self._limits, self._rates, self.speed
        up, down = limits.climb_speed * step, limits.descent_speed * step
        rise, rate = height - self._level, (speed - self._demand) / step
        self._level += -down if rise < -down else up if rise > up else rise
        quickest = rates.power / flown
        rate = -rates.fall if rate < -rates.fall else rate
        rate = quickest if rate > quickest else rate
        self._demand += rate * step
        # of both rates only what is new counts: a high-pass filter
        wash = -math.expm1(-step / limits.energy_time)
        self._demanded_rate += (rate - self._demanded_rate) * wash
        self._flown_rate += (self._rate - self._flown_rate) * wash
        kinetic_demanded = flown * (rate - self._demanded_rate)
        kinetic_rate = flown * (self._rate - self._flown_rate)

        kinetic = (self._demand**2 - flown**2) / 2
        potential = GRAVITY * (self._level - self.height)
        potential_rate = GRAVITY * self.climb
        throttle = self._throttle(
            kinetic + potential,
            kinetic_demanded + potential / limits.energy_time,
            kinetic_rate + potential_rate,
            load,
            step,
        )
        pitch = self._pitch(potential - kinetic, potential_rate - kinetic_rate, kinetic, step)
        self._move(throttle, pitch, load, step)

    def _throttle(
        self, missing: float, demanded: float, flown: float, load: float, step: float
    ) -> float:
        """Return the throttle, 0 to 1, for an energy that is `missing`, m²/s², and its rates."""
        limits, (least, most) = self._limits, self._powers
        demanded = least if demanded < least else most if demanded > most else demanded
        ahead = _TRIM + (demanded + limits.turn_power * (load**2 - 1)) / (most - least)
        gain = 1 / (limits.energy_time * (most - least))
        throttle = ahead + gain * (missing + limits.throttle_damping * (demanded - flown))
        self._least_throttle -= _EASE * step
        held = max(throttle + self._throttle_integral, self._least_throttle, 0.0)
        integral = self._throttle_integral + gain * limits.energy_integral * missing * step
        integral = -throttle if integral < -throttle else integral
        self._throttle_integral = 1 - throttle if integral > 1 - throttle else integral
        return 1.0 if held > 1.0 else held

    def _pitch(self, missing: float, flown: float, kinetic: float, step: float) -> float:
        """Return the pitch, rad, for a difference of energies that is `missing`, m²/s²."""
        limits, (least, most) = self._limits, self._pitches
        weight = GRAVITY * self.speed
        demanded = missing / limits.energy_time
        error = demanded - flown
        limit = self._most_kinetic()
        integral = self._kinetic_integral - kinetic * step / limits.energy_time
        integral = -limit if integral < -limit else limit if integral > limit else integral
        self._kinetic_integral = integral
        pitch = demanded + limits.pitch_damping * error
        pitch += self._pitch_integral + integral
        if least * weight < pitch < most * weight or error * pitch < 0:
            self._pitch_integral += limits.energy_integral * error * step
        angle = pitch / weight
        return least if angle < least else most if angle > most else angle

    def _most_kinetic(self) -> float:
        """Return the greatest integral of kinetic energy's error, m²/s³."""
        return self._kinetic_weight * self.speed

    def _move(self, throttle: float, pitch: float, load: float, step: float) -> None:
        """Let the aircraft fly for `step` seconds."""
        steepness = self.climb / self.speed
        angle = math.asin(-1.0 if steepness < -1.0 else 1.0 if steepness > 1.0 else steepness)
        angle += (pitch - self._attack(load) - angle) * -math.expm1(-step / self._body.pitch_lag)
        push = self._body.thrust * throttle - self._drag(load)
        self._rate = push - GRAVITY * math.sin(angle)
        speed = self.speed + self._rate * step
        self.speed = 1.0 if speed < 1.0 else speed
        self.climb = self.speed * math.sin(angle)
        self.height += self.climb * step

    def _attack(self, load: float) -> float:
        """Return the angle of attack, rad."""
        body, dynamic = self._body, self._density * self.speed**2
        return body.lift_angle * load / dynamic - body.no_lift_angle

    def _drag(self, load: float) -> float:
        """Return the deceleration by drag, m/s²."""
        body, dynamic = self._body, self._density * self.speed**2
        return body.parasitic_drag * dynamic + body.induced_drag * load**2 / dynamic
