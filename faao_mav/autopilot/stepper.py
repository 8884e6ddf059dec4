"""How flights are stepped: the airframe that follows, and the samples that are kept of it.

An autopilot's guidance says what it aims at; what the aircraft makes of that is here. Places,
velocities and accelerations across the ground are complex: east + i north, in m and s.
"""

import math
from array import array

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.body import CopterBody
from faao_mav.autopilot.flight_path import Flown
from faao_mav.errors import InputError

STEP = 0.1
"""The longest step of a flight, s: the one that the models were calibrated with."""


class Copter:
    """A copter that leans with a lag, and at which the air drags, which moves at `wind`, m/s.

    `lean`, m/s², is what leaning gives; it begins in a hover, held against the wind. The air drags
    along the `nose`, a direction, and across, each by k v + q v |v|. (Measured in ArduPilot's
    simulator: with the lean limit at 10.3 m/s the air comes from ahead, at 10.8 and 11.0 m/s 21 and
    25 degrees from there.)
    """

    def __init__(self, body: CopterBody, place: complex, wind: complex = 0j) -> None:
        self.place, self.velocity, self.acceleration = place, 0j, 0j
        self._body, self._wind, self.nose = body, wind, 1j
        self.lean = self.drag()

    def move(self, asked: complex, step: float) -> None:
        """Fly on for `step` seconds with the acceleration `asked`, m/s²."""
        self.lean += (asked - self.lean) * -math.expm1(-step / self._body.lag)
        self.acceleration = self.lean - self.drag()
        change = self.acceleration * step
        self.place += (self.velocity + change / 2) * step
        self.velocity += change

    def drag(self) -> complex:
        """Return the deceleration by the air, m/s²."""
        air = (self.velocity - self._wind) * self.nose.conjugate()
        k, q, along, across = self._body.linear_drag, self._body.quadratic_drag, air.real, air.imag
        return self.nose * complex((k + q * abs(along)) * along, (k + q * abs(across)) * across)


class Samples:
    """The samples of a flight: time, s, place east, north and up, m, and velocity, m/s."""

    def __init__(self, longest: float) -> None:
        self._log, self._longest = array("d"), longest

    def add(
        self, time: float, place: complex, height: float, velocity: complex, climb: float
    ) -> None:
        """Keep a sample; raises `InputError` for one after the longest time that is followed."""
        if time > self._longest:
            raise InputError(
                f"the flight would take more than {self._longest:.0f} s, perhaps for the wind, or "
                "for a waypoint that is never reached"
            )
        self._log.extend(
            (time, place.real, place.imag, height, velocity.real, velocity.imag, climb)
        )

    def flown(self, arrivals: Real, departures: Real, step: float) -> Flown:
        """Return the flight every `step` seconds up to its end."""
        log = np.frombuffer(self._log).reshape(-1, 7)
        t = np.arange(math.ceil(departures[-1] / step - 1e-9) + 1, dtype=float) * step
        columns = [np.interp(t, log[:, 0], column) for column in log[:, 1:].T]
        position, velocity = np.stack(columns[:3], axis=-1), np.stack(columns[3:], axis=-1)
        return Flown(arrivals, departures, t, position, velocity)
