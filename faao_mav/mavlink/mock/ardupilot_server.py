"""ArduPilot's side of the mission protocol: how it takes and gives lists."""

from collections.abc import Callable
from dataclasses import dataclass

from faao_mav.mavlink.manners import manners_of
from faao_mav.mavlink.messages import (
    Envelope,
    ListMessage,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    MissionWritePartialList,
    Statustext,
    WireItem,
)
from faao_mav.mavlink.mock.behaviour import COUNT, Behaviour, check_item, size_limit
from faao_mav.mavlink.mock.lists import StoredLists
from faao_mav.mavlink.protocol import ALL_TYPES, Address, MissionType, Result

_WARNING = 4
"""MAV_SEVERITY."""


@dataclass(slots=True)
class _Receiving:
    """An upload under way; `fence` collects what takes effect only as a whole."""

    partner: Address
    next_sequence: int
    last_sequence: int
    last_item_time: float
    last_request_time: float
    fence: list[WireItem]


class ArduPilotServer:
    """The lists' keeper: each list has an upload of its own, and one partner at a time.

    A mission is changed item by item: an upload that stops half-way leaves new and old items
    mixed. `ready` tells whether booting is over, `flying` whether the mission is being flown.
    """

    def __init__(
        self,
        lists: StoredLists,
        behaviour: Behaviour,
        ready: Callable[[], bool],
        flying: Callable[[], bool],
    ) -> None:
        self._lists, self._behaviour = lists, behaviour
        self._manners = manners_of(lists.vehicle)
        self._ready, self._flying = ready, flying
        self._uploads: dict[MissionType, _Receiving] = {}

    @property
    def deadline(self) -> float | None:
        """When the next request or the end of patience is due."""
        return min(map(self._due, self._uploads.values()), default=None)

    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""
        self._uploads.clear()

    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""
        sender, message = envelope.sender, envelope.message
        if not isinstance(message, ListMessage):
            return []
        kind = message.mission_type
        if kind == ALL_TYPES and isinstance(message, MissionClearAll):
            return self._clear_all(sender)
        if kind not in tuple(MissionType):
            known = isinstance(message, MissionAck)
            return [] if known else [MissionAck(sender, kind, Result.UNSUPPORTED)]
        part = MissionType(kind)
        match message:
            case MissionCount(count=count):
                return self._on_count(sender, part, count, now)
            case MissionItemInt(seq=seq, item=item):
                return self._on_item(sender, part, seq, item, now)
            case MissionRequestList():
                return self._on_list(sender, part)
            case MissionRequestInt():
                return self._on_request(sender, part, message)
            case MissionClearAll():
                return self._on_clear(sender, part)
            case MissionWritePartialList(start_index=first, end_index=last):
                return self._on_partial(sender, part, first, last, now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Ask again, or give up."""
        out: list[Message] = []
        for part, upload in list(self._uploads.items()):
            if now >= upload.last_item_time + self._manners.upload_patience:
                del self._uploads[part]
                out.append(Statustext(_WARNING, "Mission upload timeout"))
                out.append(MissionAck(upload.partner, part, Result.OPERATION_CANCELLED))
            elif now >= upload.last_request_time + self._manners.request_period:
                out.append(self._ask(part, upload, now))
        return out

    def _due(self, upload: _Receiving) -> float:
        return min(
            upload.last_item_time + self._manners.upload_patience,
            upload.last_request_time + self._manners.request_period,
        )

    def _on_count(
        self, sender: Address, part: MissionType, count: int, now: float
    ) -> list[Message]:
        upload = self._uploads.get(part)
        if upload is not None and upload.partner != sender:
            return [MissionAck(sender, part, Result.DENIED)]
        refusal = self._behaviour.refusals.get((part, COUNT))
        if refusal is not None:
            return [MissionAck(sender, part, refusal)]
        limit = size_limit(part, self._behaviour, self._lists.vehicle)
        if not self._ready():
            return [MissionAck(sender, part, Result.NO_SPACE)]
        if count > limit:
            text = Statustext(_WARNING, f"Only {limit} items are supported")
            return [MissionAck(sender, part, Result.NO_SPACE), text]
        if count == 0:
            self._lists.clear(part)
            self._uploads.pop(part, None)
            return [MissionAck(sender, part, Result.ACCEPTED)]
        if part is not MissionType.FENCE:
            self._lists.truncate(part, count)
        return self._begin(sender, part, 0, count - 1, now)

    def _on_partial(
        self, sender: Address, part: MissionType, first: int, last: int, now: float
    ) -> list[Message]:
        count = len(self._lists.items(part))
        if not 0 <= first <= last <= count:
            return [MissionAck(sender, part, Result.ERROR)]
        return self._begin(sender, part, first, last, now)

    def _begin(
        self, sender: Address, part: MissionType, first: int, last: int, now: float
    ) -> list[Message]:
        upload = _Receiving(sender, first, last, now, now, [])
        self._uploads[part] = upload
        return [self._ask(part, upload, now)]

    def _ask(self, part: MissionType, upload: _Receiving, now: float) -> Message:
        upload.last_request_time = now
        return MissionRequestInt(
            upload.partner, part, upload.next_sequence, legacy=self._behaviour.legacy_first
        )

    def _on_item(
        self, sender: Address, part: MissionType, seq: int, item: WireItem, now: float
    ) -> list[Message]:
        upload = self._uploads.get(part)
        if upload is None:
            return [MissionAck(sender, part, Result.ERROR)]
        if seq != upload.next_sequence:
            return [MissionAck(sender, part, Result.INVALID_SEQUENCE)]
        if sender != upload.partner:
            return [MissionAck(sender, part, Result.DENIED)]
        result = self._behaviour.refusals.get((part, seq)) or check_item(
            item, part, self._behaviour, self._lists.vehicle
        )
        if result != Result.ACCEPTED:
            del self._uploads[part]
            return [MissionAck(sender, part, result)]
        if part is MissionType.FENCE:
            upload.fence.append(self._lists.kept(part, seq, item))
        else:
            self._lists.put(part, seq, item)
        upload.last_item_time, upload.next_sequence = now, seq + 1
        if seq < upload.last_sequence:
            return [self._ask(part, upload, now)]
        if part is MissionType.FENCE:
            self._lists.replace(part, upload.fence)
        del self._uploads[part]
        return [MissionAck(sender, part, Result.ACCEPTED)]

    def _on_list(self, sender: Address, part: MissionType) -> list[Message]:
        if part in self._uploads:
            return [MissionAck(sender, part, Result.DENIED)]
        count = len(self._lists.items(part))
        return [MissionCount(sender, part, count)]

    def _on_request(
        self, sender: Address, part: MissionType, request: MissionRequestInt
    ) -> list[Message]:
        items = self._lists.items(part)
        if part in self._uploads and not request.legacy:
            return [MissionAck(sender, part, Result.DENIED)]
        if request.seq >= len(items):
            wrong = Result.ERROR if part is MissionType.MISSION else Result.INVALID_SEQUENCE
            return [MissionAck(sender, part, wrong)]
        return [MissionItemInt(sender, part, request.seq, items[request.seq], request.legacy)]

    def _on_clear(self, sender: Address, part: MissionType) -> list[Message]:
        busy = part in self._uploads or (part is MissionType.MISSION and self._flying())
        if busy:
            return [MissionAck(sender, part, Result.ERROR)]
        self._lists.clear(part)
        return [MissionAck(sender, part, Result.ACCEPTED)]

    def _clear_all(self, sender: Address) -> list[Message]:
        if self._uploads or self._flying():
            return [MissionAck(sender, ALL_TYPES, Result.ERROR)]
        for part in MissionType:
            self._lists.clear(part)
        return [MissionAck(sender, ALL_TYPES, Result.ACCEPTED)]
