"""PX4's side of the mission protocol: how it takes and gives lists."""

from dataclasses import dataclass
from typing import Literal

from faao_mav.mavlink.manners import manners_of
from faao_mav.mavlink.messages import (
    Envelope,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    Statustext,
    WireItem,
)
from faao_mav.mavlink.mock.behaviour import COUNT, Behaviour, check_item, size_limit
from faao_mav.mavlink.mock.lists import StoredLists
from faao_mav.mavlink.protocol import ALL_TYPES, NOBODY, Address, MissionType, Result

_CRITICAL, _INFO = 2, 6
"""MAV_SEVERITY."""


@dataclass(slots=True)
class _Transfer:
    """The one transfer that there is, or the last that there was (state "idle")."""

    state: Literal["idle", "receiving", "sending"] = "idle"
    partner: Address = NOBODY
    part: MissionType = MissionType.MISSION
    next_sequence: int = 0
    count: int = 0
    number: int = 0
    last_message_time: float = 0.0
    last_request_time: float = 0.0
    items: tuple[WireItem, ...] = ()


class Px4Server:
    """The lists' keeper: one transfer at a time, and a new list replaces the old as a whole."""

    def __init__(self, lists: StoredLists, behaviour: Behaviour) -> None:
        self._lists, self._behaviour = lists, behaviour
        self._manners = manners_of(lists.vehicle)
        self._transfer = _Transfer()
        self._legacy = behaviour.legacy_first

    @property
    def deadline(self) -> float | None:
        """When the next request or the end of patience is due."""
        transfer = self._transfer
        if transfer.state == "idle":
            return None
        end = transfer.last_message_time + self._manners.upload_patience
        if transfer.state == "receiving":
            return min(end, transfer.last_request_time + self._manners.request_period)
        return end

    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""
        self._transfer = _Transfer()

    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""
        sender = envelope.sender
        match envelope.message:
            case MissionCount(count=count, mission_type=kind):
                return self._on_count(sender, kind, count, now)
            case MissionItemInt() as item:
                return self._on_item(sender, item, now)
            case MissionAck() as ack:
                return self._on_ack(sender, ack, now)
            case MissionRequestList(mission_type=kind):
                return self._on_list(sender, kind, now)
            case MissionRequestInt() as request:
                return self._on_request(sender, request, now)
            case MissionClearAll(mission_type=kind):
                return self._on_clear(sender, kind)
        return []

    def tick(self, now: float) -> list[Message]:
        """Ask again, or give up in silence."""
        transfer = self._transfer
        if transfer.state == "idle":
            return []
        if now >= transfer.last_message_time + self._manners.upload_patience:
            transfer.state = "idle"
            return [_said("Operation timeout")]
        if (
            transfer.state == "receiving"
            and now >= transfer.last_request_time + self._manners.request_period
        ):
            return [self._ask(now)]
        return []

    def _on_count(self, sender: Address, kind: int, count: int, now: float) -> list[Message]:
        transfer = self._transfer
        if (
            transfer.state == "receiving"
            and sender == transfer.partner
            and transfer.next_sequence == 0
        ):
            transfer.last_message_time = now
            return [self._ask(now)]
        if transfer.state != "idle":
            if transfer.state == "receiving":
                transfer.last_message_time = now
            return [MissionAck(sender, kind, Result.ERROR), _said("WPM: IGN MISSION_COUNT: Busy")]
        if kind not in tuple(MissionType):
            return [MissionAck(sender, kind, Result.INVALID)]
        part = MissionType(kind)
        refusal = self._behaviour.refusals.get((part, COUNT))
        if refusal is not None:
            return [MissionAck(sender, part, refusal)]
        if count > size_limit(part, self._behaviour, self._lists.vehicle):
            return [MissionAck(sender, part, Result.NO_SPACE)]
        if count == 0:
            self._lists.clear(part)
            return [MissionAck(sender, part, Result.ACCEPTED)]
        self._transfer = _Transfer("receiving", sender, part, 0, count, 0, now)
        return [self._ask(now)]

    def _ask(self, now: float) -> Message:
        transfer = self._transfer
        transfer.last_request_time = now
        return MissionRequestInt(
            transfer.partner, transfer.part, transfer.next_sequence, self._legacy
        )

    def _on_item(self, sender: Address, item: MissionItemInt, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return [_said("REJ. MIS ITEM: partner id mismatch")]
        self._legacy = item.legacy
        if item.mission_type != transfer.part or transfer.state == "sending":
            return [MissionAck(sender, item.mission_type, Result.ERROR)]
        if transfer.state == "idle":
            return self._on_late_item(sender, item)
        transfer.last_message_time = now
        if item.seq != transfer.next_sequence:
            return []
        return self._take(item, now)

    def _on_late_item(self, sender: Address, item: MissionItemInt) -> list[Message]:
        transfer = self._transfer
        complete = transfer.next_sequence == transfer.count or not self._behaviour.complete_only
        if item.seq + 1 == transfer.next_sequence and complete:
            return [MissionAck(sender, transfer.part, Result.ACCEPTED, transfer.number)]
        text = _said("IGN MISSION_ITEM: No transfer")
        return [MissionAck(sender, transfer.part, Result.ERROR), text]

    def _take(self, item: MissionItemInt, now: float) -> list[Message]:
        transfer, part = self._transfer, self._transfer.part
        result = self._behaviour.refusals.get((part, item.seq))
        result = result or check_item(item.item, part, self._behaviour, self._lists.vehicle)
        if result != Result.ACCEPTED:
            transfer.state = "idle"
            text = _said("IGN MISSION_ITEM: Invalid item")
            return [MissionAck(transfer.partner, part, result), text]
        transfer.items = (*transfer.items, self._lists.kept(part, item.seq, item.item))
        transfer.next_sequence += 1
        if transfer.next_sequence < transfer.count:
            return [self._ask(now)]
        transfer.state = "idle"
        self._lists.replace(part, transfer.items)
        transfer.number = self._lists.number(part)
        return [MissionAck(transfer.partner, part, Result.ACCEPTED, transfer.number)]

    def _on_ack(self, sender: Address, ack: MissionAck, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return []
        if transfer.state == "sending" and ack.mission_type == transfer.part:
            transfer.state = "idle"
        elif transfer.state == "receiving":
            if ack.type == Result.UNSUPPORTED:
                self._legacy = not self._legacy
                return [self._ask(now)]
            if ack.type == Result.OPERATION_CANCELLED:
                transfer.state = "idle"
        return []

    def _on_list(self, sender: Address, kind: int, now: float) -> list[Message]:
        transfer = self._transfer
        again = sender == transfer.partner and kind == transfer.part
        done = transfer.next_sequence == transfer.count
        free = transfer.state == "idle" or (transfer.state == "sending" and (again or done))
        if not free or kind not in tuple(MissionType):
            return [Statustext(_INFO, "Mission download request ignored, already active")]
        part = MissionType(kind)
        items = self._lists.items(part)
        self._transfer = _Transfer("sending", sender, part, 0, len(items), 0, now, items=items)
        number = self._lists.number(part)
        return [MissionCount(sender, part, len(items), number)]

    def _on_request(self, sender: Address, request: MissionRequestInt, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return [_said("WPM: REJ. CMD: partner id mismatch")]
        if transfer.state != "sending" or request.mission_type != transfer.part:
            return []
        transfer.last_message_time = now
        if request.seq == transfer.next_sequence < transfer.count:
            transfer.next_sequence += 1
        elif request.seq != transfer.next_sequence - 1:
            transfer.state = "idle"
            text = _said("WPM: REJ. CMD: Req. WP was unexpected")
            return [MissionAck(sender, transfer.part, Result.ERROR), text]
        item = transfer.items[request.seq]
        return [MissionItemInt(sender, transfer.part, request.seq, item, request.legacy)]

    def _on_clear(self, sender: Address, kind: int) -> list[Message]:
        if self._transfer.state != "idle":
            return [_said("WPM: IGN CLEAR CMD: Busy")]
        if kind != ALL_TYPES and kind not in tuple(MissionType):
            return []
        for part in MissionType:
            if kind in (part, ALL_TYPES):
                self._lists.clear(part)
        return [MissionAck(sender, kind, Result.ACCEPTED)]


def _said(text: str) -> Statustext:
    return Statustext(_CRITICAL, f"{text}\t")
