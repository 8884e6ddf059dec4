"""What the rules look at: a mission, its vehicle, and what follows from both."""

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.dialect import SpeedChange
from faao_mav.autopilot.orbit import CIRCLING, Orbit, height_above_home
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, FLOWN_TO, LANDINGS, Command, Frame
from faao_mav.mission.item import JUMPS, Mission, MissionItem, jump_target
from faao_mav.validate.demands import EnergyUse, Limits, LinkCheck

NAV_LAST = 95
"""Commands up to this number fly; the others do something on the way (MAV_CMD_NAV_LAST)."""

LARGEST = float(np.finfo(np.float32).max)
"""The largest number of single precision, which messages have."""


HOME = -1
"""The index of home, which is no item."""


@dataclass(frozen=True, slots=True)
class PlacedItem:
    """Where an item flies to: metres east and north of `ValidationContext.frame`, and above home.

    `index` is the item's, `HOME` for home. `up` is NaN where nothing tells it: heights above
    terrain, or above the sea without a home.
    """

    index: int
    east: float
    north: float
    up: float

    @property
    def name(self) -> str:
        """What people call it."""
        return "home" if self.index == HOME else f"item {self.index + 1}"

    @property
    def ground(self) -> Real:
        """East and north, (2,) m."""
        return np.array([self.east, self.north])

    @property
    def from_origin(self) -> float:
        """Metres over ground from the origin of the frame, which is home if there is one."""
        return math.hypot(self.east, self.north)


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight from one place to the next, ordered by the item at `index`.

    `speed` is what is commanded, m/s; `spline`: the aircraft curves to its end; `jump`: the item
    is a jump.
    """

    index: int
    start: PlacedItem
    end: PlacedItem
    speed: float
    spline: bool = False
    jump: bool = False

    @property
    def length(self) -> float:
        """Metres over ground."""
        return math.hypot(*(self.end.ground - self.start.ground))

    @property
    def rise(self) -> float:
        """Metres upwards; NaN if a height is unknown."""
        return self.end.up - self.start.up

    def turn(self, onward: "Straight") -> float:
        """Return the turn from here to the straight `onward`, rad, 0 to pi; 0 without a heading."""
        before, after = (complex(*(each.end.ground - each.start.ground)) for each in (self, onward))
        return abs(cmath.phase(after * before.conjugate()))


@dataclass(frozen=True)
class ValidationContext:
    """A mission to judge; parameters of its vehicle that are no use count as not given.

    `track` is the predicted flight, if that is known: with it speeds, heights, duration and fence
    are judged along the flight as well as along the straights between the items. `limits` are what
    the flight must stay within; `link` says what of a plan's rate it delivers, and `energy` what it
    takes. `airborne`: it is begun in the air, and needs no take-off.
    """

    mission: Mission
    vehicle: Vehicle
    track: Track | None = None
    limits: Limits = field(default_factory=Limits)
    link: LinkCheck | None = None
    airborne: bool = False
    energy: EnergyUse | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vehicle", self.vehicle.usable())

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """The items of the mission."""
        return self.mission.items

    def each(self, *commands: int) -> Iterator[tuple[int, MissionItem]]:
        """Yield index and item of the items with one of `commands`."""
        return ((k, item) for k, item in enumerate(self.items) if item.command in commands)

    @property
    def flying(self) -> Iterator[tuple[int, int]]:
        """Index and command of the items that fly, in order."""
        return ((k, item.command) for k, item in enumerate(self.items) if item.command <= NAV_LAST)

    @property
    def jumps(self) -> Iterator[tuple[int, MissionItem, int | None]]:
        """Index of each jump, the item, and the index that it goes to; None: there is none."""
        return ((k, item, jump_target(self.items, k)) for k, item in self.each(*JUMPS))

    @cached_property
    def stored(self) -> tuple[tuple[int, MissionItem, MissionItem], ...]:
        """Index of the items that the vehicle takes, the item, and what it gives back for it."""
        dialect = self.vehicle.type.dialect
        sent = ((k, item, dialect.sent(item)) for k, item in enumerate(self.items))
        taken = (each for each in sent if fits_message(each[1]) and not dialect.refusal(each[2]))
        return tuple((k, item, dialect.stored(own)) for k, item, own in taken)

    def parameter(self, key: str) -> tuple[float, str]:
        """Return the value of the vehicle's parameter `key`, and the name that sets it.

        A vehicle that has no such parameter has NaN, with which every comparison is false.
        """
        known = key in self.vehicle.type.parameters
        return self.value(key), self.vehicle.name_of(key) if known else ""

    def value(self, key: str, otherwise: float = math.nan) -> float:
        """Return the value of the parameter `key`, `otherwise` for a vehicle that has none."""
        return self.vehicle.value(key, otherwise)

    @cached_property
    def changes(self) -> tuple[SpeedChange | None, ...]:
        """What each item changes about the speed."""
        change, its = self.vehicle.type.dialect.speed_change, Command.DO_CHANGE_SPEED
        return tuple(change(item) if item.command == its else None for item in self.items)

    @cached_property
    def speeds(self) -> tuple[float, ...]:
        """The speed over ground commanded for the leg to each item, m/s."""
        cruise = self.vehicle.value("cruise_speed")
        speed, speeds = cruise, []
        for change in self.changes:
            if change is not None and change.axis in ("horizontal", "airspeed"):
                speed = cruise if change.speed is None else change.speed
            speeds.append(speed)
        return tuple(speeds)

    @cached_property
    def frame(self) -> LocalFrame | None:
        """The local frame: about home, else about the first place that it flies to."""
        if self.mission.home is not None:
            return LocalFrame(self.mission.home.latitude, self.mission.home.longitude)
        first = self.mission.first_place
        return None if first is None else LocalFrame(*first)

    @cached_property
    def home(self) -> PlacedItem | None:
        """Home, at the origin of the local frame, or None."""
        return PlacedItem(HOME, 0.0, 0.0, 0.0) if self.mission.home is not None else None

    @cached_property
    def places(self) -> tuple[PlacedItem, ...]:
        """Where the items fly to, in order; without those whose coordinates are unusable.

        ArduPilot takes 0, 0 for the place where it is.
        """
        if self.frame is None:
            return ()
        dialect = self.vehicle.type.dialect
        placed = [
            (k, item)
            for k, item in self.each(*FLOWN_TO)
            if abs(item.x) <= 90
            and abs(item.y) <= 180
            and (item.frame != Frame.MISSION or dialect.placed_in_mission_frame)
            and (dialect.zero_means_here or not at_zero(item))
        ]
        local = self.frame.to_local([item.x for _, item in placed], [item.y for _, item in placed])
        here, places = (0.0, 0.0), []
        for (k, item), (east, north) in zip(placed, local.tolist(), strict=True):
            if not at_zero(item):
                here = (east, north)
            if all(map(math.isfinite, here)):  # not so at the antipode
                places.append(PlacedItem(k, *here, self.height(item)))
        return tuple(places)

    def height(self, item: MissionItem) -> float:
        """Return metres above home to `item`, NaN where nothing tells them."""
        told = item.frame in ABOVE_HOME | ABOVE_SEA or item.frame == Frame.MISSION
        return height_above_home(item, self.mission) if told else math.nan

    @cached_property
    def orbits(self) -> dict[int, Orbit]:
        """How the vehicle circles, by the index of the item."""
        found = ((k, self.vehicle.orbit(item)) for k, item in self.each(*FLOWN_TO))
        return {k: orbit for k, orbit in found if orbit is not None}

    @cached_property
    def circles(self) -> dict[int, Real]:
        """The outlines (k, 2), m, of circles by the index of their item.

        What cannot hover circles where a return ends, and where a mission without an end does.
        """
        placed = (place for place in self.places if place.index in self.orbits)
        circles = {place.index: self.orbits[place.index].outline(place.ground) for place in placed}
        waiting = self.vehicle.orbit(CIRCLING)
        for last in self.legs[-1:] if waiting is not None else ():
            returns = self.items[last.index].command == Command.NAV_RETURN_TO_LAUNCH
            ends = self.items[last.index].command in LANDINGS or last.jump
            if waiting and (returns or not (ends or last.end.index in self.orbits)):
                circles[last.index] = waiting.outline(last.end.ground)
        return circles

    @cached_property
    def legs(self) -> tuple[Straight, ...]:
        """The straights that the items order: from home, between the places, back, by jumps.

        They lead to circles and away from them at their nearest places. A return to launch ends at
        home, or at the rally point that the vehicle chooses.
        """
        return tuple(
            replace(leg, start=self._edge(leg.start, leg.end), end=self._edge(leg.end, leg.start))
            for leg in self._legs()
        )

    def _legs(self) -> Iterator[Straight]:
        """Yield the straights between the centres of circles."""
        by_index = {place.index: place for place in self.places}
        targets = {k: target for k, _, target in self.jumps if target is not None}
        here = self.home
        for k, item in enumerate(self.items):
            speed, place = self.speeds[k], by_index.get(k)
            if here is not None and place is not None:
                spline = item.command == Command.NAV_SPLINE_WAYPOINT
                yield Straight(k, here, place, speed, spline=spline)
            elif here is not None and self.home and item.command == Command.NAV_RETURN_TO_LAUNCH:
                yield Straight(k, here, self._returns_to(here, self.home), speed)
            elif here is not None and k in targets:
                after = (place for place in self.places if place.index >= targets[k])
                yield from (Straight(k, here, end, speed, jump=True) for end in islice(after, 1))
            here = place or here

    def _edge(self, place: PlacedItem, towards: PlacedItem) -> PlacedItem:
        """Return where a straight from `towards` meets the circle at `place`; it, without one."""
        orbit = self.orbits.get(place.index)
        if orbit is None:
            return place
        east, north = orbit.edge(place.ground, towards.ground).tolist()
        return replace(place, east=east, north=north)

    def _returns_to(self, here: PlacedItem, home: PlacedItem) -> PlacedItem:
        """Return where a return from `here` ends, at a height that nothing tells."""
        assert self.frame is not None
        start = np.append(here.ground, here.up)
        east, north, _ = self.vehicle.returns_to(self.mission, self.frame, start, home.ground)
        return PlacedItem(HOME, float(east), float(north), math.nan)

    @cached_property
    def track_positions(self) -> Real | None:
        """The track's positions (n, 3) in the local frame, or None without a track."""
        return None if self.track is None or self.frame is None else self.track.within(self.frame)


def at_zero(item: MissionItem) -> bool:
    """Say whether x and y are 0, 0: for most files, not set."""
    return item.x == 0 and item.y == 0


def fits_message(item: MissionItem) -> bool:
    """Say whether a MISSION_ITEM_INT can carry the numbers of `item`."""
    return not any(abs(value) > LARGEST for value in (*item.params, item.z))
