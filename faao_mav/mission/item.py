"""A mission as data: items and their jumps, home, fence and rally points, and these as items."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from faao_mav.errors import InputError, counted
from faao_mav.mission.command import (
    CIRCLE,
    FENCE_RETURN_POINT,
    FLOWN_TO,
    POLYGON,
    RALLY_POINT,
    Command,
    Frame,
)
from faao_mav.mission.fence import Circle, Fence, LatLon, Point, Polygon, RallyPoint

Params: TypeAlias = tuple[float, float, float, float]
"""param1 to param4 of an item."""


MAX_ITEMS = 65_535
"""Items of a mission: MISSION_COUNT has 16 bits. PX4 keeps 65,534 on Linux and 2,000 elsewhere,
ArduPilot 15 bytes for each in at most 64 kB of its card (BRD_SD_MISSION)."""

_MAX_RALLY = 255  # Rally points of a mission: ArduPilot counts them in 8 bits; PX4 keeps 8.


@dataclass(frozen=True, slots=True)
class Home(Point):
    """Where relative altitudes count from: its own counts from mean sea level."""

    called = "home"


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
            raise InputError(f"mission item: {counted(len(self.params), 'parameter')}; expected 4")
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
    <Mission: 1 item, 0 zones, 0 rally points>
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
        many = (self.items, "item"), (self.fence.areas, "zone"), (self.rally, "rally point")
        return f"<Mission: {', '.join(counted(len(each), noun) for each, noun in many)}>"

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
    place = (0.0, 0.0, 0.0) if home is None else home.on_ground
    return _placed(Command.NAV_WAYPOINT, 0.0, *place)


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
    if not math.isfinite(number):
        return None
    if item.command == Command.DO_JUMP:
        return int(number) - 1 if 1 <= int(number) <= len(items) else None
    tags = (k for k, each in enumerate(items) if each.command == Command.JUMP_TAG)
    return next((k for k in tags if items[k].params[0] == number), None)


def fence_items(fence: Fence) -> tuple[MissionItem, ...]:
    """Return `fence` as items: return point, polygons vertex by vertex, circles."""
    items = []
    if fence.breach_return is not None:
        place, frame = fence.breach_return.on_ground, Frame.GLOBAL_RELATIVE_ALT
        items.append(_placed(FENCE_RETURN_POINT, 0.0, *place, frame=frame))
    for polygon in fence.polygons:
        command, count = POLYGON[polygon.inclusion], float(len(polygon.vertices))
        items += [_placed(command, count, *vertex) for vertex in polygon.vertices]
    for circle in fence.circles:
        items.append(_placed(CIRCLE[circle.inclusion], circle.radius, *circle.center))
    return tuple(items)


def rally_items(points: Sequence[RallyPoint]) -> tuple[MissionItem, ...]:
    """Return rally points as items; raise `InputError` for one whose altitude is not known."""
    for number, point in enumerate(points, start=1):
        if math.isnan(point.altitude):
            raise InputError(
                f"rally point {number}: its altitude is not set, and 0 m would be the ground; "
                "give metres above home"
            )
    frame = Frame.GLOBAL_RELATIVE_ALT
    return tuple(_placed(RALLY_POINT, 0.0, *point.on_ground, frame=frame) for point in points)


def fence_of(items: Sequence[MissionItem]) -> Fence:
    """Return the fence that `items` make: the reverse of `fence_items`.

    Raises `InputError` for other items, and for a polygon of fewer vertices than its items say.
    """
    polygons, circles, breach_return = [], [], None
    vertices: list[LatLon] = []
    for number, item in enumerate(items):
        if item.command in POLYGON.values():
            vertices.append((item.x, item.y))
            if len(vertices) == item.params[0]:
                polygons.append(Polygon(tuple(vertices), item.command == POLYGON[True]))
                vertices = []
            continue
        if vertices:
            break
        if item.command in CIRCLE.values():
            inclusion = item.command == CIRCLE[True]
            circles.append(Circle((item.x, item.y), item.params[0], inclusion))
        elif item.command == FENCE_RETURN_POINT:
            breach_return = RallyPoint(item.x, item.y, item.z)
        else:
            raise InputError(f"fence item {number}: command {item.command}; expected 5000 to 5004")
    if vertices:
        raise InputError(
            f"fence: a polygon stops after {len(vertices)} of its vertices; expected as many as "
            "its items say"
        )
    return Fence(tuple(polygons), tuple(circles), breach_return)


def _placed(
    command: int, param1: float, x: float, y: float, z: float = 0.0, frame: Frame = Frame.GLOBAL
) -> MissionItem:
    return MissionItem(command, frame, (param1, 0.0, 0.0, 0.0), x, y, z)
