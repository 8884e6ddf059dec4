"""QGroundControl's `.plan` files, read.

JSON with a mission, a geofence and rally points. Sources: QGroundControl's developer guide, "Plan
File Format", and what QGroundControl and MAVSDK accept. Importing this brings pydantic along.
"""

import math
from collections.abc import Callable, Iterable
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    FailFast,
    Field,
    ValidationError,
)

from faao_mav.errors import InputError, MissionFileError, place_of, quote
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.fence import MAX_CORNERS, Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.formats.losses import unread_losses
from faao_mav.mission.formats.mission_file import MissionFile
from faao_mav.mission.formats.strict_json import parse_json
from faao_mav.mission.item import BESIDE, MAX_ITEMS, Home, Mission, MissionItem

_AGAIN = "open the file in a current QGroundControl and save it again"
_HINTS = {
    "version": f": {_AGAIN}",
    "params": " or null (not set)",
    "complexItemType": ", or simple items: replace the pattern by waypoints, or upload the plan "
    "from QGroundControl, read it back from the vehicle and save it",
    "Items": f": the pattern was saved without its waypoints; {_AGAIN}",
}
"""What a message says besides, by the last key of its place."""

_ITEM_TYPES = ("SimpleItem", "ComplexItem")
Made = TypeVar("Made")


def _whole(value: object) -> object:
    """Return 3 for 3.0, which some writers have for whole numbers, and a word for true."""
    if isinstance(value, bool):  # which equals 1
        return quote(value)
    return int(value) if isinstance(value, float) and value.is_integer() else value


Version1: TypeAlias = Annotated[Literal[1], BeforeValidator(_whole)]
Version2: TypeAlias = Annotated[Literal[2], BeforeValidator(_whole)]
Whole: TypeAlias = Annotated[int, BeforeValidator(_whole), Field(ge=0, le=2**31 - 1)]
Byte: TypeAlias = Annotated[int, BeforeValidator(_whole), Field(ge=0, le=255)]
Command16: TypeAlias = Annotated[int, BeforeValidator(_whole), Field(ge=0, le=65_535)]
Pair: TypeAlias = Annotated[list[float], Field(min_length=2, max_length=2)]
Triple: TypeAlias = Annotated[list[float | None], Field(min_length=3, max_length=3)]
"""Latitude, longitude, and an altitude that may be null, not known."""


class _Object(BaseModel):
    """An object of the file; keys that are not known are passed over."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _SimpleItem(_Object):
    type: Literal["SimpleItem"]
    command: Command16
    frame: Byte
    params: Annotated[list[float | None], FailFast(), Field(min_length=7, max_length=7)]
    autoContinue: bool
    doJumpId: Whole | None = None


class _Transects(_Object):
    Items: Annotated[list[_SimpleItem], FailFast(), Field(max_length=MAX_ITEMS)]


class _ComplexItem(_Object):
    """A pattern of the kinds whose simple items are in the file."""

    type: Literal["ComplexItem"]
    complexItemType: Literal["survey", "CorridorScan"]
    TransectStyleComplexItem: _Transects


_Item: TypeAlias = Annotated[_SimpleItem | _ComplexItem, Discriminator("type")]


class _Mission(_Object):
    version: Version2
    firmwareType: Byte | None = None
    vehicleType: Byte | None = None
    plannedHomePosition: Triple | None = None
    items: Annotated[list[_Item], FailFast(), Field(max_length=MAX_ITEMS)]


class _Disc(_Object):
    center: Pair
    radius: float


class _Circle(_Object):
    version: Version1
    circle: _Disc
    inclusion: bool


class _Polygon(_Object):
    version: Version1
    polygon: Annotated[list[Pair], FailFast(), Field(max_length=MAX_CORNERS)]
    inclusion: bool


class _Fence(_Object):
    version: Version2
    polygons: Annotated[list[_Polygon], FailFast(), Field(max_length=MAX_CORNERS)]
    circles: Annotated[list[_Circle], FailFast(), Field(max_length=MAX_CORNERS)]
    breachReturn: Triple | None = None


class _Rally(_Object):
    version: Version2
    points: Annotated[list[Triple], FailFast(), Field(max_length=MAX_CORNERS)]


def _or_none(part: object) -> object:
    """Return None for a part of version 1 with nothing in it, as older files have it."""
    if not isinstance(part, dict) or any(v for k, v in part.items() if k != "version"):
        return part
    return None if part.get("version") == 1 else part


class _File(_Object):
    fileType: Literal["Plan"]
    version: Version1
    mission: _Mission
    geoFence: Annotated[_Fence | None, BeforeValidator(_or_none)] = None
    rallyPoints: Annotated[_Rally | None, BeforeValidator(_or_none)] = None
    unread: object = None


def read_qgc_plan(text: str, source: str) -> MissionFile:
    """Return what `text`, the content of a `.plan` file, describes.

    A null parameter is NaN, not set; a null altitude of home or of a rally point is one that is not
    known. Surveys and corridor scans become the simple items that the file holds for them; the
    targets of DO_JUMP, written as a `doJumpId`, become the place of that item in the mission,
    counted from 1. A planned home of zeros, and none, mean no home; a plan without a `geoFence` or
    `rallyPoints` has none. Keys that are not known are passed over. `source` is the file's name,
    for messages. Raises `MissionFileError` for anything else; it names key, value and what is
    expected.
    """
    try:
        file = _File.model_validate(parse_json(text))
        read = _mission(file)
    except ValidationError as error:
        raise MissionFileError(f"{source}: {_describe(error)}") from None
    except InputError as error:
        raise MissionFileError(f"{source}: {error}") from None
    warnings = tuple(f"{source}: {line}" for line in unread_losses(read))
    return MissionFile(read, file.mission.firmwareType, file.mission.vehicleType, warnings)


def _describe(error: ValidationError) -> str:
    """Return the first finding: its place, the value there and what is expected."""
    detail = error.errors(include_url=False)[0]
    steps = [step for step in detail["loc"] if step not in _ITEM_TYPES]
    where = place_of(steps)
    last = next((step for step in reversed(steps) if isinstance(step, str)), "")
    hint = _HINTS.get(last, "")
    kind, told = detail["type"], detail.get("ctx", {})
    if kind == "missing":
        return f"{where}: is missing{hint}"
    if kind == "union_tag_not_found":
        return f"{where}.type: is missing"
    if kind == "union_tag_invalid":
        return f"{where}.type: {quote(told['tag'])}; expected {told['expected_tags']}"
    if kind in ("too_short", "too_long"):
        length = int(told.get("min_length", told.get("max_length", 0)))
        if length >= MAX_CORNERS:
            return f"{where}: more than {length:,} values, and no autopilot keeps so many"
        return f"{where}: {quote(detail['input'])}; expected an array of {length} values"
    words = (
        "an object" if kind.startswith("model_") else detail["msg"].removeprefix("Input should be ")
    )
    return f"{where}: {quote(detail['input'])}; expected {words}{hint}".removeprefix(": ")


def _mission(file: _File) -> Mission:
    home, fence, rally = file.mission.plannedHomePosition, file.geoFence, file.rallyPoints
    return Mission(
        _items(file.mission),
        _made("mission.plannedHomePosition", Home, home) if home and any(home) else None,
        _fence(fence) if fence else Fence(),
        _each("rallyPoints.points", RallyPoint, rally.points if rally else []),
        tuple(part for part in BESIDE if isinstance(file.unread, list) and part in file.unread),
    )


def _fence(fence: _Fence) -> Fence:
    polygons = [[tuple(map(tuple, part.polygon)), part.inclusion] for part in fence.polygons]
    circles = [[tuple(c.circle.center), c.circle.radius, c.inclusion] for c in fence.circles]
    back = fence.breachReturn
    return Fence(
        _each("geoFence.polygons", Polygon, polygons),
        _each("geoFence.circles", Circle, circles),
        _made("geoFence.breachReturn", RallyPoint, back) if back else None,
    )


def _each(place: str, make: Callable[..., Made], parts: Iterable[list[Any]]) -> tuple[Made, ...]:
    return tuple(_made(f"{place}[{k}]", make, part) for k, part in enumerate(parts))


def _made(place: str, make: Callable[..., Made], part: Iterable[Any]) -> Made:
    """Return `make(*part)`, null as NaN, with its `InputError` as a complaint about this place."""
    try:
        return make(*(math.nan if value is None else value for value in part))
    except InputError as error:
        raise MissionFileError(f"{place}: {error}") from None


def _items(mission: _Mission) -> tuple[MissionItem, ...]:
    """Return the items, those of patterns in their place; a DO_JUMP's target is counted from 1."""
    parts: list[tuple[str, _SimpleItem]] = []
    for k, item in enumerate(mission.items):
        place = f"mission.items[{k}]"
        if isinstance(item, _SimpleItem):
            parts.append((place, item))
        else:
            inner = enumerate(item.TransectStyleComplexItem.Items)
            parts += [(f"{place}.TransectStyleComplexItem.Items[{j}]", part) for j, part in inner]
    targets: dict[float | None, int] = {}
    for number, (_, part) in enumerate(parts, start=1):
        if part.doJumpId is not None:
            targets.setdefault(part.doJumpId, number)
    return tuple(_item(place, part, targets) for place, part in parts)


def _item(place: str, part: _SimpleItem, targets: dict[float | None, int]) -> MissionItem:
    values = [math.nan if value is None else value for value in part.params]
    if part.frame != Frame.MISSION:
        # In the mission frame the three coordinates are plain parameters.
        for index, limit in ((4, 90), (5, 180)):
            if abs(values[index]) > limit:
                raise MissionFileError(
                    f"{place}.params[{index}]: {part.params[index]:.10g}; expected null or "
                    f"degrees from {-limit} to {limit}"
                )
    if part.command == Command.DO_JUMP:
        if part.params[0] not in targets:
            raise MissionFileError(
                f"{place}.params[0]: {values[0]:g}; expected the doJumpId of an item of the mission"
            )
        values[0] = targets[part.params[0]]
    param1, param2, param3, param4, x, y, z = map(float, values)
    params = (param1, param2, param3, param4)
    return MissionItem(part.command, part.frame, params, x, y, z, part.autoContinue)
