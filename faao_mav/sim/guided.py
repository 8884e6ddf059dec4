"""A mock autopilot that follows setpoints: when it does, for how long, and how it flies then.

Measured in simulation: ArduCopter 4.7 arms and takes off in GUIDED by a command, and stops in its
place when setpoints cease; PX4 1.16.1 takes Offboard after a second of setpoints, takes off by
them, and changes its mode when they cease, by default to Position, where it sinks without sticks,
and back when they come again: see `SetpointRules`.
"""

import math
from collections.abc import Mapping

import numpy as np

from faao_mav.autopilot import AutopilotFamily, Vehicle
from faao_mav.autopilot.manners import Modes, SetpointRules
from faao_mav.fly.course import Course, Setpoint
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.item import Home
from faao_mav.sim.firmware import whole
from faao_mav.sim.flight import Posture
from faao_mav.wire.messages import SetPositionTargetLocalNed

_STEP, _STEPS, _LONGEST_STEP = 0.05, 1000, 0.5
"""Seconds between two steps of the flight; after a longer silence it is about so many steps, none
longer than the last. Chosen: at 1.5 / s it is stable."""

_SETTLED = 60.0
"""Seconds after the end of its way, or after a setpoint, from which on it moves no more; chosen."""

_STIFFNESS = 1.5
"""Of how it corrects an error, 1/s, damped critically; chosen: as slow as those simulated."""

_PUSH = 5.0
"""The greatest acceleration, m/s²; chosen: a lean of 27 degrees."""

_GROUND = 0.5
"""Metres above home below which it counts as standing; chosen."""


class Guided:
    """The part of a mock autopilot that follows setpoints by `rules`, in its `modes`.

    Its clock runs `speedup` times as fast as the world's, in whose seconds `now` is. `wind` is in
    m/s east and north: it holds its place in it, but flies no faster than its airspeed allows.
    `flying` tells whether it flies; what it did not begin itself it knows nothing of.
    """

    def __init__(
        self,
        family: AutopilotFamily,
        rules: SetpointRules,
        parameters: Mapping[str, float],
        home: Home,
        modes: Modes,
        wind: tuple[float, float],
        speedup: float,
    ) -> None:
        self._family, self._rules = family, rules
        self._parameters, self._home = parameters, home
        self._modes, self._wind, self._speedup = modes, np.array([*wind, 0.0]), speedup
        self._first_heard = self._last_heard = -math.inf
        self._vehicle: Vehicle | None = None
        self.reset()

    def reset(self) -> None:
        """Stand still, wherever it was."""
        self.flying = False
        self._aim: Setpoint | None = None
        self._course: Course | None = None
        self._lands = False

    def accepts(self, now: float) -> bool:
        """Tell whether it enters the mode: PX4 only while setpoints come."""
        streamed = (now - self._first_heard) * self._speedup > self._rules.streamed
        return not self._rules.takes_off_by_setpoints or (streamed and not self._late(now))

    def begin(self, posture: Posture, vehicle: Vehicle, now: float) -> None:
        """Follow setpoints from `posture` on."""
        self.reset()
        self.flying, self._vehicle, self._time, self._since = True, vehicle, now, now
        self._item = posture.item
        self._p, self._v = posture.position.astype(float), posture.velocity.astype(float)
        self._stop(now)

    def hear(self, message: SetPositionTargetLocalNed, mode: int, now: float) -> None:
        """Take a setpoint, in whatever mode."""
        if self._late(now):
            self._first_heard = now
        self._last_heard = now
        by_setpoints = self._rules.takes_off_by_setpoints
        if self.flying and mode == self._modes.guided and (by_setpoints or self._p[2] > _GROUND):
            self._advance(now)
            self._aim, self._course, self._since = self._setpoint(message), None, now

    def take_off(self, height: float, mode: int, now: float) -> bool:
        """Climb to `height`, m, on the command; tell whether it does."""
        ready = self.flying and mode == self._modes.guided and self._p[2] < _GROUND
        if not ready or self._rules.takes_off_by_setpoints:
            return False
        self._go(now, [*self._p[:2], height])
        return True

    def leave(self, mode: int, now: float) -> None:
        """Do what another `mode` asks for: return, land, or stay there."""
        self._advance(now)
        vertical, (east, north, up) = self._of.vertical, self._p
        if mode == self._modes.at_fence.get("return"):
            high = vertical.returns_at(up)
            self._go(now, [east, north, high], [0.0, 0.0, high], [0.0, 0.0, 0.0])
            self._lands = vertical.lands_on_return
        elif mode == self._modes.at_fence.get("land"):
            self._land(now)
        else:
            self._stop(now)

    def lost(self, mode: int, now: float) -> int:
        """Return the mode that it is in, now that setpoints may have ceased."""
        if mode != self._modes.guided or self._aim is None or not self._late(now):
            return mode
        if not self._rules.loss:
            self._stop(now)
            return mode
        action = self._rules.actions.get(whole(self._parameters[self._rules.loss]))
        after = self._modes.hold if action is None else action.mode
        self.leave(after, now)
        if action is not None and action.by_sticks:
            self._land(now)
        return after

    def landed(self, now: float) -> bool:
        """Tell whether it has landed."""
        over = self._course is not None and self._elapsed(now) > self._course.end
        return self._lands and over and self.at(now).position[2] < _GROUND

    def at(self, now: float) -> Posture:
        """Return where it is."""
        self._advance(now)
        return Posture(self._p.copy(), self._v.copy(), self._item)

    def _late(self, now: float) -> bool:
        """Tell whether there was no setpoint for as long as its parameter allows."""
        allowed = max(self._parameters[self._rules.timeout], self._rules.least_timeout)
        return (now - self._last_heard) * self._speedup > allowed

    @property
    def _of(self) -> Vehicle:
        assert self._vehicle is not None
        return self._vehicle

    def _go(self, now: float, *places: list[float]) -> None:
        speed, climb = self._of.value("cruise_speed"), self._of.vertical.climb_speed
        course = Course.through(np.array([self._p, self._p]), speed=1, acceleration=1)
        for start, end in zip([self._p.tolist(), *places], places, strict=False):
            level = start[:2] != end[:2]
            leg = np.array([start, end])
            course = course.then(
                Course.through(leg, speed=speed if level else climb, acceleration=1.0)
            )
        self._aim, self._course, self._since = None, course, now

    def _land(self, now: float) -> None:
        self._go(now, [*self._p[:2], 0.0])
        self._lands = True

    def _stop(self, now: float) -> None:
        self._advance(now)
        here = Course.through(np.array([self._p, self._p]), speed=1, acceleration=1)
        self._aim, self._course, self._since = None, here, now

    def _elapsed(self, now: float) -> float:
        return (now - self._since) * self._speedup

    def _advance(self, now: float) -> None:
        """Fly until `now`."""
        if not self.flying:
            return
        lasts = _SETTLED + (0.0 if self._course is None else self._course.end)
        left = min((now - self._time) * self._speedup, lasts - self._elapsed(self._time))
        most = self._of.top_airspeed if left > 0 else 0.0
        longest = min(max(_STEP, left / _STEPS), _LONGEST_STEP)
        while left > 0:
            step = min(longest, left)
            self._time += step / self._speedup
            left -= step
            p, v, a = self._target(self._elapsed(self._time))
            a = a + 2 * _STIFFNESS * (v - self._v) + _STIFFNESS**2 * (p - self._p)
            a = a * min(1.0, _PUSH / max(float(np.linalg.norm(a)), 1e-9))
            through_air = self._v + a * step - self._wind
            through_air *= min(1.0, most / max(float(np.linalg.norm(through_air)), 1e-9))
            after = through_air + self._wind
            self._p, self._v = self._p + (self._v + after) / 2 * step, after
        self._time = max(self._time, now)
        self._p[2] = max(self._p[2], 0.0)

    def _target(self, since: float) -> Setpoint:
        if self._course is not None:
            return self._course.at(since)
        assert self._aim is not None
        p, v, a = self._aim
        if not self._rules.carries_on:
            return self._aim
        return Setpoint(p + v * since + a * since**2 / 2, v + a * since, a)

    def _setpoint(self, message: SetPositionTargetLocalNed) -> Setpoint:
        """Return what `message` says in metres east, north and up of home."""
        home = self._home
        frame = self._family.local_frame(home.latitude, home.longitude)
        own = LocalFrame(home.latitude, home.longitude)
        level = own.to_local(*frame.to_geodetic([message.y, message.x]))
        moves = (
            np.array([message.vy, message.vx, -message.vz]),
            np.array([message.afy, message.afx, -message.afz]),
        )
        return Setpoint(np.append(level, -message.z), *moves)
