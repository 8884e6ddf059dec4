"""How PX4 takes and gives lists."""

from dataclasses import dataclass
from typing import Literal

from faao_mav.mavlink.messages import (
    Envelope,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    Row,
    Statustext,
)
from faao_mav.mavlink.mock.lists import Lists
from faao_mav.mavlink.mock.manners import COUNT, Manners, check_row
from faao_mav.mavlink.transfer.protocol import ALL_TYPES, NOBODY, Address, MissionType, Result

_CRITICAL = 2
_INFO = 6


@dataclass(slots=True)
class _Transfer:
    """The one transfer that there is, or the last that there was (state "idle")."""

    state: Literal["idle", "receiving", "sending"] = "idle"
    partner: Address = NOBODY
    part: MissionType = MissionType.MISSION
    next: int = 0
    count: int = 0
    number: int = 0
    heard: float = 0.0
    asked: float = 0.0
    rows: tuple[Row, ...] = ()


class Px4Server:
    """The lists' keeper: one transfer at a time, and a new list replaces the old as a whole."""

    def __init__(self, lists: Lists, manners: Manners) -> None:
        self._lists, self._manners = lists, manners
        self._transfer = _Transfer()
        self._int_mode = manners.kind != "px4-legacy-first"

    @property
    def deadline(self) -> float | None:
        """When the next request or the end of patience is due."""
        transfer = self._transfer
        if transfer.state == "idle":
            return None
        end = transfer.heard + self._manners.give_up
        if transfer.state == "receiving":
            return min(end, transfer.asked + self._manners.ask_again)
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
        if now >= transfer.heard + self._manners.give_up:
            transfer.state = "idle"
            return [_said("Operation timeout")]
        if transfer.state == "receiving" and now >= transfer.asked + self._manners.ask_again:
            return [self._ask(now)]
        return []

    def _on_count(self, sender: Address, kind: int, count: int, now: float) -> list[Message]:
        transfer = self._transfer
        if transfer.state == "receiving" and sender == transfer.partner and transfer.next == 0:
            transfer.heard = now
            return [self._ask(now)]
        if transfer.state != "idle":
            if transfer.state == "receiving":
                transfer.heard = now
            return [_ack(sender, Result.ERROR, kind), _said("WPM: IGN MISSION_COUNT: Busy")]
        if kind not in tuple(MissionType):
            return [_ack(sender, Result.INVALID, kind)]
        part = MissionType(kind)
        refusal = self._manners.refusals.get((part, COUNT))
        if refusal is not None:
            return [_ack(sender, refusal, part)]
        if count > self._manners.limits[part]:
            return [_ack(sender, Result.NO_SPACE, part)]
        if count == 0:
            self._lists.clear(part)
            return [_ack(sender, Result.ACCEPTED, part)]
        self._transfer = _Transfer("receiving", sender, part, 0, count, 0, now)
        return [self._ask(now)]

    def _ask(self, now: float) -> Message:
        transfer = self._transfer
        transfer.asked = now
        target = (transfer.partner.system, transfer.partner.component)
        return MissionRequestInt(*target, transfer.next, transfer.part, not self._int_mode)

    def _on_item(self, sender: Address, item: MissionItemInt, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return [_said("REJ. MIS ITEM: partner id mismatch")]
        self._int_mode = not item.legacy
        if item.mission_type != transfer.part or transfer.state == "sending":
            return [_ack(sender, Result.ERROR, item.mission_type)]
        if transfer.state == "idle":
            return self._on_late_item(sender, item)
        transfer.heard = now
        if item.seq != transfer.next:
            return []
        return self._take(item, now)

    def _on_late_item(self, sender: Address, item: MissionItemInt) -> list[Message]:
        transfer = self._transfer
        complete = transfer.next == transfer.count or not self._manners.complete_only
        if item.seq + 1 == transfer.next and complete:
            return [_ack(sender, Result.ACCEPTED, transfer.part, transfer.number)]
        text = _said("IGN MISSION_ITEM: No transfer")
        return [_ack(sender, Result.ERROR, transfer.part), text]

    def _take(self, item: MissionItemInt, now: float) -> list[Message]:
        transfer, part = self._transfer, self._transfer.part
        result = self._manners.refusals.get((part, item.seq))
        result = result or check_row(item.row, part, self._manners.kind)
        if result != Result.ACCEPTED:
            transfer.state = "idle"
            text = _said("IGN MISSION_ITEM: Invalid item")
            return [_ack(transfer.partner, result, part), text]
        transfer.rows = (*transfer.rows, self._lists.kept(part, item.seq, item.row))
        transfer.next += 1
        if transfer.next < transfer.count:
            return [self._ask(now)]
        transfer.state = "idle"
        self._lists.replace(part, transfer.rows)
        transfer.number = self._lists.number(part)
        return [_ack(transfer.partner, Result.ACCEPTED, part, transfer.number)]

    def _on_ack(self, sender: Address, ack: MissionAck, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return []
        if transfer.state == "sending" and ack.mission_type == transfer.part:
            transfer.state = "idle"
        elif transfer.state == "receiving":
            if ack.type == Result.UNSUPPORTED:
                self._int_mode = not self._int_mode
                return [self._ask(now)]
            if ack.type == Result.OPERATION_CANCELLED:
                transfer.state = "idle"
        return []

    def _on_list(self, sender: Address, kind: int, now: float) -> list[Message]:
        transfer = self._transfer
        again = sender == transfer.partner and kind == transfer.part
        done = transfer.next == transfer.count
        free = transfer.state == "idle" or (transfer.state == "sending" and (again or done))
        if not free or kind not in tuple(MissionType):
            return [Statustext(_INFO, "Mission download request ignored, already active")]
        part = MissionType(kind)
        rows = self._lists.rows(part)
        self._transfer = _Transfer("sending", sender, part, 0, len(rows), 0, now, rows=rows)
        number = self._lists.number(part)
        return [MissionCount(sender.system, sender.component, len(rows), part, number)]

    def _on_request(self, sender: Address, request: MissionRequestInt, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return [_said("WPM: REJ. CMD: partner id mismatch")]
        if transfer.state != "sending" or request.mission_type != transfer.part:
            return []
        transfer.heard = now
        if request.seq == transfer.next < transfer.count:
            transfer.next += 1
        elif request.seq != transfer.next - 1:
            transfer.state = "idle"
            text = _said("WPM: REJ. CMD: Req. WP was unexpected")
            return [_ack(sender, Result.ERROR, transfer.part), text]
        target = (sender.system, sender.component)
        row = transfer.rows[request.seq]
        return [MissionItemInt(*target, request.seq, transfer.part, row, request.legacy)]

    def _on_clear(self, sender: Address, kind: int) -> list[Message]:
        if self._transfer.state != "idle":
            return [_said("WPM: IGN CLEAR CMD: Busy")]
        if kind != ALL_TYPES and kind not in tuple(MissionType):
            return []
        for part in MissionType:
            if kind in (part, ALL_TYPES):
                self._lists.clear(part)
        return [_ack(sender, Result.ACCEPTED, kind)]


def _said(text: str) -> Statustext:
    return Statustext(_CRITICAL, f"{text}\t")


def _ack(target: Address, result: Result, mission_type: int, number: int = 0) -> MissionAck:
    return MissionAck(target.system, target.component, result, mission_type, number)
