"""How a mock autopilot flies: what its mode, mission, fence and setpoints have its aircraft do.

Measured in simulation. At the fence, at 8 m/s: ArduCopter 4.7 (FENCE_ENABLE 1, FENCE_ACTION 1)
changed to RTL 1 m outside, went home and landed; PX4 1.16.1 (GF_ACTION 2) changed to hold 4 m
outside. By setpoints: ArduCopter takes off in GUIDED by a command, and stops when they cease; PX4
enters Offboard after a second of them, takes off by them, and changes its mode when they cease, by
default to Position, where it sinks without sticks. Both take up a mission in flight, without its
take-off.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.autopilot import Track, Vehicle, VehicleType
from faao_mav.autopilot.manners import FenceAction
from faao_mav.autopilot.predict import predict
from faao_mav.autopilot.vehicle import LANDING_HEIGHT
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import FreeArea, areas_of
from faao_mav.mission.item import Home, Mission
from faao_mav.wire.messages import SetPositionTargetLocalNed

_FARTHEST = 1e6  # Setpoints farther away, m, or beyond that in m/s or m/s² are none; chosen.
_STEP = 0.05  # Seconds over which its velocity is told, and between two steps. Chosen.
# How it corrects an error, 1/s, damped critically, and its greatest acceleration towards a
# setpoint, m/s²; chosen: as slow as those simulated, and a lean of 27 degrees.
_STIFFNESS, _PUSH = 1.5, 5.0
_GROUND = 0.5  # Metres above home below which it stands on the ground; chosen.


class Posture(NamedTuple):
    """Position, m, and velocity, m/s, (3,) east, north, up of home; and the mission's item."""

    position: Real
    velocity: Real
    item: int


class Follower:
    """An aircraft that stands at home until it is sent along places, or towards a setpoint.

    `wind`, m/s east and north, is what it flies in: towards setpoints, of which `aim` is the last
    (None along places), it is no faster than its airspeed. Times are seconds on a clock of its own.
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
        self.aim: Real | None = None

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
        self.aim, self._since, self._airspeed, self._carries_on = aim, now, airspeed, carries_on

    @property
    def arrives(self) -> float:
        """When it comes to the last place, s; inf towards a setpoint."""
        return math.inf if self.aim is not None else float(self._t[-1])

    def flies(self, now: float) -> bool:
        """Tell whether it is above the ground."""
        return bool(self.at(now).position[2] >= _GROUND)

    def landed(self, now: float) -> bool:
        """Tell whether it has come to a last place that is on the ground."""
        return now >= self.arrives and not self.flies(now)

    def at(self, now: float) -> Posture:
        """Return where it is, and how it moves."""
        if self.aim is None:
            self._time, at = now, [now, now - _STEP]
            self._p, before = np.transpose([np.interp(at, self._t, x) for x in self._places.T])
            self._v = (self._p - before) / _STEP
            k = int(np.searchsorted(self._t, now, side="right")) - 1
            self._item = int(self._items[max(k, 0)])
        while self.aim is not None and (step := min(_STEP, now - self._time)) > 0:
            self._time += step
            p, v, a = self.aim
            since = self._time - self._since if self._carries_on else 0.0
            behind = p + v * since + a * since**2 / 2 - self._p
            push = a + 2 * _STIFFNESS * (v + a * since - self._v) + _STIFFNESS**2 * behind
            air = self._v + _within(push, _PUSH) * step - self._wind
            before, self._v = self._v, _within(air, self._airspeed) + self._wind
            self._p = self._p + (before + self._v) / 2 * step
            self._p[2] = max(self._p[2], 0.0)
        return Posture(self._p, self._v, self._item)


def _within(vector: Real, most: float) -> Real:
    """Return `vector`, shortened to the length `most` where it is longer."""
    return vector * min(1.0, most / max(float(np.linalg.norm(vector)), 1e-9))


class Flight:
    """What a mock autopilot's mode and motors are, and what it therefore does with its aircraft.

    It flies missions as predicted in the `wind`, m/s east and north, and follows setpoints in
    GUIDED and Offboard. In another mode it returns, lands or holds its place. `values` are its
    parameters. Times are seconds on its own clock.
    """

    def __init__(
        self,
        vehicle_type: VehicleType,
        values: Mapping[str, float],
        home: Home,
        wind: tuple[float, float],
    ) -> None:
        self._type, self._values = vehicle_type, values
        self._frame = LocalFrame(home.latitude, home.longitude)
        self._own_frame = vehicle_type.family.local_frame(home.latitude, home.longitude)
        self._fly: Callable[[Mission, Vehicle], Track] = partial(predict, wind=wind)
        self.modes, self.rules = vehicle_type.modes, vehicle_type.family.setpoints
        self.mode = self.asked_mode = self.modes.rest
        self.aircraft = Follower(wind)
        self.stop()

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle with its parameters; useless ones do not count."""
        return Vehicle(self._type.family.key, self._type.kind, self._values).usable()

    def stop(self) -> None:
        """Stand at home with the motors off, and know of no setpoints."""
        self._first_heard = self._last_heard = -math.inf
        self._begun = self._since = 0.0
        self._outside = False
        self.aircraft.stand()
        self.land()

    def land(self) -> None:
        """Turn the motors off where it stands."""
        self.armed = self.on_mission = False
        self._track: Track | None = None

    def arm(self, now: float) -> None:
        """Turn the motors on."""
        self._do("hold", now)
        self.armed = True

    def enter(self, mode: int, now: float) -> None:
        """Change to `mode`, and do what it asks for; a mission is begun apart."""
        self.mode = self.asked_mode = mode
        if mode == self.modes.guided:
            self._track = None
        if mode != self.modes.mission and self.armed:
            self._do(self._action_of(mode), now)

    def _action_of(self, mode: int) -> FenceAction:
        """Return what is done in a mode that is not the mission's."""
        return next((act for act, own in self.modes.at_fence.items() if own == mode), "hold")

    def _do(self, action: FenceAction | Literal["sink"], now: float) -> None:
        """Return, land, sink or hold, from where it is; a flight that is terminated lands too.

        A mission that is broken off is taken up from here.
        """
        if self.on_mission:
            self._since = now - self._begun
        self.on_mission = False
        vehicle, (east, north, up) = self.vehicle, self.aircraft.at(now).position
        legs = list[tuple[float, float, float, float]]()  # to where, and how fast
        if self.aircraft.flies(now) and action != "hold":
            if action == "return":
                high = vehicle.returns_at(up)
                legs += [(east, north, high, vehicle.value("climb_speed"))]
                east, north, up = 0.0, 0.0, high
                legs += [(east, north, up, vehicle.value("cruise_speed"))]
            if action != "return" or self._type.hovers:
                low = up if action == "sink" else min(up, LANDING_HEIGHT)
                legs += [(east, north, low, vehicle.value("descent_speed"))]
                legs += [(east, north, 0.0, vehicle.landing_speed)]
        self.aircraft.go(now, *((np.array(place), speed) for *place, speed in legs))

    # ---- the mission and the fence

    def begin(self, mission: Mission, now: float) -> bool:
        """Fly `mission`, or the rest of the one that was broken off; tell whether it can be flown.

        It flies straight to where that begins: in the air, where the first item is done.
        """
        if not self.armed or self.on_mission:
            return True
        vehicle, flies = self.vehicle, self.aircraft.flies(now)
        if self._track is None:
            try:
                self._track = self._fly(mission, vehicle)
            except InputError:
                return False
            self._fence = mission.fence
            self._outside = self.is_outside(self._fence, self.aircraft.at(now).position)
            done = self._track.reached[np.isfinite(self._track.reached)]
            self._since = float(done.min()) if flies and len(done) else 0.0
        track, here = self._track, self.aircraft.at(now).position
        k = min(int(np.searchsorted(track.t, self._since)), len(track.t) - 1)
        way = float(np.linalg.norm(track.position[k] - here)) if flies else 0.0
        self._begun = now + way / vehicle.value("cruise_speed") - float(track.t[k])
        times, items = np.append(now, track.t[k:] + self._begun), track.item[k:]
        places = np.vstack([here, track.position[k:]])
        self.aircraft.play(times, places, np.append(items[0], items))
        self.on_mission = True
        return True

    def leaves_fence(self, now: float) -> bool:
        """Do what is to be done where a mission leaves the fence; tell that, once."""
        was_outside = self._outside
        if self.on_mission:
            self._outside = self.is_outside(self._fence, self.aircraft.at(now).position)
        if was_outside or not self._outside:
            return False
        action = self._type.at_fence(self.vehicle).action
        if action != "report":
            self.mode = self.asked_mode = self.modes.at_fence.get(action, self.mode)
            self._do(action, now)
        return True

    def is_outside(self, fence: Fence, place: Real) -> bool:
        """Tell whether `place`, m from home, is outside a `fence` that it does something about."""
        if not fence or self._type.at_fence(self.vehicle).action == "nothing":
            return False
        any_inclusion = self._type.fence_needs_one_inclusion(self.vehicle)
        area = FreeArea.of(areas_of(fence, self._frame), any_inclusion=any_inclusion)
        return not area.covers(place[None, :2]).all()

    # ---- setpoints

    def accepts_guided(self, now: float) -> bool:
        """Tell whether it enters that mode: PX4 only once setpoints have come for some time."""
        streamed = now - self._first_heard > self.rules.streamed and not self._late(now)
        return streamed or not self.rules.takes_off_by_setpoints

    def hear(self, message: SetPositionTargetLocalNed, now: float) -> bool:
        """Take a setpoint; tell whether it ends the failsafe for lost ones."""
        if self._late(now):
            self._first_heard = now
        self._last_heard = now
        guided = self.armed and self.asked_mode == self.modes.guided is not None
        comes_back = guided and self.mode != self.asked_mode
        if comes_back:
            self.mode = self.asked_mode
        m, flies = message, self.rules.takes_off_by_setpoints or self.aircraft.flies(now)
        rows = [m.y, m.x, -m.z], [m.vy, m.vx, -m.vz], [m.afy, m.afx, -m.afz]
        aim = np.array(rows, dtype=float)  # east, north and up of home
        if guided and flies and (np.abs(aim) < _FARTHEST).all():
            aim[0, :2] = self._frame.to_local(*self._own_frame.to_geodetic(aim[0, :2]))
            carries_on = self.rules.carries_on
            self.aircraft.pursue(now, aim, self.vehicle.top_airspeed, carries_on=carries_on)
        return comes_back

    def lose_setpoints(self, now: float) -> None:
        """Do what is to be done when setpoints have ceased, if they have."""
        if self.aircraft.aim is None or not self._late(now):
            return
        by_sticks = False
        if self.rules.loss:
            done = self.rules.actions.get(self._values[self.rules.loss])
            self.mode = self.modes.hold if done is None else done.mode
            by_sticks = done is not None and done.by_sticks
        self._do("sink" if by_sticks else self._action_of(self.mode), now)

    def take_off(self, height: float, now: float) -> bool:
        """Climb to `height`, m, on the command; tell whether it does."""
        ready = self.armed and self.mode == self.modes.guided and not self.aircraft.flies(now)
        if not ready or self.rules.takes_off_by_setpoints or not math.isfinite(height):
            return False
        up = np.append(self.aircraft.at(now).position[:2], height)
        self.aircraft.go(now, (up, self.vehicle.value("climb_speed")))
        return True

    def _late(self, now: float) -> bool:
        """Tell whether there was no setpoint for as long as its parameter allows."""
        allowed = max(self._values.get(self.rules.timeout, 0.0), self.rules.least_timeout)
        return now - self._last_heard > allowed
