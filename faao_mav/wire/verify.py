"""What was sent against what was read back."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from faao_mav.autopilot import VehicleType
from faao_mav.mission.item import MissionItem
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import coordinate_scale, home_items, mission_item

DifferenceKind: TypeAlias = Literal["dropped", "wrong"]

_CENTIMETRE = 0.0101  # Altitudes that differ by less are equal, m: ArduPilot stores centimetres.
_FLOAT32 = 2e-7  # The relative difference that single precision does not tell.

_SAME_FRAMES = {5: 0, 6: 3, 11: 10}
"""Frames with the same meaning: those ending in _INT, and what they are called without."""

_FIELDS = (
    *("command", "frame", "autocontinue"),
    *("param1", "param2", "param3", "param4", "x", "y", "z"),
)


@dataclass(frozen=True, slots=True)
class Difference:
    """One field that was not read back as it was sent.

    `item` is the index in the list of items, home not counted, and None for the list as a whole
    or the home; `field` is a field of `MissionItem`, `param1` to `param4`, `count` or `home`.
    `kind` is "dropped" when this is what the autopilot's storage is known to lose, "wrong"
    otherwise.
    """

    part: MissionType
    item: int | None
    field: str
    sent: object
    found: object
    kind: DifferenceKind

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
    for index, (one, other) in enumerate(zip(sent[home:], found[home:], strict=False)):
        differences += _compare(mission_item(one), mission_item(other), index, part, vehicle)
    return tuple(differences)


def _compare(
    sent: MissionItem,
    found: MissionItem,
    index: int,
    part: MissionType,
    vehicle: VehicleType | None,
) -> Iterator[Difference]:
    stored, unknown = sent, False
    if vehicle is not None:
        stored = vehicle.dialect.stored(sent)
        unknown = part is MissionType.MISSION and not vehicle.dialect.is_known(sent.command)
    of_sent, of_found, of_stored = map(_values, (sent, found, stored))
    for field, was in of_sent.items():
        is_, kept = of_found[field], of_stored[field]
        unset = math.isnan(was) and is_ == 0
        idle = field == "autocontinue" and part is not MissionType.MISSION
        lost = _same(field, kept, is_, found.frame)
        if unset or idle or _same(field, was, is_, sent.frame) or (lost and field == "frame"):
            continue
        # What is not known to be kept may be lost, but not replaced.
        lost = lost or (unknown and field not in ("frame", "x", "y", "command") and is_ == 0)
        yield Difference(part, index, field, was, is_, "dropped" if lost else "wrong")


def _values(item: MissionItem) -> dict[str, float]:
    """Return the numbers of an item by name."""
    values = (item.command, item.frame, item.autocontinue, *item.numbers)
    return dict(zip(_FIELDS, values, strict=True))


def _same(field: str, one: float, other: float, frame: int) -> bool:
    if math.isnan(one) or math.isnan(other):
        return math.isnan(one) and math.isnan(other)
    if field == "frame":
        return _SAME_FRAMES.get(int(one), one) == _SAME_FRAMES.get(int(other), other)
    if field in ("x", "y"):
        return abs(one - other) * coordinate_scale(frame) < 1.5
    return abs(one - other) <= _FLOAT32 * abs(one) + (_CENTIMETRE if field == "z" else 0.0)
