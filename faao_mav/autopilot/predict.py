"""How a vehicle will fly a whole mission, from take-off to its end.

Waypoints are flown by the vehicle's model, stretch by stretch from rest to rest; take-off, landing
and the return are climbs and descents at constant speed with what the autopilot adds to them.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.dialect import name_of
from faao_mav.autopilot.flight_path import LONGEST, FlightPath, Track
from faao_mav.autopilot.orbit import Orbit
from faao_mav.autopilot.vehicle import Vehicle
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import ABOVE_SEA, FLOWN_TO, Command, Frame
from faao_mav.mission.item import Mission, MissionItem
from faao_mav.mission.jumps import JUMPS, jump_target
from faao_mav.vector import Vector

LONGEST_COPTER = 5_400.0
"""The longest flight, s, of what can hover that is followed. Chosen: few copters can stay up for
1.5 hours, in which the model of PX4 takes 54,000 steps and 3 to 4 s of processor time."""

_MOST_STEPS = 2000
"""The largest number of items that are flown, repeats by DO_JUMP included. Chosen: a few seconds of
work at most, whatever a file or a peer asks for."""

_REPEATS = 20
"""How often a jump that never ends is followed. Chosen."""

_SAME_PLACE = 0.01
"""The distance, m, below which two places are one."""

_CIRCLING = MissionItem(Command.NAV_LOITER_UNLIM, Frame.GLOBAL_RELATIVE_ALT)
"""How a vehicle that does not land on its return goes on."""

_SHORTEST = 1e-3
"""The shortest motion, s, that is worth a sample."""


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
    """
    start = _start(mission)
    if start is None:
        empty = np.empty((0, 3))
        reached = np.full(len(mission.items), np.nan)
        none = np.empty(0, dtype=int)
        return Track(np.empty(0), empty, empty, none, reached, frame or LocalFrame(0.0, 0.0))
    frame = frame or LocalFrame(*start)
    walk = _Walk(mission, vehicle, frame, step, np.append(frame.to_local(*start), 0.0), wind)
    for index, item in _in_order(mission):
        walk.take(index, item)
        if walk.over:
            break
    walk.fly()
    return walk.track()


def _start(mission: Mission) -> tuple[float, float] | None:
    """Return where the flight begins, degrees; None if the mission has no places at all."""
    if not any(item.command in FLOWN_TO for item in mission.items):
        return None
    if mission.home is not None:
        return mission.home.latitude, mission.home.longitude
    return mission.first_place or (0.0, 0.0)


def _in_order(mission: Mission) -> Iterator[tuple[int, MissionItem]]:
    """Yield the items that are flown, jumps followed."""
    left: dict[int, int] = {}
    index = steps = 0
    while index < len(mission.items) and steps < _MOST_STEPS:
        item, steps = mission.items[index], steps + 1
        if item.command in JUMPS:
            to, repeats = item.params[0], item.params[1]
            if not (math.isfinite(to) and math.isfinite(repeats)):
                raise InputError(
                    f"mission item {index + 1}: {name_of(item.command)} to {to:g}, {repeats:g} "
                    "times; expected numbers"
                )
            more = left.setdefault(index, _REPEATS if repeats < 0 else int(repeats))
            target = jump_target(mission.items, index)
            if more > 0 and target is not None:
                left[index] -= 1
                index = target
                continue
        yield index, item
        index += 1


@dataclass
class _Stop:
    """A point (3,), m, of a stretch, with its item and what a `FlightPath` says of it.

    `waits` are further items that only make the aircraft wait here.
    """

    point: Real
    item: int
    speed: float = math.nan
    hold: float = 0.0
    delay: float = 0.0
    spline: bool = False
    radius: float = 0.0
    waits: list[int] = field(default_factory=list)


@dataclass
class _Walk:
    """The flight so far, and the stretch still to be flown in one go from where it rests."""

    mission: Mission
    vehicle: Vehicle
    frame: LocalFrame
    step: float
    home: Real
    wind: Vector
    stretch: list[_Stop] = field(default_factory=list)
    parts: list[tuple[Real, Real, Real, Real]] = field(default_factory=list)
    clock: float = 0.0
    over: bool = False

    def __post_init__(self) -> None:
        self.vertical = self.vehicle.vertical
        self.flying = self.vehicle
        self.model = self.vehicle.flight_model(self.frame.latitude)
        self.speed = self.model.cruise_speed
        self.place = self.goal = self.home
        self.reached = np.full(len(self.mission.items), np.nan)
        self.longest = LONGEST_COPTER if self.vehicle.type.hovers else LONGEST
        home = self.mission.home
        self._elevation = 0.0 if home is None or math.isnan(home.altitude) else home.altitude

    def take(self, index: int, item: MissionItem) -> None:
        """Fly or obey one item."""
        hold = item.params[0] if math.isfinite(item.params[0]) else 0.0
        orbit = self.vehicle.type.orbits(self.vehicle, self.vehicle.type.dialect.sent(item))
        match item.command:
            case _ if orbit is not None:
                self._circle(index, self._spot(index, item), orbit)
            case Command.NAV_TAKEOFF | Command.NAV_VTOL_TAKEOFF:
                self._take_off(index, item)
            case Command.NAV_WAYPOINT | Command.NAV_SPLINE_WAYPOINT:
                self._waypoint(index, item, max(hold, 0.0) if self.vehicle.type.hovers else 0.0)
            case Command.NAV_LOITER_TIME:
                self._waypoint(index, item, max(hold, 0.0))
            case Command.NAV_LOITER_UNLIM:
                self._waypoint(index, item, 0.0)
                self.over = True
            case Command.NAV_LAND | Command.NAV_VTOL_LAND:
                self._land(index, item)
            case Command.NAV_RETURN_TO_LAUNCH:
                self._return(index)
            case Command.NAV_DELAY if self.vehicle.type.hovers:
                self._delay(index, max(hold, 0.0))
            case Command.DO_CHANGE_SPEED:
                self._change_speed(item)
            case command if command in FLOWN_TO:
                self._waypoint(index, item, 0.0)

    def track(self) -> Track:
        """Return everything flown."""
        if not self.parts:  # one sample, at rest
            at_rest = (np.array([self.clock]), self.place[None], np.zeros((1, 3)), np.zeros(1))
            self.parts.append(at_rest)
        t, position, velocity, item = (
            np.concatenate(part) for part in zip(*self.parts, strict=True)
        )
        return Track(t, position, velocity, item.astype(int), self.reached, self.frame)

    def fly(self) -> None:
        """Fly the waypoints that are waiting."""
        stops, self.stretch = self.stretch, []
        if not stops:
            return
        if len(stops) == 1:
            self._go(stops[0].item, self.place, stops[0].delay)
            self.reached[stops[0].waits] = self.clock
            return
        path = FlightPath(
            points=np.array([stop.point for stop in stops]),
            speeds=np.array([stop.speed for stop in stops[1:]]),
            holds=np.array([stop.hold for stop in stops]),
            splines=np.array([stop.spline for stop in stops]),
            radii=np.array([stop.radius for stop in stops]),
            delays=np.array([stop.delay for stop in stops]),
            longest=self.longest - self.clock,
            elevation=self._elevation,
            wind=self.wind,
            entry=None if self.vehicle.type.hovers or not self.parts else self.parts[-1][2][-1],
        )
        self._check_clock(self._at_least(path))
        flown = self.model.fly(path, self.step)
        end = float(flown.departures[-1])
        kept = flown.t <= end
        leg = np.searchsorted(flown.departures[1:], flown.t[kept], side="right")
        items = np.array([stop.item for stop in stops[1:]])[np.minimum(leg, len(stops) - 2)]
        self._add(flown.t[kept], flown.position[kept], flown.velocity[kept], items)
        for stop, done in zip(stops, flown.departures, strict=True):
            own = [] if stop is stops[0] else [stop.item]
            self.reached[own + stop.waits] = self.clock + done
        self.clock += end
        self.place = np.array([np.interp(end, flown.t, x) for x in flown.position.T])
        self.goal = path.points[-1]

    def _at_least(self, path: FlightPath) -> float:
        """Return how long `path` takes without ramps, s."""
        ways = np.diff(path.points, axis=0)
        speeds = np.where(path.speeds > 0, path.speeds, self.model.cruise_speed)
        level, rise = np.hypot(ways[:, 0], ways[:, 1]) / speeds, ways[:, 2]
        limit = np.where(rise > 0, self.vertical.climb_speed, self.vertical.descent_speed)
        legs = np.maximum(level, np.abs(rise) / limit)
        return float(legs.sum() + np.sum(path.holds + path.delays))

    def _take_off(self, index: int, item: MissionItem) -> None:
        self.fly()
        here = self.vehicle.type.dialect.zero_means_here and not (item.x or item.y)
        unset = math.isnan(item.x) or math.isnan(item.y)
        goal = self._height_over(self.place, item, index)
        if not (here or unset):
            goal = self._spot(index, item)
        if self.vehicle.type.hovers:
            climb = np.array([self.place[0], self.place[1], goal[2]])
            self._go(index, climb, self.vertical.take_off(float(goal[2] - self.place[2])))
        if np.hypot(*(goal - self.place)[:2]) > _SAME_PLACE or not self.vehicle.type.hovers:
            self._towards(index, goal, 0.0)
            self.fly()
        self.reached[index] = self.clock

    def _waypoint(self, index: int, item: MissionItem, hold: float) -> None:
        radius = item.params[1] if item.command == Command.NAV_WAYPOINT else 0.0
        spline = item.command == Command.NAV_SPLINE_WAYPOINT
        radius = radius if math.isfinite(radius) and radius > 0 else 0.0
        self._towards(index, self._spot(index, item), hold, spline=spline, radius=radius)

    def _towards(
        self, index: int, goal: Real, hold: float, *, spline: bool = False, radius: float = 0.0
    ) -> None:
        last = self._last_stop(index)
        if np.abs(goal - last.point).max() <= _SAME_PLACE:
            self._delay(index, math.floor(hold) if self.vehicle.type.whole_second_holds else hold)
        else:
            stop = _Stop(goal, index, self.speed, hold, spline=spline, radius=radius)
            self.stretch.append(stop)

    def _circle(self, index: int, center: Real, orbit: Orbit) -> None:
        """Fly to the nearest place of a circle about `center` (3,), then round it.

        Speeds on it are those in calm air.
        """
        here = self.stretch[-1].point if self.stretch else self.place
        edge = orbit.edge(center[:2], here[:2])
        self._towards(index, np.array([*edge, here[2] if orbit.climbs else center[2]]), 0.0)
        self.fly()
        rise, speed = float(center[2] - self.place[2]), orbit.speed(self.speed)
        rate = self.vertical.climb_speed if rise > 0 else self.vertical.descent_speed
        lasting = orbit.lasting(self.speed, abs(rise) / rate)
        if lasting >= _SHORTEST:
            self._check_clock(lasting)
            t = np.linspace(0.0, lasting, max(2, math.ceil(lasting / self.step) + 1))
            sense = -1.0 if orbit.clockwise else 1.0  # angles count from east to north
            angle = math.atan2(*(edge - center[:2])[::-1]) + sense * speed / orbit.radius * t
            out = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            along = sense * speed * np.stack([-out[:, 1], out[:, 0]], axis=1)
            up = self.place[2] + np.clip(np.sign(rise) * rate * t, min(rise, 0), max(rise, 0))
            climbing = np.where(t < abs(rise) / rate, np.sign(rise) * rate, 0.0)
            position = np.column_stack([center[:2] + orbit.radius * out, up])
            if self.vehicle.type.hovers:
                along[[0, -1]] = 0.0
            self._add(t, position, np.column_stack([along, climbing]), np.full(len(t), index))
            self.clock += lasting
            self.place = self.goal = position[-1]
        self.reached[index] = self.clock
        self.over = self.over or orbit.endless

    def _delay(self, index: int, seconds: float) -> None:
        last = self._last_stop(index)
        last.delay += seconds
        last.waits.append(index)

    def _last_stop(self, index: int) -> _Stop:
        """Return where the stretch ends so far; it begins with item `index` where there is none."""
        self.stretch = self.stretch or [_Stop(self.place, index)]
        return self.stretch[-1]

    def _land(self, index: int, item: MissionItem) -> None:
        here = self.stretch[-1].point if self.stretch else self.place
        goal = self._height_over(here, item, index)
        if (item.x or item.y) and not (math.isnan(item.x) or math.isnan(item.y)):
            goal[:2] = self.frame.to_local(item.x, item.y)
        self._towards(index, np.array([goal[0], goal[1], here[2]]), 0.0)
        self._descend(index)

    def _return(self, index: int) -> None:
        self.fly()
        rally = [self.frame.to_local(p.latitude, p.longitude) for p in self.mission.rally]
        chosen = self.vehicle.type.rally(self.vehicle).chosen(self.place[:2], self.home[:2], rally)
        goal = self.home[:2] if chosen is None else rally[chosen]
        level = self.vertical.returns_at(float(self.place[2]))
        if chosen is not None and not math.isnan(height := self.mission.rally[chosen].altitude):
            level = max(level, height) if self.vertical.lands_on_return else height
        if self.vehicle.type.hovers and level > self.place[2] + _SAME_PLACE:
            up = np.array([self.place[0], self.place[1], level])
            self._go(index, up, self.vertical.climb(level - float(self.place[2])))
        self.speed = self.model.cruise_speed
        place = np.array([goal[0], goal[1], level])
        orbit = self.vehicle.type.orbits(self.vehicle, _CIRCLING)
        if orbit is not None and not self.vertical.lands_on_return:
            self._circle(index, place, orbit)
            return
        self._towards(index, place, 0.0)
        self._descend(index)

    def _descend(self, index: int) -> None:
        self.fly()
        ground = np.array([self.goal[0], self.goal[1], 0.0])
        self._go(index, ground, self.vertical.descend(float(self.place[2])))
        self.reached[index] = self.clock
        self.over = True

    def _go(self, index: int, goal: Real, lasting: float) -> None:
        """Move to `goal` at constant speed in `lasting` seconds."""
        if lasting < _SHORTEST:
            return
        self._check_clock(lasting)
        t = np.linspace(0.0, lasting, max(2, math.ceil(lasting / self.step) + 1))
        way = (goal - self.place) / lasting
        position = self.place + t[:, None] * way
        velocity = np.tile(way, (len(t), 1))
        velocity[[0, -1]] = 0.0
        self._add(t, position, velocity, np.full(len(t), index))
        self.clock += lasting
        self.place = self.goal = goal

    def _add(self, t: Real, position: Real, velocity: Real, item: Real) -> None:
        first = 1 if self.parts else 0  # the instant that the last part ended with
        if len(t) > first:
            self.parts.append(
                (t[first:] + self.clock, position[first:], velocity[first:], item[first:])
            )

    def _change_speed(self, item: MissionItem) -> None:
        change = self.vehicle.type.dialect.speed_change(item)
        if change is None:
            return
        if change.axis in ("climb", "descent"):
            if change.speed is not None:
                self.fly()
                self.flying = self.flying.having(f"{change.axis}_speed", change.speed)
                self.model = self.flying.flight_model(self.frame.latitude)
        else:
            self.speed = self.model.cruise_speed if change.speed is None else change.speed

    def _spot(self, index: int, item: MissionItem) -> Real:
        """Return the place of `item`, (3,) m."""
        if not (abs(item.x) <= 90 and abs(item.y) <= 180):
            raise InputError(
                f"mission item {index + 1}: {item.x}, {item.y} is no place to fly to; "
                "expected degrees"
            )
        return self._height_over(np.append(self.frame.to_local(item.x, item.y), 0.0), item, index)

    def _height_over(self, place: Real, item: MissionItem, index: int) -> Real:
        """Return `place` at the height of `item` above home."""
        if not math.isfinite(item.z):
            raise InputError(f"mission item {index + 1}: altitude {item.z}; expected metres")
        height = item.z
        if item.frame in {int(frame) for frame in ABOVE_SEA | {Frame.MISSION}}:
            home = self.mission.home
            if home is None or math.isnan(home.altitude):
                raise InputError(
                    f"mission item {index + 1}: an altitude above sea level needs that of the "
                    "mission's home, which the file does not have"
                )
            height -= home.altitude
        return np.array([place[0], place[1], height])

    def _check_clock(self, lasting: float) -> None:
        if not self.clock + lasting <= self.longest:
            raise InputError(
                f"the flight would take more than {self.longest / 3600:g} h and is not followed "
                "that far"
            )
