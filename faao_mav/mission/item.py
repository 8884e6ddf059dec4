"""A mission as data: items and their jumps, home, fence, rally points; as rows for the wire."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from faao_mav.errors import InputError
from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.mission.fence import Fence, LatLon, RallyPoint, check_place

Params: TypeAlias = tuple[float, float, float, float]
"""param1 to param4 of an item."""


MAX_ITEMS = 65_535
"""Items of a mission: MISSION_COUNT has 16 bits. PX4 keeps 65,534 on Linux and 2,000 elsewhere,
ArduPilot 15 bytes for each in at most 64 kB of its card (BRD_SD_MISSION)."""

_MAX_RALLY = 255
"""Rally points of a mission: ArduPilot counts them in 8 bits; PX4 keeps 8."""


@dataclass(frozen=True, slots=True)
class Home:
    """Where relative altitudes count from: WGS84 degrees, metres above mean sea level.

    The altitude is NaN where it is not known. Raises `InputError` for coordinates that are no place
    on Earth.
    """

    latitude: float
    longitude: float
    altitude: float

    def __post_init__(self) -> None:
        check_place((self.latitude, self.longitude), "home", self.altitude)


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One MAVLink mission item.

    `command` is a MAV_CMD (0 to 65535), `frame` a MAV_FRAME (0 to 255), `params` are param1 to
    param4. `x` and `y` are latitude and longitude in degrees and `z` metres, except in
    `Frame.MISSION`, where they are param5 to param7. NaN means "not set": files of ground stations
    have it in any place, and what an autopilot makes of it depends on the place.

    Raises `InputError` for integers out of range, other than four parameters, infinities.

    >>> MissionItem(command=16, frame=3, x=-35.3633, y=149.1652, z=30.0).params
    (0.0, 0.0, 0.0, 0.0)
    """

    command: int
    frame: int
    params: Params = (0.0, 0.0, 0.0, 0.0)
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    autocontinue: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.command <= 65_535:
            raise InputError(f"mission item: command {self.command}; expected 0 to 65535")
        if not 0 <= self.frame <= 255:
            raise InputError(f"mission item: frame {self.frame}; expected 0 to 255")
        if len(self.params) != 4:
            raise InputError(f"mission item: {len(self.params)} parameters; expected 4")
        if any(map(math.isinf, self.numbers)):
            raise InputError(
                f"mission item: params {self.params}, x {self.x}, y {self.y}, z {self.z}; "
                "expected finite numbers, or NaN for what is not set"
            )

    @property
    def numbers(self) -> tuple[float, ...]:
        """All seven numbers: `params`, `x`, `y` and `z`."""
        return (*self.params, self.x, self.y, self.z)


BESIDE = ("fence", "rally points")
"""What a vehicle may hold beside its mission."""


@dataclass(frozen=True, slots=True)
class Mission:
    """What an autopilot is given: the items in order, without the home row, and the home.

    The target of a DO_JUMP (param1) counts the items from 1, as every file format does: home is 0.
    A fence and rally points travel beside it: only some formats hold them. `unread` has those of
    `BESIDE` that a vehicle may hold, but that could not be read from it. Raises `InputError` for
    more items or rally points than any autopilot keeps.

    >>> from faao_mav.mission.command import Command, Frame
    >>> there = MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT, x=47.4, y=8.5, z=50.0)
    >>> Mission((there,), Home(47.39, 8.5, 440.0))
    <Mission: 1 items, 0 zones, 0 rally points>
    """

    items: tuple[MissionItem, ...]
    home: Home | None = None
    fence: Fence = field(default_factory=Fence)
    rally: tuple[RallyPoint, ...] = ()
    unread: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_count(len(self.items), "items", MAX_ITEMS)
        check_count(len(self.rally), "rally points", _MAX_RALLY)

    def __repr__(self) -> str:
        """Say how large it is, in a line."""
        zones = len(self.fence.polygons) + len(self.fence.circles)
        return f"<Mission: {len(self.items)} items, {zones} zones, {len(self.rally)} rally points>"

    @property
    def first_place(self) -> LatLon | None:
        """The first place on Earth that an item flies to, degrees; 0, 0 stands for none."""
        for item in self.items:
            on_earth = abs(item.x) <= 90 and abs(item.y) <= 180
            if item.command in FLOWN_TO and on_earth and (item.x or item.y):
                return item.x, item.y
        return None


def check_count(count: int, what: str, most: int) -> None:
    """Raise `InputError` where a `count` of `what` is above the `most` that is accepted."""
    if count > most:
        raise InputError(
            f"{count:,} {what}; at most {most:,} are accepted, as many as an autopilot keeps"
        )


def home_item(home: Home | None) -> MissionItem:
    """Return the row 0 that stands for `home`: zeros for none, and for an unknown altitude."""
    known = home or Home(0.0, 0.0, 0.0)
    altitude = 0.0 if math.isnan(known.altitude) else known.altitude
    return MissionItem(
        Command.NAV_WAYPOINT, Frame.GLOBAL, x=known.latitude, y=known.longitude, z=altitude
    )


def as_sent(mission: Mission, *, home_row: bool) -> tuple[MissionItem, ...]:
    """Return the items to send, the first as number 0.

    With a home row (ArduPilot) row 0 is the home, zeros if there is none: the vehicle puts its
    own there. Without one (PX4) the targets of DO_JUMP, which count items from 1, count from 0.

    >>> takeoff = MissionItem(Command.NAV_TAKEOFF, Frame.GLOBAL_RELATIVE_ALT, z=30.0)
    >>> again = MissionItem(Command.DO_JUMP, Frame.MISSION, (1.0, 2.0, 0.0, 0.0))
    >>> [row.command.name for row in as_sent(Mission((takeoff, again)), home_row=True)]
    ['NAV_WAYPOINT', 'NAV_TAKEOFF', 'DO_JUMP']
    >>> as_sent(Mission((takeoff, again)), home_row=False)[1].params[0]
    0.0
    """
    if not home_row:
        return tuple(jump_moved(item, -1) for item in mission.items)
    return (home_item(mission.home), *mission.items)


def as_received(rows: Sequence[MissionItem], *, home_row: bool) -> Mission:
    """Return the mission that was read back as `rows`: the reverse of `as_sent`."""
    if not home_row:
        return Mission(tuple(jump_moved(item, 1) for item in rows))
    if not rows:
        return Mission(())
    first = rows[0]
    home = None if first.x == first.y == first.z == 0 else Home(first.x, first.y, first.z)
    return Mission(tuple(rows[1:]), home)


def jump_moved(item: MissionItem, by: int) -> MissionItem:
    """Return `item` with the target of a DO_JUMP moved by so many rows; any other as it is."""
    if item.command != Command.DO_JUMP:
        return item
    return replace(item, params=(item.params[0] + by, *item.params[1:]))


JUMPS = (Command.DO_JUMP, Command.DO_JUMP_TAG)
"""The commands that repeat what stands between their target and them, param2 times."""


def jump_target(items: Sequence[MissionItem], index: int) -> int | None:
    """Return the index that the jump at `index` goes to, None if there is no such item.

    The target of a DO_JUMP counts items from 1; that of a DO_JUMP_TAG is the first JUMP_TAG with
    its number.

    >>> tag, jump = MissionItem(600, 2, (7.0, 0, 0, 0)), MissionItem(601, 2, (7.0, 2.0, 0, 0))
    >>> jump_target([tag, jump], 1), jump_target([jump], 0)
    (0, None)
    """
    item = items[index]
    number = item.params[0]
    if math.isnan(number):
        return None
    if item.command == Command.DO_JUMP:
        return int(number) - 1 if 1 <= int(number) <= len(items) else None
    tags = (k for k, each in enumerate(items) if each.command == Command.JUMP_TAG)
    return next((k for k in tags if items[k].params[0] == number), None)
