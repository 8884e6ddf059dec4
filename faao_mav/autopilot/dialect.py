"""What an autopilot does with the items that it is given.

Read in the autopilots' sources and measured on ArduCopter 4.7 and PX4 1.16 in simulation.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.autopilot.parameter import ParameterValues
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
"""What is read back for a parameter that was sent."""

Codecs: TypeAlias = tuple[Codec, Codec, Codec, Codec]
"""Those of param1 to param4."""

SpeedAxis: TypeAlias = Literal["horizontal", "climb", "descent", "airspeed", "least ground speed"]


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


@dataclass(frozen=True, slots=True)
class Dialect:
    """How one autopilot takes missions.

    Attributes:
        home_row: item 0 on the wire is home, which the vehicle replaces by its own.
        items: how many items fit, the home row included.
        jumps: how many DO_JUMPs keep count of their repeats; None: all.
        fence_rows, rally_rows: how many vertices and circles, and how many rally points, fit on
            the smallest boards in common use.
        atomic: a refused upload leaves the old mission as it was.
        unset_is_zero: it refuses most parameters that are not set (NaN), and is sent 0 instead.
        zero_means_here: latitude and longitude 0, 0 stand for the place where the vehicle is.
        placed_in_mission_frame: items in frame 2 (MISSION) have a place too, above sea level.
        refusal: why an item is refused on upload, None if it is taken.
        stored: what reading back an accepted row gives, of the mission, the fence or the rally
            points. Numbers went over the wire: parameters and altitude are of single precision,
            degrees multiples of 1e-7. What the autopilot has no room for is gone.
        speed_change: what a DO_CHANGE_SPEED changes, None for one that changes nothing.
        unlimited: whether the vehicle's parameters make room for any number of items, and
            `make_room` how to set them so.
        endings: the commands behind which nothing is flown.
        flies_on: whether, by the vehicle's parameters, a take-off behind a landing is flown.
        known: the commands of which it is known what is stored, None: all. Of the others `stored`
            takes everything to be kept.
    """

    home_row: bool
    items: Limit
    jumps: Limit | None
    fence_rows: int
    rally_rows: int
    atomic: bool
    unset_is_zero: bool
    zero_means_here: bool
    placed_in_mission_frame: bool
    refusal: Callable[[MissionItem], str | None]
    stored: Callable[[MissionItem], MissionItem]
    speed_change: Callable[[MissionItem], SpeedChange | None]
    unlimited: Callable[[ParameterValues], bool] = lambda _: False
    make_room: str = ""
    endings: frozenset[int] = frozenset({Command.NAV_LOITER_UNLIM, Command.NAV_RETURN_TO_LAUNCH})
    flies_on: Callable[[ParameterValues], bool] = lambda _: False
    known: frozenset[int] | None = None

    def sent(self, item: MissionItem) -> MissionItem:
        """Return `item` as it is sent: what is not set as 0 where NaN is refused.

        The altitude of a place to fly to stays: 0 m would be another place.
        """
        if not self.unset_is_zero:
            return item
        one, two, three, four, up = (
            0.0 if math.isnan(value) else value for value in (*item.params, item.z)
        )
        up = item.z if item.command in FLOWN_TO else up
        return replace(item, params=(one, two, three, four), z=up)

    def is_known(self, command: int) -> bool:
        """Tell whether it is known what the autopilot keeps of `command`."""
        return self.known is None or command in self.known


def dropped(_: float) -> float:
    """Not stored: reads back as 0."""
    return 0.0


NOTHING: Codecs = (dropped, dropped, dropped, dropped)
"""None of the four parameters is stored."""


def first(codec: Codec) -> Codecs:
    """Return how param1 alone is stored."""
    return (codec, dropped, dropped, dropped)


def through(codecs: Codecs, item: MissionItem) -> MissionItem:
    """Return `item` with what `codecs` leave of its parameters."""
    param1, param2, param3, param4 = (
        codec(value) for codec, value in zip(codecs, item.params, strict=True)
    )
    return replace(item, params=(param1, param2, param3, param4))


def misplaced(item: MissionItem) -> tuple[str, float, int] | None:
    """Return name, value and limit of the coordinate of `item` that is not on Earth, if any."""
    for name, value, limit in (("latitude", item.x, 90), ("longitude", item.y, 180)):
        if not abs(value) <= limit:
            return name, value, limit
    return None


def single(value: float) -> float:
    """Stored as it came over the wire, in single precision."""
    return float(np.float32(value))


def whole(least: int, most: int) -> Codec:
    """Stored as a whole number: fractions are cut off, what is out of range ends at its limit."""

    def codec(value: float) -> float:
        return 0.0 if math.isnan(value) else float(math.trunc(min(max(value, least), most)))

    return codec


BESIDE: dict[int, Codecs] = (
    dict.fromkeys(POLYGON.values(), first(whole(0, 65_535)))
    | dict.fromkeys(CIRCLE.values(), first(single))
    | dict.fromkeys((FENCE_RETURN_POINT, RALLY_POINT), NOTHING)
)
"""What every autopilot measured keeps of the parameters of fence and rally rows: how many vertices
a polygon has, and the radius of a circle."""


def flag(value: float) -> float:
    """Stored as a bit: 1 above 0."""
    return 1.0 if value > 0 else 0.0


def degrees(value: float) -> float:
    """Return latitude or longitude as MISSION_ITEM_INT carries it, in steps of 1e-7 degrees."""
    return value if math.isnan(value) else round(value * 1e7) / 1e7


def name_of(command: int) -> str:
    """Return the command's MAVLink name, its number if there is none here."""
    try:
        return Command(command).name
    except ValueError:
        return f"command {command}"
