"""What the firmwares of mock autopilots have in common: what they store, what they refuse."""

import struct
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from faao_mav.autopilot import AutopilotFamily, VehicleType
from faao_mav.autopilot.dialect import BESIDE
from faao_mav.mission.command import Frame
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.wire.messages import CommandLong, Envelope, Message, Statustext, WireItem
from faao_mav.wire.protocol import MavResult, MissionType
from faao_mav.wire.wire_items import home_items, mission_item, wire_item

COUNT = -1
"""In `Behaviour.refusals`: instead of an item, the announcement of the list."""

_FIELDS = range(MavResult.INVALID_PARAM1, MavResult.INVALID_PARAM7 + 1)
"""What is wrong if param1 to param4, x, y or z is."""


class StoredLists:
    """What is stored: items as the vehicle gives them back."""

    def __init__(self, vehicle: VehicleType, home: Home) -> None:
        self.vehicle, self.home = vehicle, home
        self._items: dict[MissionType, list[WireItem]] = {part: [] for part in MissionType}

    def items(self, part: MissionType) -> tuple[WireItem, ...]:
        """Return what a download gives."""
        return tuple(self._items[part])

    def put(self, part: MissionType, seq: int, item: WireItem) -> None:
        """Store `item` in place of the one at `seq`, or behind the last one."""
        self._items[part][seq : seq + 1] = [self.kept(part, seq, item)]

    def kept(self, part: MissionType, seq: int, item: WireItem) -> WireItem:
        """Return what becomes of `item`; a home item is the vehicle's own, whatever is sent."""
        if seq < home_items(self.vehicle, part):
            return self._home_item()
        stored = self.vehicle.dialect.stored(mission_item(item))
        return wire_item(stored, seq, current=seq == 0 and not self.vehicle.dialect.home_row)

    def replace(self, part: MissionType, items: Iterable[WireItem]) -> None:
        """Store all of `items`, which are as `kept` gives them, in place of the list."""
        self._items[part] = list(items)

    def truncate(self, part: MissionType, count: int) -> None:
        """Forget what is beyond `count`."""
        del self._items[part][count:]

    def clear(self, part: MissionType) -> None:
        """Forget all, home too."""
        self.truncate(part, 0)

    def number(self, part: MissionType) -> int:
        """Return a number that tells this list from others: a checksum; 0 when empty."""
        packed = b"".join(
            struct.pack("<HB5f2i", item.command, item.frame, *item.params, item.z, item.x, item.y)
            for item in self._items[part]
        )
        return zlib.crc32(packed)

    def _home_item(self) -> WireItem:
        home = self.home
        place = (round(home.latitude * 1e7), round(home.longitude * 1e7), home.altitude)
        return WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), *place)


@dataclass(frozen=True, slots=True)
class Behaviour:
    """How a mock autopilot takes lists.

    `refusals` are results to answer an item (or `COUNT`) with, whatever it says. `legacy_first`: it
    asks with MISSION_REQUEST; PX4 until it is sent MISSION_ITEM_INT. `complete_only`: PX4
    acknowledges a repeated last item only if it has all items (older ones acknowledge a repeated
    item of an upload that they gave up).
    """

    firmware: "type[MockFirmware]"
    refusals: Mapping[tuple[int, int], MavResult] = field(default_factory=dict)
    legacy_first: bool = False
    complete_only: bool = True

    @property
    def family(self) -> AutopilotFamily:
        """The autopilot that is mocked."""
        return self.firmware.family


class MockFirmware(ABC):
    """The part of a mock autopilot that differs from one autopilot to the next.

    `ready` tells whether booting is over, `flying` whether the mission is being flown. What
    derives from it answers the messages of the mission protocol, and says:

    Attributes:
        family: the autopilot that is mocked.
        mission_limit: how many items of a mission it holds, home included.
        parameters: what ground stations look for beside the parameters that the package knows.
        misplaced: the answer to an item of a fence, or a rally point, in a mission.
        nonsense: the answer to commands 0 and 1.
        silent_at_boot: it answers nothing about lists before it is ready.
        numbers_missions: its MISSION_CURRENT has a number for the mission.
        returns_by_mode: the types of vehicle that change their mode when a mission has them return.
        fence_texts: what it says when it leaves the fence.
        armed_inside_only: it does not arm where home lies outside the fence.
        mode_denied, no_mode: the MAV_RESULT of a mode that it does not enter, and of no such mode.
        not_armed, not_armed_text: the MAV_RESULT with which it does not arm, and what it says.
    """

    family: ClassVar[AutopilotFamily]
    mission_limit: ClassVar[int]
    parameters: ClassVar[Mapping[str, float]] = {}
    misplaced: ClassVar[MavResult]
    nonsense: ClassVar[MavResult]
    silent_at_boot: ClassVar[bool] = False
    numbers_missions: ClassVar[bool] = False
    returns_by_mode: ClassVar[frozenset[str]] = frozenset()
    fence_texts: ClassVar[tuple[Statustext, ...]]
    armed_inside_only: ClassVar[bool] = False
    mode_denied: ClassVar[int]
    no_mode: ClassVar[int]
    not_armed: ClassVar[int]
    not_armed_text: ClassVar[str]

    def __init__(
        self,
        lists: StoredLists,
        behaviour: Behaviour,
        ready: Callable[[], bool],
        flying: Callable[[], bool],
    ) -> None:
        self._lists, self._behaviour = lists, behaviour
        self._manners = lists.vehicle.family.manners
        self._ready, self._flying = ready, flying
        self._legacy = behaviour.legacy_first
        self.reset()

    @property
    @abstractmethod
    def deadline(self) -> float | None:
        """When the next request or the end of patience is due."""

    @abstractmethod
    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""

    @abstractmethod
    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""

    @abstractmethod
    def tick(self, now: float) -> list[Message]:
        """Ask again, or give up."""

    def requested_mode(self, command: CommandLong) -> int | None:
        """Return the custom mode that DO_SET_MODE asks for, None if it asks for none."""
        number = whole(command.param2)
        return number if is_custom(command) and number >= 0 else None

    def without_place(self, reports: list[Message]) -> list[Message]:
        """Return what it tells of position `reports` as long as it does not know where it is."""
        return reports[:0]

    def infeasible(self, mission: Mission) -> str | None:  # noqa: ARG002
        """Return why `mission` is not flown though it was taken, None if it is."""
        return None

    def check_count(self, part: MissionType, count: int) -> MavResult:
        """Return what it answers to the announcement of `count` items."""
        if (refusal := self._behaviour.refusals.get((part, COUNT))) is not None:
            return refusal
        fits = self._ready() and count <= self.size_limit(part)
        return MavResult.ACCEPTED if fits else MavResult.NO_SPACE

    def size_limit(self, part: MissionType) -> int:
        """Return how many items of that list it holds."""
        dialect = self._lists.vehicle.dialect
        return (self.mission_limit, dialect.fence_rows, dialect.rally_rows)[part]

    def check_item(self, part: MissionType, seq: int, item: WireItem) -> MavResult:
        """Return what it answers to `item`, number `seq` of that list."""
        if (refusal := self._behaviour.refusals.get((part, seq))) is not None:
            return refusal
        if part is MissionType.MISSION:
            if item.command in BESIDE:
                return self.misplaced
            if item.command in (0, 1):
                return self.nonsense
            return _check_mission_item(mission_item(item), self._lists.vehicle)
        if (result := self.check_beside(part, item)) != MavResult.ACCEPTED:
            return result
        if abs(item.x) > 900_000_000:
            return MavResult.INVALID_PARAM5_X
        return MavResult.INVALID_PARAM6_Y if abs(item.y) > 1_800_000_000 else MavResult.ACCEPTED

    @abstractmethod
    def check_beside(self, part: MissionType, item: WireItem) -> MavResult:
        """Return what it answers to `item` of a fence or of rally points that is on Earth."""


def _check_mission_item(item: MissionItem, vehicle: VehicleType) -> MavResult:
    """Return what is wrong with `item`: the first field that `vehicle` does not take.

    Fields are tried in the order of the message, those behind the one tried set to 0.
    """
    refusal = vehicle.dialect.refusal
    if item.frame != Frame.MISSION and refusal(MissionItem(16, item.frame)) is not None:
        return MavResult.UNSUPPORTED_FRAME
    values = (*item.params, item.x, item.y, item.z)
    for tried in range(len(values) + 1):
        one, two, three, four, x, y, z = (*values[:tried], *[0.0] * (len(values) - tried))
        if refusal(replace(item, params=(one, two, three, four), x=x, y=y, z=z)) is not None:
            return MavResult.UNSUPPORTED if tried == 0 else MavResult(_FIELDS[tried - 1])
    return MavResult.ACCEPTED


def is_custom(command: CommandLong) -> bool:
    """Tell whether DO_SET_MODE asks for a custom mode (MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)."""
    flags = whole(command.param1)
    return flags > 0 and flags % 2 == 1


def whole(param: float) -> int:
    """Return a command's parameter as a number of something, -1 if it cannot be one."""
    return int(param) if 0 <= param < 2**32 else -1
