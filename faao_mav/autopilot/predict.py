"""How a vehicle will fly a whole mission, from take-off to its end.

Waypoints are flown by the vehicle's model, stretch by stretch from rest to rest; take-off, landing
and the return are climbs and descents at constant speed with what the autopilot adds to them.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.model import LONGEST, FlightPath, Orbit, Track
from faao_mav.autopilot.vehicle import Vehicle
from faao_mav.autopilot.vehicle_type import height_above_home
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import FLOWN_TO, HOLDING, LANDINGS, TAKEOFFS, Command
from faao_mav.mission.item import JUMPS, Mission, MissionItem, jump_target
from faao_mav.vector import Vector

LONGEST_COPTER = 5_400.0
"""The longest flight, s, of what can hover that is followed. Chosen: few copters can stay up for
1.5 hours, in which the model of PX4 takes 54,000 steps and 3 to 4 s of processor time."""

_MOST_STEPS = 2000
"""The largest number of items that are flown, repeats by DO_JUMP included. Chosen: a few seconds of
work at most, whatever a file or a peer asks for."""

_REPEATS = 20  # How often a jump that never ends is followed. Chosen.
_SAME_PLACE = 0.01  # The distance, m, below which two places are one.
_SHORTEST = 1e-3  # The shortest motion, s, that is worth a sample.


def predict(
    mission: Mission,
    vehicle: Vehicle,
    frame: LocalFrame | None = None,
    *,
    step: float = 0.1,
    wind: Vector = (0.0, 0.0),
) -> Track:
    """Return the predicted flight of `mission` by `vehicle`, sampled every `step` seconds.

    The air moves at `wind`, east and north, m/s, steadily and everywhere. The flight begins on the
    ground at home, or, without a home, below the first place of the mission, about which `frame`
    then is too. Jumps are followed, those without end twenty times. Items that are circled at have
    their circles; one that never ends, or a mission without an end, ends the track on arrival, or
    after one circle. A mission without places gives an empty track.

    Raises `InputError` for places that cannot be flown to (NaN, altitudes above sea level
    without a home), parameters that are useless, or a flight that takes more than
    1.5 hours, of a plane six.

    >>> from faao_mav import read_mission
    >>> track = predict(read_mission("tests/data/missions/plain.waypoints"), Vehicle())
    >>> bool(120 < track.t[-1] < 140)
    True
    """
    home, start = mission.home, mission.first_place or (0.0, 0.0)
    if home is not None:
        start = home.latitude, home.longitude
    if not any(item.command in FLOWN_TO for item in mission.items):
        empty, reached = np.empty((0, 3)), np.full(len(mission.items), np.nan)
        none, frame = np.empty(0, dtype=int), frame or LocalFrame(0.0, 0.0)
        return Track(np.empty(0), empty, empty, none, reached, frame)
    frame = frame or LocalFrame(*start)
    walk = _Walk(mission, vehicle, frame, step, wind, np.append(frame.to_local(*start), 0.0))
    for index, item in _in_order(mission):
        walk.take(index, item)
        if walk.over:
            break
    return walk.track()


def _in_order(mission: Mission) -> Iterator[tuple[int, MissionItem]]:
    """Yield the items that are flown, jumps followed."""
    left: dict[int, int] = {}
    index = steps = 0
    while index < len(mission.items) and steps < _MOST_STEPS:
        item, steps = mission.items[index], steps + 1
        if item.command in JUMPS and math.isfinite(item.params[0]):
            repeats, target = item.params[1], jump_target(mission.items, index)
            more = left.setdefault(index, int(repeats) if 0 <= repeats < math.inf else _REPEATS)
            if more > 0 and target is not None:
                left[index] -= 1
                index = target
                continue
        yield index, item
        index += 1


class _Stop(NamedTuple):
    """A point (3,), m, of a stretch, with its item and what a `FlightPath` says of it."""

    point: Real
    item: int
    speed: float = 0.0
    hold: float = 0.0
    spline: bool = False
    radius: float = 0.0
    orbit: Orbit | None = None


@dataclass
class _Walk:
    """The flight so far, and the stretch still to be flown in one go from where it rests."""

    _mission: Mission
    _vehicle: Vehicle
    _frame: LocalFrame
    _step: float
    _wind: Vector
    _home: Real  # (3,), m
    over: bool = False
    _clock: float = 0.0
    _stretch: list[_Stop] = field(default_factory=list)
    _parts: list[tuple[Real, Real, Real, Real]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._type, self._changed, self._place = self._vehicle.type, self._vehicle, self._home
        self._model = self._vehicle.flight_model(self._frame.latitude)
        self._speed = self._model.cruise_speed
        self._longest = LONGEST_COPTER if self._type.hovers else LONGEST
        self._reached = np.full(len(self._mission.items), np.nan)

    def take(self, index: int, item: MissionItem) -> None:
        """Fly or obey one item."""
        match item.command:
            case _ if (orbit := self._vehicle.orbit(item, self._mission.home)) is not None:
                self._circle(index, self._spot(index, item), orbit)
            case Command.NAV_TAKEOFF | Command.NAV_VTOL_TAKEOFF:
                self._take_off(index, item)
            case Command.NAV_LAND | Command.NAV_VTOL_LAND:
                self._land(index, self._spot(index, item)[:2])
            case Command.NAV_RETURN_TO_LAUNCH:
                self._return(index)
            case Command.NAV_DELAY if self._type.hovers:
                self._towards(index, self._last)
            case Command.DO_CHANGE_SPEED:
                self._change_speed(item)
            case command if command in FLOWN_TO:
                self._towards(index, self._spot(index, item))
                self.over = command == Command.NAV_LOITER_UNLIM

    def track(self) -> Track:
        """Return everything flown."""
        self._fly()
        if not self._parts:
            self._show(0, np.zeros(1), self._place[None], np.zeros((1, 3)))
        t, position, velocity, item = map(np.concatenate, zip(*self._parts, strict=True))
        return Track(t, position, velocity, item.astype(int), self._reached, self._frame)

    @property
    def _last(self) -> Real:
        """Where the stretch ends so far, (3,) m."""
        return self._stretch[-1].point if self._stretch else self._place

    def _towards(self, index: int, goal: Real) -> None:
        """Go on to `goal` (3,), m, as the item says."""
        item, here, hold = self._mission.items[index], self._last, 0.0
        command, wait, radius = item.command, item.params[0], item.params[1]
        if self._type.hovers and command in (*HOLDING, Command.NAV_DELAY) and 0 < wait < math.inf:
            whole = self._type.whole_second_holds and command != Command.NAV_DELAY
            hold = math.floor(wait) if whole else wait
        if np.abs(goal - here).max() <= _SAME_PLACE:
            goal = here
        own = command == Command.NAV_WAYPOINT and 0 < radius < math.inf
        spline = command == Command.NAV_SPLINE_WAYPOINT
        stop = _Stop(goal, index, self._speed, hold, spline, radius if own else 0.0)
        self._stretch.append(stop)

    def _fly(self) -> None:
        """Fly the waypoints that are waiting."""
        stops, self._stretch = [_Stop(self._place, 0), *self._stretch], []
        if len(stops) == 1:
            return
        *told, orbits = zip(*stops, strict=True)
        points, items, speeds, holds, splines, radii = map(np.array, told)
        home, on_its_way = self._mission.home, not self._type.hovers and len(self._parts) > 0
        path = FlightPath(
            points=points,
            speeds=speeds[1:],
            holds=holds,
            splines=splines,
            radii=radii,
            longest=self._longest - self._clock,
            elevation=0.0 if home is None or math.isnan(home.altitude) else home.altitude,
            wind=self._wind,
            entry=self._parts[-1][2][-1] if on_its_way else None,
            orbits={k: orbit for k, orbit in enumerate(orbits) if orbit is not None},
        )
        # what it takes at least, without ramps
        ways = np.diff(path.points, axis=0)
        level, rise = np.hypot(ways[:, 0], ways[:, 1]) / path.speeds, ways[:, 2]
        limit = np.where(rise > 0, *map(self._changed.value, ("climb_speed", "descent_speed")))
        self._check_clock(float(np.maximum(level, np.abs(rise) / limit).sum() + np.sum(holds)))
        flown = self._model.fly(path, self._step)
        self._reached[items[1:]] = self._clock + flown.departures[1:]
        end = flown.departures[-1]
        t = np.append(flown.t[flown.t < end - _SHORTEST], end)
        leg = np.searchsorted(flown.departures[1:-1], t, side="right")
        columns = np.hstack([flown.position, flown.velocity]).T
        samples = np.stack([np.interp(t, flown.t, column) for column in columns], axis=-1)
        self._show(items[1:][leg], t, samples[:, :3], samples[:, 3:])

    def _take_off(self, index: int, item: MissionItem) -> None:
        self._fly()
        goal = self._spot(index, item)
        if self._type.hovers:
            lasting = self._vehicle.climb_time(float(goal[2] - self._place[2]), take_off=True)
            self._go(index, np.array([*self._place[:2], goal[2]]), lasting)
        if np.hypot(*(goal - self._place)[:2]) > _SAME_PLACE or not self._type.hovers:
            self._towards(index, goal)
            self._fly()
        self._reached[index] = self._clock

    def _circle(self, index: int, center: Real, orbit: Orbit) -> None:
        """Circle about `center` (3,), m: what hovers from the circle's nearest place on.

        The speed at which it does is that in calm air.
        """
        self.over, lasting = self.over or orbit.endless, orbit.lasting(self._speed)
        if not self._type.hovers:
            self._check_clock(lasting)
            self._stretch.append(_Stop(center, index, self._speed, orbit=orbit))
            return
        middle, height = complex(*center[:2]), center[2]
        edge = orbit.edge(middle, complex(*self._last[:2]))
        self._towards(index, np.array([edge.real, edge.imag, height]))
        self._fly()
        if lasting >= _SHORTEST:
            t = self._times(lasting)
            # angles count from east to north
            turning = (-1j if orbit.clockwise else 1j) * orbit.speed(self._speed) / orbit.radius
            out = (edge - middle) * np.exp(turning * t)
            along = turning * out
            along[[0, -1]] = 0.0
            position = [center[0] + out.real, center[1] + out.imag, np.full(len(t), height)]
            velocity = [along.real, along.imag, np.zeros(len(t))]
            self._show(index, t, np.stack(position, axis=1), np.stack(velocity, axis=1))
        self._reached[index] = self._clock

    def _return(self, index: int) -> None:
        self._fly()
        place = self._vehicle.returns_to(self._mission, self._frame, self._place, self._home)
        rise = float(place[2] - self._place[2])
        if self._type.hovers and rise > _SAME_PLACE:
            up = np.array([*self._place[:2], place[2]])
            self._go(index, up, self._vehicle.climb_time(rise))
        self._speed = self._model.cruise_speed
        if waiting := self._vehicle.waiting(self._mission.home, float(place[2])):
            self._circle(index, place, waiting)
        else:
            self._land(index, place[:2])

    def _land(self, index: int, ground: Real) -> None:
        """Fly level to above `ground` (2,), m, and sink to it."""
        self._towards(index, np.array([*ground, self._last[2]]))
        self._fly()
        self._go(index, np.append(ground, 0.0), self._vehicle.landing_time(self._place[2]))
        self._reached[index] = self._clock
        self.over = True

    def _go(self, index: int, goal: Real, lasting: float) -> None:
        """Move to `goal` at constant speed in `lasting` seconds."""
        if lasting >= _SHORTEST:
            t = self._times(lasting)
            velocity = np.tile((goal - self._place) / lasting, (len(t), 1))
            position = self._place + t[:, None] * velocity
            velocity[[0, -1]] = 0.0
            self._show(index, t, position, velocity)

    def _times(self, lasting: float) -> Real:
        """Return when to take samples of what goes on for `lasting` seconds, s."""
        self._check_clock(lasting)
        return np.linspace(0.0, lasting, max(2, math.ceil(lasting / self._step) + 1))

    def _show(self, item: Any, t: Real, position: Real, velocity: Real) -> None:
        """Be at `position` with `velocity` (n, 3), m and m/s, after `t` (n,) seconds from now.

        The first instant is the one that the last part ended with.
        """
        new = slice(1 if self._parts else 0, None)
        if len(t[new]):
            items = np.broadcast_to(item, t.shape)
            self._parts.append((self._clock + t[new], position[new], velocity[new], items[new]))
        self._clock, self._place = self._clock + float(t[-1]), position[-1]

    def _change_speed(self, item: MissionItem) -> None:
        change = self._type.dialect.speed_change(item)
        if change is None:
            return
        if change.axis not in ("climb", "descent"):
            self._speed = self._model.cruise_speed if change.speed is None else change.speed
        elif change.speed is not None:
            self._fly()
            self._changed = self._changed.having(f"{change.axis}_speed", change.speed)
            self._model = self._changed.flight_model(self._frame.latitude)

    def _spot(self, index: int, item: MissionItem) -> Real:
        """Return the place of `item`, (3,) m; that of the aircraft where 0, 0 stands for it.

        So does what is not set, of a take-off or a landing.
        """
        number, up = index + 1, height_above_home(item, self._mission)
        if not math.isfinite(up):
            raise InputError(
                f"mission item {number}: altitude {item.z:g}; expected metres, above the sea only "
                "with the altitude of home"
            )
        landing = item.command in LANDINGS
        unset = math.isnan(item.x + item.y) and (landing or item.command in TAKEOFFS)
        zero = (landing or self._type.dialect.zero_means_here) and not (item.x or item.y)
        if unset or zero:
            return np.append(self._last[:2], up)
        if not (abs(item.x) <= 90 and abs(item.y) <= 180):
            raise InputError(
                f"mission item {number}: {item.x}, {item.y} is no place to fly to; expected degrees"
            )
        return np.append(self._frame.to_local(item.x, item.y), up)

    def _check_clock(self, lasting: float) -> None:
        if not self._clock + lasting <= self._longest:
            raise InputError(
                f"the flight would take more than {self._longest / 3600:g} h and is not followed "
                "that far"
            )
