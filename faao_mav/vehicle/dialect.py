"""What is to be known of an autopilot to give it items."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.mission.command import Command
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

    `home_row`: item 0 on the wire is home, which the vehicle replaces by its own. `items` counts
    what is sent, `jumps` the DO_JUMPs among it. `atomic`: a refused upload leaves the old mission
    as it was. `splines`: NAV_SPLINE_WAYPOINT is flown. `refusal(item)` says why an item is refused
    on upload, `stored(item)` what reading back an accepted one gives, `speed_change(item)` what a
    DO_CHANGE_SPEED does. `known` are the commands of which it is known what is stored, None: all.
    """

    name: str
    home_row: bool
    items: Limit
    jumps: Limit | None
    atomic: bool
    splines: bool
    refusal: Callable[[MissionItem], str | None]
    stored: Callable[[MissionItem], MissionItem]
    speed_change: Callable[[MissionItem], SpeedChange | None]
    known: frozenset[int] | None = None


def dropped(_: float) -> float:
    """Not stored: reads back as 0."""
    return 0.0


def single(value: float) -> float:
    """Stored as it came over the wire, in single precision."""
    return float(np.float32(value))


def whole(least: int, most: int) -> Codec:
    """Stored as a whole number: fractions are cut off, what is out of range ends at its limit."""

    def codec(value: float) -> float:
        return 0.0 if math.isnan(value) else float(min(max(math.trunc(value), least), most))

    return codec


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
