"""What the rules look at: a mission, its vehicle, and what follows from both."""

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice

import numpy as np

from faao_mav.arrays import Complex
from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.dialect import SpeedChange
from faao_mav.autopilot.model import Orbit
from faao_mav.autopilot.vehicle_type import height_above_home
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, FLOWN_TO, LANDINGS, Command, Frame
from faao_mav.mission.item import JUMPS, Mission, MissionItem, jump_target
from faao_mav.validate.demands import EnergyUse, Limits, LinkCheck

# Commands up to this number fly; the others do something on the way (MAV_CMD_NAV_LAST).
NAV_LAST = 95
# The largest number of single precision, which messages have.
LARGEST = float(np.finfo(np.float32).max)
HOME = -1  # The index of home, which is no item.


@dataclass(frozen=True, slots=True)
class PlacedItem:
    """Where an item flies to, in `ValidationContext.frame`.

    `index` is the item's, `HOME` for home; `place` is m east + i m north, `up` m above home: NaN
    where nothing tells it, as above terrain, or above the sea without a home.
    """

    index: int
    place: complex
    up: float

    @property
    def name(self) -> str:
        """What people call it."""
        return "home" if self.index == HOME else f"item {self.index + 1}"

    @property
    def from_origin(self) -> float:
        """Metres over ground from the origin of the frame, which is home if there is one."""
        return abs(self.place)


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
    def way(self) -> complex:
        """Metres east + i metres north from its start to its end."""
        return self.end.place - self.start.place

    @property
    def length(self) -> float:
        """Metres over ground."""
        return abs(self.way)

    @property
    def rise(self) -> float:
        """Metres upwards; NaN if a height is unknown."""
        return self.end.up - self.start.up

    def turn(self, onward: "Straight") -> float:
        """Return the turn from here to the straight `onward`, rad, 0 to pi; 0 without a heading."""
        return abs(cmath.phase(onward.way * self.way.conjugate()))


@dataclass(frozen=True)
class ValidationContext:
    """A mission to judge; parameters of its vehicle that are no use count as not given.

    `track` is the predicted flight, if that is known: with it speeds, heights, duration and fence
    are judged along the flight as well as along the straights between the items. `limits` are what
    the flight must stay within; `link` says what of a plan's rate it delivers, and `energy` what it
    takes; where there is a plan and no track `unpredicted` says why. `airborne`: it is begun in the
    air, and needs no take-off.
    """

    mission: Mission
    vehicle: Vehicle
    track: Track | None = None
    limits: Limits = field(default_factory=Limits)
    link: LinkCheck | None = None
    airborne: bool = False
    energy: EnergyUse | None = None
    unpredicted: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "vehicle", self.vehicle.usable())
        if self.frame is None or self.track is None or not len(self.track.t):
            object.__setattr__(self, "track", None)

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

    @property
    def home(self) -> PlacedItem | None:
        """Home, at the origin of the local frame, or None."""
        return PlacedItem(HOME, 0j, 0.0) if self.mission.home is not None else None

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
            and (item.frame != Frame.MISSION or Frame.MISSION in dialect.frames)
            and (dialect.zero_means_here or not at_zero(item))
        ]
        local = self.frame.to_local([item.x for _, item in placed], [item.y for _, item in placed])
        here, places = 0j, []
        for (k, item), place in zip(placed, (local @ (1, 1j)).tolist(), strict=True):
            here = here if at_zero(item) else place
            if cmath.isfinite(here):  # not so at the antipode
                places.append(PlacedItem(k, here, self.height(item)))
        return tuple(places)

    def height(self, item: MissionItem) -> float:
        """Return metres above home to `item`, NaN where nothing tells them."""
        told = item.frame in ABOVE_HOME | ABOVE_SEA or item.frame == Frame.MISSION
        return height_above_home(item, self.mission) if told else math.nan

    @cached_property
    def orbits(self) -> dict[int, Orbit]:
        """How the vehicle circles, by the index of the item."""
        sent = ((k, item) for k, item in self.each(*FLOWN_TO) if fits_message(item))
        found = ((k, self.vehicle.orbit(item, self.mission.home)) for k, item in sent)
        return {k: orbit for k, orbit in found if orbit is not None}

    @cached_property
    def circles(self) -> dict[int, Complex]:
        """The outlines (k,), m east + i m north, of circles by the index of their item.

        What cannot hover circles where a return ends, and where a mission without an end does.
        """
        placed = (place for place in self.places if place.index in self.orbits)
        circles = {place.index: self.orbits[place.index].outline(place.place) for place in placed}
        for last in self.legs[-1:]:
            waiting = self.vehicle.waiting(self.mission.home, last.end.up)
            command = self.items[last.index].command
            ends = command in LANDINGS or last.jump or last.end.index in self.orbits
            if waiting is not None and (command == Command.NAV_RETURN_TO_LAUNCH or not ends):
                circles[last.index] = waiting.outline(last.end.place)
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
                yield Straight(k, here, self._returns_to(here), speed)
            elif here is not None and k in targets:
                after = (place for place in self.places if place.index >= targets[k])
                yield from (Straight(k, here, end, speed, jump=True) for end in islice(after, 1))
            here = place or here

    def _edge(self, place: PlacedItem, towards: PlacedItem) -> PlacedItem:
        """Return where a straight from `towards` meets the circle at `place`; it, without one."""
        orbit = self.orbits.get(place.index)
        return (
            place if orbit is None else replace(place, place=orbit.edge(place.place, towards.place))
        )

    def _returns_to(self, here: PlacedItem) -> PlacedItem:
        """Return where a return from `here` ends, at a height that nothing tells."""
        assert self.frame is not None
        start = np.array([here.place.real, here.place.imag, here.up])
        east, north, _ = self.vehicle.returns_to(self.mission, self.frame, start, np.zeros(2))
        return PlacedItem(HOME, complex(east, north), math.nan)

    @cached_property
    def flown(self) -> Complex:
        """Where the track is in the local frame, (n,), m east + i m north; n = 0 without one."""
        if self.track is None or self.frame is None:
            return np.empty(0, dtype=complex)
        return np.asarray(self.track.within(self.frame)[:, :2] @ (1, 1j), dtype=complex)


def at_zero(item: MissionItem) -> bool:
    """Say whether x and y are 0, 0: for most files, not set."""
    return item.x == 0 and item.y == 0


def fits_message(item: MissionItem) -> bool:
    """Say whether a MISSION_ITEM_INT can carry the numbers of `item`."""
    return not any(abs(value) > LARGEST for value in (*item.params, item.z))
