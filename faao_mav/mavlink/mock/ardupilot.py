"""How ArduPilot takes and gives lists."""

from collections.abc import Callable
from dataclasses import dataclass

from faao_mav.mavlink.messages import (
    Envelope,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    MissionWritePartialList,
    Row,
    Statustext,
)
from faao_mav.mavlink.mock.lists import Lists
from faao_mav.mavlink.mock.manners import COUNT, Manners, check_row
from faao_mav.mavlink.transfer.protocol import ALL_TYPES, Address, MissionType, Result

_WARNING = 4


@dataclass(slots=True)
class _Receiving:
    """An upload under way; `fence` collects what takes effect only as a whole."""

    partner: Address
    next: int
    last: int
    heard: float
    asked: float
    fence: list[Row]


class ArduPilotServer:
    """The lists' keeper: each list has an upload of its own, and one partner at a time.

    A mission is changed item by item: an upload that stops half-way leaves new and old items
    mixed. `ready` tells whether booting is over, `flying` whether the mission is being flown.
    """

    def __init__(
        self,
        lists: Lists,
        manners: Manners,
        ready: Callable[[], bool],
        flying: Callable[[], bool],
    ) -> None:
        self._lists, self._manners = lists, manners
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
        kind = getattr(message, "mission_type", None)
        if kind is None:
            return []
        if kind == ALL_TYPES and isinstance(message, MissionClearAll):
            return self._clear_all(sender)
        if kind not in tuple(MissionType):
            known = isinstance(message, MissionAck)
            return [] if known else [_ack(sender, Result.UNSUPPORTED, kind)]
        part = MissionType(kind)
        match message:
            case MissionCount(count=count):
                return self._on_count(sender, part, count, now)
            case MissionItemInt(seq=seq, row=row):
                return self._on_item(sender, part, seq, row, now)
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
            if now >= upload.heard + self._manners.give_up:
                del self._uploads[part]
                out.append(Statustext(_WARNING, "Mission upload timeout"))
                out.append(_ack(upload.partner, Result.OPERATION_CANCELLED, part))
            elif now >= upload.asked + self._manners.ask_again:
                out.append(self._ask(part, upload, now))
        return out

    def _due(self, upload: _Receiving) -> float:
        return min(upload.heard + self._manners.give_up, upload.asked + self._manners.ask_again)

    def _on_count(
        self, sender: Address, part: MissionType, count: int, now: float
    ) -> list[Message]:
        upload = self._uploads.get(part)
        if upload is not None and upload.partner != sender:
            return [_ack(sender, Result.DENIED, part)]
        refusal = self._manners.refusals.get((part, COUNT))
        if refusal is not None:
            return [_ack(sender, refusal, part)]
        limit = self._manners.limits[part]
        if not self._ready():
            return [_ack(sender, Result.NO_SPACE, part)]
        if count > limit:
            text = Statustext(_WARNING, f"Only {limit} items are supported")
            return [_ack(sender, Result.NO_SPACE, part), text]
        if count == 0:
            self._lists.clear(part)
            self._uploads.pop(part, None)
            return [_ack(sender, Result.ACCEPTED, part)]
        if part is not MissionType.FENCE:
            self._lists.truncate(part, count)
        return self._begin(sender, part, 0, count - 1, now)

    def _on_partial(
        self, sender: Address, part: MissionType, first: int, last: int, now: float
    ) -> list[Message]:
        count = len(self._lists.rows(part))
        if not 0 <= first <= last <= count:
            return [_ack(sender, Result.ERROR, part)]
        return self._begin(sender, part, first, last, now)

    def _begin(
        self, sender: Address, part: MissionType, first: int, last: int, now: float
    ) -> list[Message]:
        upload = _Receiving(sender, first, last, now, now, [])
        self._uploads[part] = upload
        return [self._ask(part, upload, now)]

    def _ask(self, part: MissionType, upload: _Receiving, now: float) -> Message:
        upload.asked = now
        partner = upload.partner
        return MissionRequestInt(partner.system, partner.component, upload.next, part, legacy=True)

    def _on_item(
        self, sender: Address, part: MissionType, seq: int, row: Row, now: float
    ) -> list[Message]:
        upload = self._uploads.get(part)
        if upload is None:
            return [_ack(sender, Result.ERROR, part)]
        if seq != upload.next:
            return [_ack(sender, Result.INVALID_SEQUENCE, part)]
        if sender != upload.partner:
            return [_ack(sender, Result.DENIED, part)]
        result = self._manners.refusals.get((part, seq)) or check_row(row, part, "ardupilot")
        if result != Result.ACCEPTED:
            del self._uploads[part]
            return [_ack(sender, result, part)]
        if part is MissionType.FENCE:
            upload.fence.append(self._lists.kept(part, seq, row))
        else:
            self._lists.put(part, seq, row)
        upload.heard, upload.next = now, seq + 1
        if seq < upload.last:
            return [self._ask(part, upload, now)]
        if part is MissionType.FENCE:
            self._lists.replace(part, upload.fence)
        del self._uploads[part]
        return [_ack(sender, Result.ACCEPTED, part)]

    def _on_list(self, sender: Address, part: MissionType) -> list[Message]:
        if part in self._uploads:
            return [_ack(sender, Result.DENIED, part)]
        count = len(self._lists.rows(part))
        return [MissionCount(sender.system, sender.component, count, part)]

    def _on_request(
        self, sender: Address, part: MissionType, request: MissionRequestInt
    ) -> list[Message]:
        rows = self._lists.rows(part)
        if part in self._uploads and not request.legacy:
            return [_ack(sender, Result.DENIED, part)]
        if request.seq >= len(rows):
            wrong = Result.ERROR if part is MissionType.MISSION else Result.INVALID_SEQUENCE
            return [_ack(sender, wrong, part)]
        target = (sender.system, sender.component)
        return [MissionItemInt(*target, request.seq, part, rows[request.seq], request.legacy)]

    def _on_clear(self, sender: Address, part: MissionType) -> list[Message]:
        busy = part in self._uploads or (part is MissionType.MISSION and self._flying())
        if busy:
            return [_ack(sender, Result.ERROR, part)]
        self._lists.clear(part)
        return [_ack(sender, Result.ACCEPTED, part)]

    def _clear_all(self, sender: Address) -> list[Message]:
        if self._uploads or self._flying():
            return [_ack(sender, Result.ERROR, ALL_TYPES)]
        for part in MissionType:
            self._lists.clear(part)
        return [_ack(sender, Result.ACCEPTED, ALL_TYPES)]


def _ack(target: Address, result: Result, mission_type: int) -> MissionAck:
    return MissionAck(target.system, target.component, result, mission_type)
