"""What was sent against what was read back."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from faao_mav.autopilot import VehicleType
from faao_mav.mission.item import MissionItem
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import coordinate_scale, home_items, mission_item

DifferenceKind: TypeAlias = Literal["dropped", "wrong"]

_CENTIMETRE = 0.0101
"""Altitudes that differ by less are equal, m: ArduPilot stores whole centimetres."""

_FLOAT32 = 2e-7
"""Relative difference of two numbers that single precision does not tell apart."""

_SAME_FRAMES = {5: 0, 6: 3, 11: 10}
"""Frames with the same meaning: those ending in _INT, and what they are called without."""


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
    item is the vehicle's own: told as dropped where it differs by
    more than a metre or so.
    """
    differences = []
    home = home_items(vehicle, part)
    if home and sent and found:
        differences += _compare_home(mission_item(sent[0]), mission_item(found[0]))
    if len(sent) != len(found):
        was, is_ = (max(len(items) - home, 0) for items in (sent, found))
        differences.append(Difference(part, None, "count", was, is_, "wrong"))
    for index, (one, other) in enumerate(zip(sent[home:], found[home:], strict=False)):
        pair = mission_item(one), mission_item(other)
        differences += _compare_items(*pair, index, part, vehicle)
    return tuple(differences)


def _compare_home(sent: MissionItem, found: MissionItem) -> list[Difference]:
    places = ((sent.x, sent.y, sent.z), (found.x, found.y, found.z))
    (x, y, z), (x_found, y_found, z_found) = places
    if not (x or y or z) or (
        abs(x - x_found) < 1e-5 and abs(y - y_found) < 1e-5 and abs(z - z_found) < 1
    ):
        return []
    return [Difference(MissionType.MISSION, None, "home", *places, "dropped")]


def _compare_items(
    sent: MissionItem,
    found: MissionItem,
    index: int,
    part: MissionType,
    vehicle: VehicleType | None,
) -> list[Difference]:
    stored, unknown = sent, False
    if vehicle is not None:
        stored = vehicle.dialect.stored(sent)
        unknown = part is MissionType.MISSION and not vehicle.dialect.is_known(sent.command)
    differences = []
    values = zip(
        _fields(sent).items(), _fields(found).values(), _fields(stored).values(), strict=True
    )
    for (field, was), is_, kept in values:
        if field == "autocontinue" and part is not MissionType.MISSION:
            continue
        if field == "frame" and not _same_frame(sent, int(is_), stored):
            differences.append(Difference(part, index, field, was, is_, "wrong"))
        if field == "frame" or _same(field, was, is_, sent.frame):
            continue
        if math.isnan(was) and is_ == 0:
            continue
        # What is not known to be kept may be lost, but not replaced.
        lost = _same(field, kept, is_, found.frame) or (
            unknown and field not in ("x", "y", "command") and is_ == 0
        )
        differences.append(Difference(part, index, field, was, is_, "dropped" if lost else "wrong"))
    return differences


def _fields(item: MissionItem) -> dict[str, float]:
    params = {f"param{number}": value for number, value in enumerate(item.params, start=1)}
    rest = {"x": item.x, "y": item.y, "z": item.z, "autocontinue": float(item.autocontinue)}
    return {"command": item.command, "frame": item.frame, **params, **rest}


def _same(field: str, one: float, other: float, frame: int) -> bool:
    if math.isnan(one) or math.isnan(other):
        return math.isnan(one) and math.isnan(other)
    if field in ("x", "y"):
        return abs(one - other) * coordinate_scale(frame) < 1.5
    tolerance = _FLOAT32 * abs(one)
    return abs(one - other) <= (tolerance + _CENTIMETRE if field == "z" else tolerance)


def _same_frame(sent: MissionItem, found: int, stored: MissionItem) -> bool:
    return _SAME_FRAMES.get(found, found) in (
        _SAME_FRAMES.get(sent.frame, sent.frame),
        _SAME_FRAMES.get(stored.frame, stored.frame),
    )
