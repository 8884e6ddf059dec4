"""What a mock autopilot stores, and how it takes, refuses and gives it: lists, parameters."""

import math
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from faao_mav.autopilot import VehicleType
from faao_mav.errors import InputError
from faao_mav.mission.command import Frame
from faao_mav.mission.item import Home, MissionItem
from faao_mav.sim.behaviour import COUNT, Behaviour
from faao_mav.wire import messages
from faao_mav.wire.messages import ListMessage, Message, WireItem
from faao_mav.wire.parameters import carried, value_in
from faao_mav.wire.protocol import ALL_TYPES, Address, MavResult, MavSeverity, MissionType
from faao_mav.wire.wire_items import home_items, mission_item, mission_of, wire_item

_INT32, _REAL32 = 6, 9  # MAV_PARAM_TYPE of whole numbers, and of single-precision ones.


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

    @property
    def whose(self) -> tuple[Address, MissionType]:
        return self.partner, self.part


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

    @property
    def number(self) -> int:
        """A number that tells this mission from others, a checksum; 0: it has no numbers."""
        checksum = zlib.crc32(repr(self._items[MissionType.MISSION]).encode())
        return checksum if self._behaviour.numbers_missions else 0

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
        self._now, self._sender, given = now, sender, message.mission_type
        everything = given == ALL_TYPES and isinstance(message, messages.MissionClearAll)
        parts = [part for part in MissionType if everything or given == part]
        if not parts:
            is_ack = isinstance(message, messages.MissionAck)
            return [] if is_ack else self._ack(given, MavResult.UNSUPPORTED)
        part = parts[0]
        under_way = self._transfers.get(self._slot(part))
        match message:
            case messages.MissionCount(count=count):
                return self._on_count(part, count, under_way)
            case messages.MissionItemInt(seq=seq, item=item):
                return self._on_item(part, seq, item, under_way)
            case messages.MissionRequestList():
                return self._on_list(part, under_way)
            case messages.MissionRequestInt():
                legacy = isinstance(message, messages.MissionRequest)
                return self._on_request(part, message.seq, under_way, legacy=legacy)
            case messages.MissionAck(type=result) if under_way is not None and self._alone:
                return self._on_ack(part, result, under_way) if sender == under_way.partner else []
            case messages.MissionClearAll() if not (under_way and self._alone):
                if part is MissionType.MISSION and self._flying() and not self._alone:
                    return self._ack(given, MavResult.ERROR)
                return self._clear(given, parts)
        return []

    def _slot(self, part: MissionType) -> MissionType | None:
        return None if self._alone else part

    def _on_count(
        self, part: MissionType, count: int, under_way: _Transfer | None
    ) -> list[Message]:
        if under_way is not None:
            again = self._sender == under_way.partner and not under_way.sending
            if self._alone and again and under_way.passed == 0:
                under_way.heard = self._now
                return self._ask(under_way)
            if self._alone or not again:
                return self._ack(under_way.part, self._busy)
        limits = self._behaviour.mission_limit, self._dialect.fence_rows, self._dialect.rally_rows
        refusal, fits = self._behaviour.refusals.get((part, COUNT)), count <= limits[part]
        if refusal or not fits or not self._ready():
            says = [] if fits else [_warning(f"Only {limits[part]} items are supported")]
            return [*self._ack(part, refusal or MavResult.NO_SPACE), *says]
        if count == 0:
            return self._clear(part, [part])
        if self._in_place(part):
            self.replace(part, self.items(part)[:count])
        self._transfers[self._slot(part)] = upload = _Transfer(self._sender, part, count, self._now)
        return self._ask(upload)

    def _on_item(
        self, part: MissionType, seq: int, item: WireItem, upload: _Transfer | None
    ) -> list[Message]:
        if upload is None:
            # PX4 acknowledges the last item of the upload before once more.
            before = self._alone and self._whole == (self._sender, part, seq + 1)
            return self._ack(part, MavResult.ACCEPTED if before else MavResult.ERROR)
        if self._sender != upload.partner:
            return [] if self._alone else self._ack(part, self._busy)
        if part != upload.part or upload.sending:
            return self._ack(part, MavResult.ERROR)
        if self._alone:
            self._legacy = False
        if seq != upload.passed:
            silent = self._manners.ignores_other_items
            return [] if silent else self._ack(part, MavResult.INVALID_SEQUENCE)
        result = self._check_item(part, seq, item)
        if result != MavResult.ACCEPTED:
            return self._end(upload, result)
        upload.items = (*upload.items, self.kept(part, seq, item))
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

    def _on_list(self, part: MissionType, under_way: _Transfer | None) -> list[Message]:
        items, whose = self.items(part), (self._sender, part)
        if under_way is not None:
            given = under_way.passed == under_way.count
            if not under_way.sending or not (given or whose == under_way.whose):
                return [] if self._alone else self._ack(part, self._busy)
        if self._alone:
            sending = _Transfer(*whose, len(items), self._now, sending=True, items=items)
            self._transfers[None] = sending
        return [messages.MissionCount(*whose, len(items))]

    def _on_request(
        self, part: MissionType, seq: int, under_way: _Transfer | None, *, legacy: bool
    ) -> list[Message]:
        items, whose = self.items(part), (self._sender, part)
        if self._alone:
            if under_way is None or not under_way.sending or whose != under_way.whose:
                return []
            if seq not in (under_way.passed, under_way.passed - 1) or seq == under_way.count:
                return self._end(under_way, MavResult.ERROR)
            under_way.heard, under_way.passed, items = self._now, seq + 1, under_way.items
        elif under_way is not None and not legacy:
            return self._ack(part, self._busy)
        if seq >= len(items):
            wrong = MavResult.ERROR if part is MissionType.MISSION else MavResult.INVALID_SEQUENCE
            return self._ack(part, wrong)
        return [messages.MissionItemInt(*whose, seq, items[seq])]

    def _on_ack(self, part: MissionType, result: int, under_way: _Transfer) -> list[Message]:
        if result == MavResult.UNSUPPORTED and not under_way.sending:  # so says MAVSDK
            self._legacy = not self._legacy
            return self._ask(under_way)
        if part == under_way.part if under_way.sending else result == MavResult.OPERATION_CANCELLED:
            self._end(under_way, MavResult.OPERATION_CANCELLED)
        return []

    def _clear(self, given: int, parts: Iterable[MissionType]) -> list[Message]:
        for part in parts:
            self._transfers.pop(self._slot(part), None)
            self.replace(part, ())
        return self._ack(given, MavResult.ACCEPTED)

    def _ack(self, part: int, result: MavResult) -> list[Message]:
        return [messages.MissionAck(self._sender, part, result)]

    def _ask(self, upload: _Transfer) -> list[Message]:
        upload.asked = self._now
        kind = messages.MissionRequest if self._legacy else messages.MissionRequestInt
        return [kind(*upload.whose, upload.passed)]

    def _end(self, transfer: _Transfer, result: MavResult) -> list[Message]:
        del self._transfers[self._slot(transfer.part)]
        whole = transfer.passed == transfer.count
        self._whole = (*transfer.whose, transfer.count) if whole else None
        return [messages.MissionAck(*transfer.whose, result)]

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


class ParameterServer:
    """Parameters of `vehicle` by name, in the autopilot's own units.

    Those whose default is an `int` are whole numbers; `given` are other values than the `defaults`.
    Of the names that one parameter has it knows the oldest that is given. An autopilot that sends
    whole numbers as their bits sets nothing that comes with another type than it has.
    """

    def __init__(
        self, defaults: Mapping[str, float], given: Mapping[str, float], vehicle: VehicleType
    ) -> None:
        self._vehicle = vehicle
        self.values: dict[str, float] = {
            name: type(defaults.get(name, value))(value)
            for name, value in {**defaults, **given}.items()
        }
        for parameter in vehicle.parameters.values():
            known = [name for name in parameter.names if name in given]
            for other in {*parameter.names} - {*known[-1:]} if known else ():
                self.values.pop(other, None)

    def on(
        self, message: messages.ParamRequestList | messages.ParamRequestRead | messages.ParamSet
    ) -> list[Message]:
        """Return the answer to a request; unknown names get none."""
        names = list(self.values)
        match message:
            case messages.ParamRequestRead(param_index=index) if index != -1:
                names = names[index : index + 1] if index >= 0 else []
            case messages.ParamRequestRead(param_id=name):
                names = [name] if name in self.values else []
            case messages.ParamSet(param_id=name):
                names = [name] if self._takes(message) else []
        return [self._told(name) for name in names]

    def _takes(self, message: messages.ParamSet) -> bool:
        """Set a parameter; tell whether it is one, whatever became of its value."""
        name, value = message.param_id, value_in(message, self._vehicle)
        strict = self._vehicle.family.whole_as_bits
        if name not in self.values or (strict and message.param_type != self._kind(name)):
            return False
        if math.isfinite(value):
            self.values[name] = type(self.values[name])(value)
        return True

    def _kind(self, name: str) -> int:
        return _INT32 if isinstance(self.values[name], int) else _REAL32

    def _told(self, name: str) -> Message:
        index, kind = list(self.values).index(name), self._kind(name)
        number = carried(float(self.values[name]), kind, self._vehicle)
        return messages.ParamValue(name, number, kind, len(self.values), index)
