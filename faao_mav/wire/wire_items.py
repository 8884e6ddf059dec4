"""Missions, fences and rally points as the items of the mission protocol, back, and compared.

A vehicle with a home item (ArduPilot) has its home as item 0, others (PX4) have none. Targets of
DO_JUMP count in a `Mission` as in mission files, where home is 0 and the first item 1: on PX4 they
are one less on the wire.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from faao_mav.autopilot import VehicleType
from faao_mav.errors import InputError
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, ABOVE_TERRAIN, FLOWN_TO, Command, Frame
from faao_mav.mission.fence import RallyPoint, check_place
from faao_mav.mission.item import (
    Home,
    Mission,
    MissionItem,
    fence_items,
    fence_of,
    home_item,
    rally_items,
)
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType

GLOBAL_FRAMES = ABOVE_SEA | ABOVE_HOME | ABOVE_TERRAIN
"""Frames whose coordinates are latitude and longitude."""

_INT32 = range(-(2**31), 2**31)
_FLOAT32 = 2.0**128 - 2.0**104  # The largest single-precision number.

_CENTIMETRE = 0.0101  # Altitudes that differ by less are equal, m: ArduPilot stores centimetres.
_SINGLE = 2e-7  # The relative difference that single precision does not tell.

_SAME_FRAMES = {5: 0, 6: 3, 11: 10}
"""Frames with the same meaning: those ending in _INT, and what they are called without."""

_FIELDS = ("command", "frame", "autocontinue", *(f"param{n}" for n in range(1, 5)), "x", "y", "z")


def coordinate_scale(frame: int) -> float:
    """Return what one degree, metre or unit of x and y is on the wire, in `frame`."""
    if frame in GLOBAL_FRAMES:
        return 1e7
    return 1.0 if frame == Frame.MISSION else 1e4


def home_items(vehicle: VehicleType | None, mission_type: MissionType) -> int:
    """Return how many items before the mission's own a list of `vehicle` has: its home, or none."""
    has_home = vehicle is not None and vehicle.dialect.home_row
    return int(has_home and mission_type is MissionType.MISSION)


def wire_items(
    mission: Mission, mission_type: MissionType, vehicle: VehicleType | None
) -> tuple[WireItem, ...]:
    """Return what `vehicle` is sent for one of the lists of `mission`.

    With a home row, row 0 is the home, zeros if there is none: the vehicle puts its own there.
    Parameters that are not set (NaN) are 0 for an autopilot that refuses NaN. Raises `InputError`
    for a place to fly to that is not set, for a rally point without an altitude, and for numbers
    that the wire does not carry.
    """
    if mission_type is MissionType.FENCE:
        items = fence_items(mission.fence)
    elif mission_type is MissionType.RALLY:
        items = rally_items(mission.rally)
    elif home_items(vehicle, mission_type):
        items = (home_item(mission.home), *mission.items)
    else:
        items = tuple(_jump_moved(item, -1) for item in mission.items)
    flown = mission_type is MissionType.MISSION
    first = flown - home_items(vehicle, mission_type)  # the row of a mission's file, in words
    who = "an autopilot unknown here" if vehicle is None else vehicle.family.name
    for index, item in enumerate(items, first):
        place = {"latitude": item.x, "longitude": item.y, "altitude": item.z}
        unset = " and ".join(name for name, value in place.items() if math.isnan(value))
        if unset and item.command in FLOWN_TO and item.frame in GLOBAL_FRAMES:
            told = f"item {index}: {unset} not set, which {who} would take for 0: give the place"
            raise InputError(told)
    rows = enumerate(items if vehicle is None else map(vehicle.dialect.sent, items), first)
    return tuple(wire_item(item, n, current=flown and n == first) for n, item in rows)


def mission_item(item: WireItem) -> MissionItem:
    """Return `item` in degrees, or in the units of its frame."""
    scale, numbers = coordinate_scale(item.frame), (*item.params, item.z)
    p1, p2, p3, p4, z = (value if math.isfinite(value) else math.nan for value in numbers)
    x, y, goes_on = item.x / scale, item.y / scale, bool(item.autocontinue)
    return MissionItem(item.command, item.frame, (p1, p2, p3, p4), x, y, z, goes_on)


def mission_of(
    lists: Mapping[MissionType, Sequence[WireItem]], vehicle: VehicleType | None
) -> Mission:
    """Return the mission that the `lists` downloaded from `vehicle` make; one may be missing.

    Raises `InputError` for items that are none: places off the Earth, infinities, half a polygon.
    """
    for mission_type, items in lists.items():
        first = (mission_type is MissionType.MISSION) - home_items(vehicle, mission_type)
        for number, item in enumerate(items, first):
            name = f"{mission_type.title} item {number}"
            if item.frame in GLOBAL_FRAMES:
                check_place((item.x / 1e7, item.y / 1e7), name)
            if any(map(math.isinf, (*item.params, item.z))):
                told = f"params {item.params}, z {item.z}"
                raise InputError(f"{name}: {told}; expected finite numbers")
    flown, fence, rally = ([*map(mission_item, lists.get(part, ()))] for part in MissionType)
    home = None
    if not home_items(vehicle, MissionType.MISSION):
        flown = [_jump_moved(item, 1) for item in flown]
    elif flown:
        row, *flown = flown
        home = Home(row.x, row.y, row.z) if row.x or row.y or row.z else None
    points = tuple(RallyPoint(item.x, item.y, item.z) for item in rally)
    return Mission(tuple(flown), home, fence_of(fence), points)


def _jump_moved(item: MissionItem, by: int) -> MissionItem:
    if item.command != Command.DO_JUMP:
        return item
    return replace(item, params=(item.params[0] + by, *item.params[1:]))


def wire_item(item: MissionItem, index: int, *, current: bool = False) -> WireItem:
    """Return `item`, number `index` of its list, as the wire carries it.

    Raises `InputError` for numbers that the wire does not carry.
    """
    scale = coordinate_scale(item.frame)
    x, y = (0 if math.isnan(value) else round(value * scale) for value in (item.x, item.y))
    if x not in _INT32 or y not in _INT32:
        expected = f"degrees within 180, or in frame {item.frame} what 32 bits hold"
        raise InputError(f"item {index}: x {item.x}, y {item.y}; expected {expected}")
    if any(abs(value) > _FLOAT32 for value in (*item.params, item.z)):
        told = f"params {item.params}, z {item.z}"
        raise InputError(f"item {index}: {told}; expected single-precision numbers")
    flags = int(current), int(item.autocontinue)
    return WireItem(item.command, item.frame, item.params, x, y, item.z, *flags)


@dataclass(frozen=True, slots=True)
class Difference:
    """One field that was not read back as it was sent.

    `item` is the row in a mission's file, or the index in another list, and None for the list as a
    whole or the home; `field` is a field of `MissionItem`, `param1` to `param4`, `count` or `home`.
    `kind` is "dropped" when this is what the autopilot's storage is known to lose, "wrong"
    otherwise.
    """

    part: MissionType
    item: int | None
    field: str
    sent: object
    found: object
    kind: Literal["dropped", "wrong"]

    def __str__(self) -> str:
        where = self.part.title if self.item is None else f"{self.part.title} item {self.item}"
        if self.kind == "dropped":
            return f"{where}: {self.field} {self.sent} is kept as {self.found}"
        return f"{where}: {self.field}: sent {self.sent}, found {self.found}"


def compare(
    sent: Sequence[WireItem],
    found: Sequence[WireItem],
    part: MissionType,
    vehicle: VehicleType | None,
) -> tuple[Difference, ...]:
    """Return how the items `found` on a vehicle differ from those `sent` to it.

    Not a difference: one step of the integer coordinates, single precision, a centimetre of
    altitude, frames that mean the same (3 and 6), the frame of a command without a place, "not
    set" read back as 0, autocontinue of a fence or rally point, which nothing comes after. A home
    item is the vehicle's own: told as dropped where it differs by more than a metre or so.
    """
    differences: list[Difference] = []
    home = home_items(vehicle, part)
    if home and sent and found:
        own, its = ((item.x, item.y, item.z) for item in map(mission_item, (sent[0], found[0])))
        away = [abs(one - other) for one, other in zip(own, its, strict=True)]
        if any(own) and not (max(away[:2]) < 1e-5 and away[2] < 1):
            differences.append(Difference(part, None, "home", own, its, "dropped"))
    if len(sent) != len(found):
        given, there = (len(items[home:]) for items in (sent, found))
        differences.append(Difference(part, None, "count", given, there, "wrong"))
    flown = part is MissionType.MISSION
    for row, pair in enumerate(zip(sent[home:], found[home:], strict=False), int(flown)):
        item, read = map(mission_item, pair)
        known = not flown or vehicle is None or vehicle.dialect.is_known(item.command)
        stored = item if vehicle is None else vehicle.dialect.stored(item)
        values = [(x.command, x.frame, x.autocontinue, *x.numbers) for x in (item, read, stored)]
        for field, was, is_, kept in zip(_FIELDS, *values, strict=True):
            unset = math.isnan(was) and is_ == 0
            idle = field == "autocontinue" and not flown
            lost = _same(field, kept, is_, read.frame)
            if unset or idle or _same(field, was, is_, item.frame) or (lost and field == "frame"):
                continue
            # What is not known to be kept may be lost, but not replaced.
            lost = lost or (not known and field not in ("frame", "x", "y", "command") and is_ == 0)
            told = Difference(part, row, field, was, is_, "dropped" if lost else "wrong")
            differences.append(told)
    return tuple(differences)


def _same(field: str, one: float, other: float, frame: int) -> bool:
    if math.isnan(one) or math.isnan(other):
        return math.isnan(one) and math.isnan(other)
    if field == "frame":
        return _SAME_FRAMES.get(int(one), one) == _SAME_FRAMES.get(int(other), other)
    if field in ("x", "y"):
        return abs(one - other) * coordinate_scale(frame) < 1.5
    return abs(one - other) <= _SINGLE * abs(one) + (_CENTIMETRE if field == "z" else 0.0)
