"""What an autopilot does with the items that it is given.

Read in the autopilots' sources and measured on ArduCopter 4.7 and PX4 1.16 in simulation.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.autopilot.parameter import ParameterValues
from faao_mav.files import table
from faao_mav.mission.command import (
    CIRCLE,
    FENCE_RETURN_POINT,
    FLOWN_TO,
    POLYGON,
    RALLY_POINT,
    Command,
)
from faao_mav.mission.item import MissionItem

Codec: TypeAlias = Callable[[float], float]
"""What is read back for a number that was sent."""

Codecs: TypeAlias = tuple[Codec, Codec, Codec, Codec]
"""Those of param1 to param4."""

SpeedAxis: TypeAlias = Literal["horizontal", "climb", "descent", "airspeed", "least ground speed"]


def dropped(_: float) -> float:
    """Not stored: reads back as 0."""
    return 0.0


def single(value: float) -> float:
    """Stored as it came over the wire, in single precision."""
    return float(np.float32(value))


def whole(least: int, most: int) -> Codec:
    """Stored as a whole number: fractions are cut off, what is out of range ends at its limit."""

    def codec(value: float) -> float:
        return 0.0 if math.isnan(value) else float(math.trunc(min(max(value, least), most)))

    return codec


uint8, uint16, int16 = whole(0, 255), whole(0, 65_535), whole(-32_768, 32_767)


def _radius(value: float) -> float:
    """Whole metres, and to which side."""
    return math.copysign(uint16(abs(value)), value) if abs(value) >= 1 else 0.0


def _turning_radius(value: float) -> float:
    """Eight bits: above 255 m in tens of metres."""
    radius = abs(value)
    stored = uint8(radius) if radius <= 255 else 10 * uint8(float(np.float32(radius) * 0.1))
    return math.copysign(stored, value) if stored else 0.0


def _heading(value: float) -> float:
    """Degrees from 0 to below 360; NaN, no heading, stays."""
    turned = float(np.float32(value) % np.float32(360))
    return 0.0 if turned == 360 else turned  # just below 0 rounds up


_CODECS: dict[str, Codec] = {
    "-": dropped,
    "single": single,
    "uint8": uint8,
    "uint16": uint16,
    "int8": whole(-128, 127),
    "int16": int16,
    "flag": lambda value: 1.0 if value > 0 else 0.0,
    "direction": lambda value: -1.0 if value < 0 else 1.0,
    "radius": _radius,
    "turning_radius": _turning_radius,
    "heading": _heading,
}

ALL: Codecs = (single, single, single, single)
"""All four parameters are stored."""

UNKNOWN: Codecs = (float, float, float, float)
"""It is not known what is stored: everything, as far as is told."""

_NOTHING: Codecs = (dropped, dropped, dropped, dropped)
_WORDS = {"all": ALL, "nothing": _NOTHING, "unknown": UNKNOWN}


def commands_of(vehicle: str) -> tuple[dict[int, Codecs], dict[int, Codecs]]:
    """Return the commands that `vehicle` takes with a place, and those without one.

    They are those of `commands.tsv`, with what is stored of param1 to param4. What an ArduPilot of
    a kind stores and passes over is told there too, and the bits of ARMING_MIS_ITEMS.
    """
    taken: dict[str, dict[int, Codecs]] = {"place": {}, "no place": {}}
    for row in table("autopilot/commands.tsv"):
        for told in filter(None, row[vehicle].split("; ")):
            where, words = told.split(": ")
            if (codecs := _WORDS.get(words)) is None:
                one, two, three, four = (_CODECS[word] for word in words.split())
                codecs = one, two, three, four
            taken[where][int(row["command"])] = codecs
    return taken["place"], taken["no place"]


def _first(codec: Codec) -> Codecs:
    return (codec, dropped, dropped, dropped)


BESIDE: dict[int, Codecs] = (
    dict.fromkeys(POLYGON.values(), _first(uint16))
    | dict.fromkeys(CIRCLE.values(), _first(single))
    | dict.fromkeys((FENCE_RETURN_POINT, RALLY_POINT), _NOTHING)
)
"""What every autopilot measured keeps of the parameters of fence and rally rows: how many vertices
a polygon has, and the radius of a circle."""


@dataclass(frozen=True, slots=True)
class Limit:
    """How many of something fit: `sure` on boards in common use, never more than `most`."""

    sure: int
    most: int


@dataclass(frozen=True, slots=True)
class SpeedChange:
    """A speed that is set, m/s; None: back to the one that the parameters say."""

    axis: SpeedAxis
    speed: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """How one autopilot takes missions."""

    name: str  # What takes them, as messages say it
    home_row: bool  # Item 0 on the wire is home, which the vehicle replaces by its own
    items: Limit  # How many items fit, the home row included
    jumps: Limit | None  # How many DO_JUMPs keep count of their repeats; None: all
    # How many vertices and circles, and how many rally points, fit on the smallest boards in common
    # use
    fence_rows: int
    rally_rows: int
    atomic: bool  # A refused upload leaves the old mission as it was
    unset_is_zero: bool  # It refuses most parameters that are not set (NaN), and is sent 0 instead
    zero_means_here: bool  # Latitude and longitude 0, 0 stand for the place where the vehicle is
    # The commands that it takes with a place and without one, with what is stored of their
    # parameters; what has no place is stored at 0, 0, 0 unless it `keeps_idle` numbers
    placed: Mapping[int, Codecs]
    unplaced: Mapping[int, Codecs]
    # The frames in which it takes those and these, and in which it gives them back; what has a
    # place in frame 2 (MISSION) is above sea level
    frames: Mapping[int, int]
    idle_frames: Mapping[int, int]
    # What a DO_CHANGE_SPEED changes, None for one that changes nothing
    speed_change: Callable[[MissionItem], SpeedChange | None]
    # Where NaN is refused, the parameters, from 0, of commands that may be NaN
    may_be_unset: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    # What is stored of the altitude of an item, of a row of the fence and of a rally point
    altitude: Codec = single
    fence_altitude: Codec = single
    rally_altitude: Codec = single
    highest: float | None = None  # The altitude, m, from which on items are refused; None: none is
    always_continues: bool = False  # It stores no autocontinue, which reads back as true
    keeps_idle: bool = True
    # Whether the vehicle's parameters make room for any number of items, and `make_room` how to set
    # them so
    unlimited: Callable[[ParameterValues], bool] = lambda _: False
    make_room: str = ""
    # The commands behind which nothing is flown
    endings: frozenset[int] = frozenset({Command.NAV_LOITER_UNLIM, Command.NAV_RETURN_TO_LAUNCH})
    # Whether, by the vehicle's parameters, a take-off behind a landing is flown
    flies_on: Callable[[ParameterValues], bool] = lambda _: False

    def sent(self, item: MissionItem) -> MissionItem:
        """Return `item` as it is sent: what is not set as 0 where NaN is refused.

        The altitude of a place to fly to stays: 0 m would be another place.
        """
        if not self.unset_is_zero:
            return item
        up = item.z if item.command in FLOWN_TO or not math.isnan(item.z) else 0.0
        return replace(item, params=_each((_set,) * 4, item), z=up)

    def refusal(self, item: MissionItem) -> str | None:
        """Return why `item` is refused on upload, None if it is taken."""
        kind, command = item.command, name_of(item.command)
        if kind not in self.placed and kind not in self.unplaced:
            return f"{self.name} does not support {command} in missions"
        for index, value in enumerate(item.params if self.unset_is_zero else ()):
            if math.isnan(value) and index not in self.may_be_unset.get(kind, ()):
                return f"{self.name} takes no NaN in param{index + 1} of {command}; give 0"
        placed = self.frames if kind in self.placed else {}
        idle = self.idle_frames if kind in self.unplaced else {}
        if item.frame not in placed:
            give = ", ".join(str(int(frame)) for frame in sorted({*placed, *idle}))
            refused = f"{self.name} takes no {command} in frame {item.frame}; give one of {give}"
            return None if item.frame in idle else refused
        for name, value, limit in (("latitude", item.x, 90), ("longitude", item.y, 180)):
            if not abs(value) <= limit:
                return f"{self.name} takes no {name} {value:g}; give degrees within {limit}"
        if self.highest is not None and not abs(item.z) < self.highest:
            return f"{self.name} takes no altitude {item.z:g}; give metres below {self.highest:g}"
        return None

    def stored(self, item: MissionItem) -> MissionItem:
        """Return what reading back gives for a row of the mission, the fence or the rally points.

        Numbers went over the wire: parameters and altitude are of single precision, degrees
        multiples of 1e-7. What the autopilot has no room for is gone.
        """
        rally, (x, y) = item.command == RALLY_POINT, map(degrees, (item.x, item.y))
        if item.command in BESIDE:
            params, frame = _each(BESIDE[item.command], item), self.frames[0]
            frame = self.frames.get(item.frame, frame) if rally else frame
            up = (self.rally_altitude if rally else self.fence_altitude)(item.z)
            goes_on = item.autocontinue and rally and not self.always_continues
            return MissionItem(item.command, frame, params, x, y, up, autocontinue=goes_on)
        item = replace(item, autocontinue=item.autocontinue or self.always_continues)
        if item.command in self.placed and item.frame in self.frames:
            params, frame = _each(self.placed[item.command], item), self.frames[item.frame]
            return replace(item, params=params, frame=frame, x=x, y=y, z=self.altitude(item.z))
        params = _each(self.unplaced.get(item.command, UNKNOWN), item)
        frame, x, y, z = self.idle_frames.get(item.frame, item.frame), 0.0, 0.0, 0.0
        if self.keeps_idle:
            x, y, z = float(round(_set(item.x))), float(round(_set(item.y))), single(item.z)
        return replace(item, params=params, frame=frame, x=x, y=y, z=z)

    def is_known(self, command: int) -> bool:
        """Tell whether it is known what the autopilot keeps of `command`."""
        known = self.placed.get(command, self.unplaced.get(command, UNKNOWN))
        return known is not UNKNOWN


def _set(value: float) -> float:
    """Return `value`, 0 for what is not set."""
    return 0.0 if math.isnan(value) else value


def _each(codecs: Codecs, item: MissionItem) -> tuple[float, float, float, float]:
    """Return what `codecs` leave of the parameters of `item`."""
    one, two, three, four = (f(value) for f, value in zip(codecs, item.params, strict=True))
    return one, two, three, four


def degrees(value: float) -> float:
    """Return latitude or longitude as MISSION_ITEM_INT carries it, in steps of 1e-7 degrees."""
    return value if math.isnan(value) else round(value * 1e7) / 1e7


def name_of(command: int) -> str:
    """Return the command's MAVLink name, its number if there is none here."""
    try:
        return Command(command).name
    except ValueError:
        return f"command {command}"
