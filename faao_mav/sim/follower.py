"""The aircraft of a mock autopilot: where it is, along places in time or towards a setpoint."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real

_STEP, _LONGEST = 0.05, 60.0
"""Seconds between two steps towards a setpoint, and the longest that is flown at once: after a
longer silence it flies on from there. Chosen."""

_STIFFNESS = 1.5
"""Of how it corrects an error, 1/s, damped critically; chosen: as slow as those simulated."""

_PUSH = 5.0
"""The greatest acceleration towards a setpoint, m/s²; chosen: a lean of 27 degrees."""

_GROUND = 0.5
"""Metres above home below which it stands on the ground; chosen."""


class Posture(NamedTuple):
    """Position, m, and velocity, m/s, (3,) east, north, up of home; and the mission's item."""

    position: Real
    velocity: Real
    item: int


class Follower:
    """An aircraft that stands at home until it is sent along places, or towards a setpoint.

    `wind`, m/s east and north, is what it flies in: towards setpoints it is no faster than its
    airspeed. Times are seconds on a clock of its own.
    """

    def __init__(self, wind: tuple[float, float]) -> None:
        self._wind = np.array([*wind, 0.0])
        self.stand()

    def stand(self) -> None:
        """Stand at home, whatever it did."""
        self._time, self._p, self._v, self._item = 0.0, np.zeros(3), np.zeros(3), 0
        self.play(np.zeros(1), np.zeros((1, 3)), np.zeros(1, dtype=int))

    def play(self, t: Real, places: Real, items: NDArray[np.int_]) -> None:
        """Be at `places` (k, 3), m, at the times `t` (k,), s, on the way to `items` (k,)."""
        self._t, self._places, self._items = t, places, items
        self._aim: Real | None = None

    def go(self, now: float, *legs: tuple[Real, float]) -> None:
        """Fly from where it is straight to one place after another, each at a speed, m/s.

        Without `legs` it stays where it is, and never arrives.
        """
        points, times = [self.at(now).position], [now if legs else math.inf]
        for place, speed in legs:
            points.append(place)
            times.append(times[-1] + float(np.linalg.norm(points[-1] - points[-2])) / speed)
        self.play(np.array(times), np.array(points), np.full(len(points), self._item))

    def pursue(self, now: float, aim: Real, airspeed: float, *, carries_on: bool) -> None:
        """Fly to `aim` at up to `airspeed`, m/s, or to where it is by then if it `carries_on`.

        It is (3, 3): position, m, velocity, m/s, and acceleration, m/s².
        """
        self.at(now)
        self._aim, self._since, self._airspeed, self._carries_on = aim, now, airspeed, carries_on

    @property
    def arrives(self) -> float:
        """When it comes to the last place, s; inf towards a setpoint."""
        return math.inf if self._aim is not None else float(self._t[-1])

    def flies(self, now: float) -> bool:
        """Tell whether it is above the ground."""
        return bool(self.at(now).position[2] >= _GROUND)

    def landed(self, now: float) -> bool:
        """Tell whether it has come to a last place that is on the ground."""
        return now >= self.arrives and not self.flies(now)

    def at(self, now: float) -> Posture:
        """Return where it is, and how it moves."""
        if self._aim is None:
            self._play_until(now)
        else:
            self._time = max(self._time, now - _LONGEST)
            while self._time < now:
                self._step_to(self._aim, min(_STEP, now - self._time))
        return Posture(self._p, self._v, self._item)

    def _play_until(self, now: float) -> None:
        k = max(int(np.searchsorted(self._t, now, side="right")) - 1, 0)
        self._time, self._item = now, int(self._items[k])
        self._p, self._v = self._places[k], np.zeros(3)
        if self._t[k] <= now and k + 1 < len(self._t):
            self._v = (self._places[k + 1] - self._p) / (self._t[k + 1] - self._t[k])
            self._p = self._p + self._v * (now - self._t[k])

    def _step_to(self, aim: Real, step: float) -> None:
        self._time += step
        p, v, a = aim
        if self._carries_on:
            since = self._time - self._since
            p, v = p + v * since + a * since**2 / 2, v + a * since
        a = a + 2 * _STIFFNESS * (v - self._v) + _STIFFNESS**2 * (p - self._p)
        a = a * min(1.0, _PUSH / max(float(np.linalg.norm(a)), 1e-9))
        through_air = self._v + a * step - self._wind
        through_air *= min(1.0, self._airspeed / max(float(np.linalg.norm(through_air)), 1e-9))
        before, self._v = self._v, through_air + self._wind
        self._p = self._p + (before + self._v) / 2 * step
        self._p[2] = max(self._p[2], 0.0)
