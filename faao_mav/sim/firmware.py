"""What the mocks of different autopilots have in common, and the data in which they differ."""

import struct
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from faao_mav.autopilot import AutopilotFamily, VehicleType
from faao_mav.autopilot.dialect import BESIDE
from faao_mav.mission.command import Frame
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.wire.manners import manners_of
from faao_mav.wire.messages import (
    CommandLong,
    Envelope,
    Message,
    MissionAck,
    MissionRequestInt,
    Statustext,
    WireItem,
)
from faao_mav.wire.protocol import Address, MavResult, MissionType
from faao_mav.wire.wire_items import home_items, mission_item, wire_item

COUNT = -1
"""In `Behaviour.refusals`: instead of an item, the announcement of the list."""

_FIELDS = range(MavResult.INVALID_PARAM1, MavResult.INVALID_PARAM7 + 1)
"""What is wrong if param1 to param4, x, y or z is."""


class StoredLists:
    """What is stored: items as the vehicle gives them back."""

    def __init__(self, vehicle: VehicleType, home: Home) -> None:
        self.vehicle, self._home = vehicle, home
        self._items: dict[MissionType, tuple[WireItem, ...]] = dict.fromkeys(MissionType, ())

    def items(self, part: MissionType) -> tuple[WireItem, ...]:
        """Return what a download gives."""
        return self._items[part]

    def replace(self, part: MissionType, items: Iterable[WireItem]) -> None:
        """Store all of `items`, which are as `kept` gives them, in place of the list."""
        self._items[part] = tuple(items)

    def kept(self, part: MissionType, seq: int, item: WireItem) -> WireItem:
        """Return what becomes of `item`; a home item is the vehicle's own, whatever is sent."""
        if seq < home_items(self.vehicle, part):
            h = self._home
            return wire_item(MissionItem(16, 0, x=h.latitude, y=h.longitude, z=h.altitude), seq)
        stored = self.vehicle.dialect.stored(mission_item(item))
        return wire_item(stored, seq, current=seq == 0 and not self.vehicle.dialect.home_row)

    def number(self, part: MissionType) -> int:
        """Return a number that tells this list from others: a checksum; 0 when empty."""
        packed = b"".join(
            struct.pack("<HB5f2i", item.command, item.frame, *item.params, item.z, item.x, item.y)
            for item in self._items[part]
        )
        return zlib.crc32(packed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """The autopilot that a mock is, and how that differs from others.

    Attributes:
        family: the autopilot.
        lists: what answers the messages about lists.
        mission_limit: how many items of a mission it holds, home included.
        misplaced: the answer to an item of a fence, or a rally point, in a mission.
        nonsense: the answer to commands 0 and 1.
        beside: the answer to an item of a fence or of rally points that is on Earth.
        requested_mode: the custom mode that DO_SET_MODE asks for, None if it asks for none.
        infeasible: why a mission is not flown though it was taken, "" if it is.
        parameters: what ground stations look for beside the parameters that the package knows.
        silent_at_boot: it answers nothing about lists before it is ready.
        numbers_missions: its MISSION_CURRENT has a number for the mission.
        tells_no_place: it tells latitude and longitude 0 as long as it knows none; else nothing.
        returns_by_mode: the types of vehicle that change their mode when a mission has them return.
        fence_texts: what it says when it leaves the fence.
        armed_inside_only: it does not arm where home lies outside the fence.
        mode_denied, no_mode: the MAV_RESULT of a mode that it does not enter, and of no such mode.
        not_armed, not_armed_text: the MAV_RESULT with which it does not arm, and what it says.
        refusals: results to answer an item (or `COUNT`) with, whatever it says.
        legacy_first: it asks with MISSION_REQUEST; PX4 until it is sent MISSION_ITEM_INT.
        complete_only: PX4 acknowledges a repeated last item only if it has all items; older ones
            acknowledge a repeated item of an upload that they gave up.
    """

    family: AutopilotFamily
    lists: "type[ListServer]"
    mission_limit: int
    misplaced: MavResult
    nonsense: MavResult
    beside: Callable[[MissionType, WireItem], MavResult]
    requested_mode: Callable[[CommandLong], int | None]
    infeasible: Callable[[Mission], str] = lambda _: ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    silent_at_boot: bool = False
    numbers_missions: bool = False
    tells_no_place: bool = False
    returns_by_mode: frozenset[str]
    fence_texts: tuple[Statustext, ...]
    armed_inside_only: bool = False
    mode_denied: int
    no_mode: int
    not_armed: int
    not_armed_text: str
    refusals: Mapping[tuple[int, int], MavResult] = field(default_factory=dict)
    legacy_first: bool = False
    complete_only: bool = True


@dataclass(slots=True)
class Transfer:
    """A list on its way: with whom, how many of its `count` items have passed, and when."""

    partner: Address
    part: MissionType
    count: int
    heard: float
    sending: bool = False
    passed: int = 0
    asked: float = 0.0
    items: tuple[WireItem, ...] = ()


class ListServer(ABC):
    """What takes and gives lists; `ready` tells if booting is over, `flying` if a mission is flown.

    What derives from it answers the messages of the mission protocol.
    """

    def __init__(
        self,
        stored: StoredLists,
        behaviour: Behaviour,
        ready: Callable[[], bool],
        flying: Callable[[], bool],
    ) -> None:
        self._stored, self._behaviour = stored, behaviour
        self._manners = manners_of(stored.vehicle)
        self._ready, self._flying = ready, flying
        self._legacy = behaviour.legacy_first
        self.reset()

    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""
        self._transfers: dict[MissionType, Transfer] = {}

    @property
    def deadline(self) -> float | None:
        """When the next request or the end of patience is due."""
        return min(map(self._due, self._transfers.values()), default=None)

    def _due(self, transfer: Transfer) -> float:
        end = transfer.heard + self._manners.patience
        return end if transfer.sending else min(end, transfer.asked + self._manners.request_period)

    def tick(self, now: float) -> list[Message]:
        """Ask again, or give up."""
        out: list[Message] = []
        for part, transfer in list(self._transfers.items()):
            if now >= transfer.heard + self._manners.patience:
                del self._transfers[part]
                out += self._given_up(transfer)
            elif now >= self._due(transfer):
                out += self._ask(transfer, now)
        return out

    @abstractmethod
    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""

    @abstractmethod
    def _given_up(self, transfer: Transfer) -> list[Message]:
        """Return what is said when nothing more comes."""

    def _begin(self, transfer: Transfer) -> list[Message]:
        self._transfers[transfer.part] = transfer
        return self._ask(transfer, transfer.heard)

    def _ask(self, transfer: Transfer, now: float) -> list[Message]:
        transfer.asked = now
        part, seq = transfer.part, transfer.passed
        return [MissionRequestInt(transfer.partner, part, seq, self._legacy)]

    def _cleared(self, sender: Address, mission_type: int, *parts: MissionType) -> list[Message]:
        for part in parts:
            self._transfers.pop(part, None)
            self._stored.replace(part, ())
        return [MissionAck(sender, mission_type, MavResult.ACCEPTED)]

    def _size_limit(self, part: MissionType) -> int:
        """Return how many items of that list it holds."""
        dialect = self._stored.vehicle.dialect
        return (self._behaviour.mission_limit, dialect.fence_rows, dialect.rally_rows)[part]

    def _check_count(self, part: MissionType, count: int) -> MavResult:
        """Return what it answers to the announcement of `count` items."""
        fits = self._ready() and count <= self._size_limit(part)
        result = MavResult.ACCEPTED if fits else MavResult.NO_SPACE
        return self._behaviour.refusals.get((part, COUNT), result)

    def _check_item(self, part: MissionType, seq: int, item: WireItem) -> MavResult:
        """Return what it answers to `item`, number `seq` of that list."""
        if (refusal := self._behaviour.refusals.get((part, seq))) is not None:
            return refusal
        if part is MissionType.MISSION:
            if item.command in BESIDE:
                return self._behaviour.misplaced
            if item.command in (0, 1):
                return self._behaviour.nonsense
            return _check_mission_item(mission_item(item), self._stored.vehicle)
        if (result := self._behaviour.beside(part, item)) != MavResult.ACCEPTED:
            return result
        if abs(item.x) > 900_000_000:
            return MavResult.INVALID_PARAM5_X
        return MavResult.INVALID_PARAM6_Y if abs(item.y) > 1_800_000_000 else MavResult.ACCEPTED


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
