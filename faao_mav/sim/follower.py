"""The aircraft of a mock autopilot: where it is, along places in time or towards a setpoint."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.item import Home
from faao_mav.wire.messages import Attitude, GlobalPositionInt, LocalPositionNed, Message

_STEP, _LONGEST = 0.05, 60.0
"""Seconds between two steps towards a setpoint, and the longest that is flown at once: after a
longer silence it flies on from there. Chosen."""

_STIFFNESS = 1.5
"""Of how it corrects an error, 1/s, damped critically; chosen: as slow as those simulated."""

_PUSH = 5.0
"""The greatest acceleration towards a setpoint, m/s²; chosen: a lean of 27 degrees."""

_GROUND = 0.5
"""Metres above home below which it stands on the ground; chosen."""


EARLY = 1e-6
"""Seconds by which an event may come early, rather than a tick late; chosen."""


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
        self._t, self._places, self._items = np.zeros(1), np.zeros((1, 3)), np.zeros(1, dtype=int)
        self._aim: Real | None = None

    def play(self, t: Real, places: Real, items: NDArray[np.int_]) -> None:
        """Be at `places` (k, 3), m, at the times `t` (k,), s, on the way to `items` (k,)."""
        self._t, self._places, self._items, self._aim = t, places, items, None

    def go(self, now: float, *legs: tuple[Real, float]) -> None:
        """Fly from where it is straight to one place after another, each at a speed, m/s."""
        points, times = [self.at(now).position], [now]
        for place, speed in legs:
            points.append(place)
            times.append(times[-1] + float(np.linalg.norm(points[-1] - points[-2])) / speed)
        self.play(np.array(times), np.array(points), np.full(len(points), self._item))

    def pursue(self, now: float, aim: Real, airspeed: float, *, carries_on: bool = False) -> None:
        """Fly to `aim` at up to `airspeed`, m/s, or to where it is by then if it `carries_on`.

        It is (3, 3): position, m, velocity, m/s, and acceleration, m/s².
        """
        self.at(now)
        self._aim, self._since, self._airspeed, self._carries_on = aim, now, airspeed, carries_on

    def hold(self, now: float, airspeed: float) -> None:
        """Stop, and come back to where it is now; on the ground stand until it is sent away."""
        here, rest = self.at(now).position, np.zeros(3)
        if here[2] < _GROUND:
            self.play(np.array([math.inf]), np.array([here]), np.array([self._item]))
        else:
            self.pursue(now, np.array([here, rest, rest]), airspeed)

    @property
    def arrives(self) -> float:
        """When it comes to the last place, s; inf towards a setpoint."""
        return math.inf if self._aim is not None else float(self._t[-1])

    def flies(self, now: float) -> bool:
        """Tell whether it is above the ground."""
        return bool(self.at(now).position[2] >= _GROUND)

    def landed(self, now: float) -> bool:
        """Tell whether it has come to a last place that is on the ground."""
        return now >= self.arrives - EARLY and not self.flies(now)

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
        k = min(int(np.searchsorted(self._t, now, side="right")), len(self._t)) - 1
        self._time, self._item, self._v = now, int(self._items[max(k, 0)]), np.zeros(3)
        if k < 0 or k == len(self._t) - 1:
            self._p = self._places[max(k, 0)]
            return
        (start, end), lasting = self._places[k : k + 2], self._t[k + 1] - self._t[k]
        self._v = (end - start) / lasting
        self._p = start + self._v * (now - self._t[k])

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


def global_position(posture: Posture, home: Home, since_boot: float) -> GlobalPositionInt:
    """Return where `posture` is on Earth, `since_boot` seconds after start-up."""
    (east, north, up), (v_east, v_north, v_up) = map(list, (posture.position, posture.velocity))
    frame = LocalFrame(home.latitude, home.longitude)
    latitude, longitude = map(float, frame.to_geodetic([east, north]))
    return GlobalPositionInt(
        int(since_boot * 1000) % 2**32,
        round(latitude * 1e7),
        round(longitude * 1e7),
        _fitted((home.altitude + up) * 1000, 32),
        _fitted(up * 1000, 32),
        _fitted(100 * v_north, 16),
        _fitted(100 * v_east, 16),
        _fitted(-100 * v_up, 16),
        round(math.degrees(math.atan2(v_east, v_north)) % 360 * 100) % 36_000,
    )


def local_reports(posture: Posture, since_boot: float) -> list[Message]:
    """Return where `posture` is from home, and where it heads."""
    time = int(since_boot * 1000) % 2**32
    (east, north, up), (v_east, v_north, v_up) = map(list, (posture.position, posture.velocity))
    return [
        LocalPositionNed(time, north, east, -up, v_north, v_east, -v_up),
        Attitude(time, 0.0, 0.0, math.atan2(v_east, v_north), 0.0, 0.0, 0.0),
    ]


def _fitted(value: float, bits: int) -> int:
    """Return what a field of so many bits holds: 300 m/s and more are cut."""
    most = (1 << bits - 1) - 1
    return round(min(max(value, -most), most))
