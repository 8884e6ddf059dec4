"""How a mock autopilot takes, refuses, stores and gives lists of items."""

import math
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from faao_mav.autopilot import VehicleType
from faao_mav.errors import InputError
from faao_mav.mission.command import Frame
from faao_mav.mission.item import Home, MissionItem
from faao_mav.sim.behaviour import COUNT, Behaviour
from faao_mav.wire import messages
from faao_mav.wire.messages import ListMessage, Message, WireItem
from faao_mav.wire.protocol import ALL_TYPES, Address, MavResult, MavSeverity, MissionType
from faao_mav.wire.wire_items import home_items, mission_item, mission_of, wire_item


@dataclass(slots=True)
class _Transfer:
    """A list on its way: with whom, how many of its `count` items have passed, and when."""

    partner: Address
    part: MissionType
    count: int
    heard: float
    sending: bool = False
    passed: int = 0
    asked: float = 0.0
    items: tuple[WireItem, ...] = ()


class StoredLists:
    """What `vehicle` stores, and how it answers the mission protocol as `behaviour` says.

    `ready` tells whether booting is over, `flying` whether the mission is being flown. By its
    manners it answers each request for an item by itself, and each list has an upload of its own;
    or there is one transfer, of whatever list, downloads included. What is not `atomic` is changed
    item by item, but for fences: an upload that stops half-way leaves new and old items mixed.
    """

    def __init__(
        self,
        vehicle: VehicleType,
        home: Home,
        behaviour: Behaviour,
        ready: Callable[[], bool],
        flying: Callable[[], bool],
    ) -> None:
        self._vehicle, self._home, self._behaviour = vehicle, home, behaviour
        self._manners, self._dialect = vehicle.family.manners, vehicle.dialect
        self._ready, self._flying = ready, flying
        self._items: dict[MissionType, tuple[WireItem, ...]] = dict.fromkeys(MissionType, ())
        self._alone = not self._manners.any_request_order
        self._legacy, self._now = True, 0.0
        self._busy = MavResult.ERROR if self._alone else MavResult.DENIED
        self.reset()

    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""
        self._transfers: dict[MissionType | None, _Transfer] = {}
        """What is under way, by its list; under None where there is one transfer only."""
        self._whole: tuple[Address, MissionType, int] | None = None
        """The transfer that has ended with all items: with whom, of what, and how many."""

    def items(self, part: MissionType) -> tuple[WireItem, ...]:
        """Return what a download gives."""
        return self._items[part]

    def replace(self, part: MissionType, items: Iterable[WireItem]) -> None:
        """Store all of `items`, which are as `kept` gives them, in place of the list."""
        self._items[part] = tuple(items)

    def kept(self, part: MissionType, seq: int, item: WireItem) -> WireItem:
        """Return what becomes of `item`; a home item is the vehicle's own, whatever is sent."""
        if seq < home_items(self._vehicle, part):
            h = self._home
            return wire_item(MissionItem(16, 0, x=h.latitude, y=h.longitude, z=h.altitude), seq)
        stored = self._dialect.stored(mission_item(item))
        return wire_item(stored, seq, current=seq == 0 and not self._dialect.home_row)

    def number(self, part: MissionType) -> int:
        """Return a number that tells this list from others, a checksum; 0: it has no numbers."""
        checksum = zlib.crc32(repr(self._items[part]).encode())
        return checksum if self._behaviour.numbers_lists else 0

    @property
    def deadline(self) -> float:
        """When the next request or the end of patience is due; infinity for none."""
        return min(map(self._due, self._transfers.values()), default=math.inf)

    def _due(self, transfer: _Transfer) -> float:
        end = transfer.heard + self._manners.patience
        return end if transfer.sending else min(end, transfer.asked + self._manners.request_period)

    def tick(self, now: float) -> list[Message]:
        """Ask again, or give up; who has several uploads says so to the partner."""
        self._now, out = now, list[Message]()
        for transfer in list(self._transfers.values()):
            if now >= transfer.heard + self._manners.patience:
                out.append(_warning("Mission transfer timeout"))
                cancelled = self._end(transfer, MavResult.OPERATION_CANCELLED)
                out += cancelled[self._alone :]
            elif now >= self._due(transfer):
                out += self._ask(transfer)
        return out

    def on(self, sender: Address, message: ListMessage, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""
        self._now, given = now, message.mission_type
        everything = given == ALL_TYPES and isinstance(message, messages.MissionClearAll)
        parts = [part for part in MissionType if everything or given == part]
        if not parts:
            is_ack = isinstance(message, messages.MissionAck)
            return [] if is_ack else _ack(sender, given, MavResult.UNSUPPORTED)
        part = parts[0]
        under_way = self._transfers.get(self._slot(part))
        match message:
            case messages.MissionCount(count=count):
                return self._on_count(sender, part, count, under_way)
            case messages.MissionItemInt():
                return self._on_item(sender, message, under_way)
            case messages.MissionRequestList():
                return self._on_list(sender, part, under_way)
            case messages.MissionRequestInt():
                return self._on_request(sender, message, under_way)
            case messages.MissionAck(type=result) if under_way is not None and self._alone:
                return self._on_ack(part, result, under_way) if sender == under_way.partner else []
            case messages.MissionClearAll() if not (under_way and self._alone):
                if part is MissionType.MISSION and self._flying() and not self._alone:
                    return _ack(sender, given, MavResult.ERROR)
                return self._clear(sender, given, parts)
        return []

    def _slot(self, part: MissionType) -> MissionType | None:
        return None if self._alone else part

    def _on_count(
        self, sender: Address, part: MissionType, count: int, under_way: _Transfer | None
    ) -> list[Message]:
        if under_way is not None:
            again = sender == under_way.partner and not under_way.sending
            if self._alone and again and under_way.passed == 0:
                under_way.heard = self._now
                return self._ask(under_way)
            if self._alone or not again:
                return _ack(sender, under_way.part, self._busy)
        limit = (self._behaviour.mission_limit, self._dialect.fence_rows, self._dialect.rally_rows)
        refusal = self._behaviour.refusals.get((part, COUNT))
        if count > limit[part]:
            text = _warning(f"Only {limit[part]} items are supported")
            return [*_ack(sender, part, refusal or MavResult.NO_SPACE), text]
        if refusal or not self._ready():
            return _ack(sender, part, refusal or MavResult.NO_SPACE)
        if count == 0:
            return self._clear(sender, part, [part])
        if self._in_place(part):
            self.replace(part, self.items(part)[:count])
        self._transfers[self._slot(part)] = upload = _Transfer(sender, part, count, self._now)
        return self._ask(upload)

    def _on_item(
        self, sender: Address, message: messages.MissionItemInt, upload: _Transfer | None
    ) -> list[Message]:
        part, seq = MissionType(message.mission_type), message.seq
        if upload is None:
            # PX4 acknowledges the last item of the upload before once more.
            before = self._alone and self._whole == (sender, part, seq + 1)
            return _ack(sender, part, MavResult.ACCEPTED if before else MavResult.ERROR)
        if sender != upload.partner:
            return [] if self._alone else _ack(sender, part, self._busy)
        if part != upload.part or upload.sending:
            return _ack(sender, part, MavResult.ERROR)
        if self._alone:
            self._legacy = False
        if seq != upload.passed:
            silent = self._manners.ignores_other_items
            return [] if silent else _ack(sender, part, MavResult.INVALID_SEQUENCE)
        result = self._check_item(part, seq, message.item)
        if result != MavResult.ACCEPTED:
            return self._end(upload, result)
        upload.items = (*upload.items, self.kept(part, seq, message.item))
        upload.heard, upload.passed = self._now, seq + 1
        if self._in_place(part):
            self.replace(part, upload.items + self.items(part)[seq + 1 :])
        if upload.passed < upload.count:
            return self._ask(upload)
        if part is MissionType.FENCE and not self._alone:
            try:
                mission_of({part: upload.items}, self._vehicle)
            except InputError:
                ended = self._end(upload, MavResult.ERROR)
                return [_warning("Fence validation failed"), *ended]
        self.replace(part, upload.items)
        return self._end(upload, MavResult.ACCEPTED)

    def _on_list(
        self, sender: Address, part: MissionType, under_way: _Transfer | None
    ) -> list[Message]:
        items = self.items(part)
        if under_way is not None:
            given = under_way.sending and under_way.passed == under_way.count
            again = under_way.sending and (sender, part) == (under_way.partner, under_way.part)
            if not (given or again):
                return [] if self._alone else _ack(sender, part, self._busy)
        if self._alone:
            sending = _Transfer(sender, part, len(items), self._now, sending=True, items=items)
            self._transfers[None] = sending
        return [messages.MissionCount(sender, part, len(items), self.number(part))]

    def _on_request(
        self, sender: Address, request: messages.MissionRequestInt, under_way: _Transfer | None
    ) -> list[Message]:
        part, seq = MissionType(request.mission_type), request.seq
        items = self.items(part)
        if self._alone:
            ours = under_way is not None and (sender, part) == (under_way.partner, under_way.part)
            if under_way is None or not ours or not under_way.sending:
                return []
            if seq not in (under_way.passed, under_way.passed - 1) or seq == under_way.count:
                return self._end(under_way, MavResult.ERROR)
            under_way.heard, under_way.passed, items = self._now, seq + 1, under_way.items
        elif under_way is not None and not isinstance(request, messages.MissionRequest):
            return _ack(sender, part, self._busy)
        if seq >= len(items):
            wrong = MavResult.ERROR if part is MissionType.MISSION else MavResult.INVALID_SEQUENCE
            return _ack(sender, part, wrong)
        return [messages.MissionItemInt(sender, part, seq, items[seq])]

    def _on_ack(self, part: MissionType, result: int, under_way: _Transfer) -> list[Message]:
        if result == MavResult.UNSUPPORTED and not under_way.sending:
            self._legacy = not self._legacy
            return self._ask(under_way)
        if part == under_way.part if under_way.sending else result == MavResult.OPERATION_CANCELLED:
            self._end(under_way, MavResult.OPERATION_CANCELLED)
        return []

    def _clear(self, sender: Address, given: int, parts: Iterable[MissionType]) -> list[Message]:
        for part in parts:
            self._transfers.pop(self._slot(part), None)
            self.replace(part, ())
        return _ack(sender, given, MavResult.ACCEPTED)

    def _ask(self, upload: _Transfer) -> list[Message]:
        upload.asked = self._now
        kind = messages.MissionRequest if self._legacy else messages.MissionRequestInt
        return [kind(upload.partner, upload.part, upload.passed)]

    def _end(self, transfer: _Transfer, result: MavResult) -> list[Message]:
        del self._transfers[self._slot(transfer.part)]
        whole = transfer.passed == transfer.count
        self._whole = (transfer.partner, transfer.part, transfer.count) if whole else None
        number = self.number(transfer.part) if result == MavResult.ACCEPTED else 0
        return [messages.MissionAck(transfer.partner, transfer.part, result, number)]

    def _in_place(self, part: MissionType) -> bool:
        return not self._dialect.atomic and part is not MissionType.FENCE

    def _check_item(self, part: MissionType, seq: int, item: WireItem) -> MavResult:
        """Return what it answers to `item`, number `seq` of that list."""
        if (refusal := self._behaviour.refusals.get((part, seq))) is not None:
            return refusal
        result = self._behaviour.answer(part, item)
        if result != MavResult.ACCEPTED:
            return result
        if part is MissionType.MISSION:
            return self._check_mission_item(mission_item(item))
        if abs(item.x) > 900_000_000:
            return MavResult.INVALID_PARAM5_X
        return MavResult.INVALID_PARAM6_Y if abs(item.y) > 1_800_000_000 else MavResult.ACCEPTED

    def _check_mission_item(self, item: MissionItem) -> MavResult:
        """Return what is wrong with `item`: the first field that the vehicle does not take.

        Fields are tried in the order of the message, those behind the one tried set to 0.
        """
        refusal = self._dialect.refusal
        if item.frame != Frame.MISSION and refusal(MissionItem(16, item.frame)) is not None:
            return MavResult.UNSUPPORTED_FRAME
        for tried in range(8):
            one, two, three, four, x, y, z = (*item.numbers[:tried], *[0.0] * (7 - tried))
            if refusal(replace(item, params=(one, two, three, four), x=x, y=y, z=z)) is not None:
                wrong = MavResult.INVALID_PARAM1 + tried - 1
                return MavResult(wrong) if tried else MavResult.UNSUPPORTED
        return MavResult.ACCEPTED


def _warning(text: str) -> Message:
    return messages.Statustext(MavSeverity.WARNING, text)


def _ack(to: Address, mission_type: int, result: MavResult) -> list[Message]:
    return [messages.MissionAck(to, mission_type, result)]
