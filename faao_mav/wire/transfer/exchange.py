"""The transfers of one list, as talks: uploading, downloading and clearing it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from faao_mav.autopilot import VehicleType
from faao_mav.autopilot.manners import Manners
from faao_mav.wire.machine import AT_ONCE, Line, Talk
from faao_mav.wire.messages import (
    Heartbeat,
    ListMessage,
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
from faao_mav.wire.protocol import Address, MavResult, MavState, MissionType
from faao_mav.wire.questions import BOOT, SLOWEST, Pace, Questions, Timeouts

Status: TypeAlias = Literal["accepted", "unknown", "refused", "silent", "armed", "cancelled"]

TENTATIVE = frozenset({MavResult.ERROR, MavResult.DENIED})
"""Results that PX4 and ArduPilot also give to late packets of an earlier transfer: they count when
nothing else is said."""

_NOT_YET = frozenset({MavResult.NO_SPACE, MavResult.UNSUPPORTED})
"""What ArduPilot answers while it boots: before it has storage, and before it knows missions."""

_OPENING = -1
"""The question that opens a transfer, where the others are the numbers of items."""

_TEXTS = 5
"""The number of status texts that are kept, the last ones; chosen."""

_REASONS = 1.5
"""Seconds to wait after a refusal for the status text that gives the reason, and for a heartbeat,
which tells whether the vehicle has rebooted: vehicles send one a second; a rebooting ArduCopter's
came 0.96 s after it had refused."""

_LATE = 0.4
"""By how many seconds packets are taken to be late, once one has ended a transfer: chosen, above
the 0.3 s of the links in the tests; it doubles as long as that is not enough."""

_WINDOW = 5
"""Items asked for at once where the autopilot answers each request by itself: MAVProxy's number."""


@dataclass(slots=True, eq=False)
class Peer:
    """Both ends of a transfer, and what flies at the other: None if its autopilot is not known.

    Unless it `may_be_armed`, nothing more is written once a heartbeat of it says that it is armed.
    `pace` is what its transfers have learnt so far of how long answers take, `beat` its last
    heartbeat.
    """

    own: Address
    address: Address
    vehicle: VehicleType | None
    may_be_armed: bool = False
    timeouts: Timeouts = field(default_factory=Timeouts)
    pace: Pace = field(default_factory=Pace)
    beat: Heartbeat | None = None

    @property
    def manners(self) -> Manners:
        """How the other end behaves in transfers."""
        return Manners() if self.vehicle is None else self.vehicle.family.manners

    @property
    def boots(self) -> bool:
        """Whether it says that it is not ready."""
        return self.beat is not None and self.beat.system_status < MavState.STANDBY


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a transfer ended.

    `status`: "accepted"; "unknown": everything was sent, but the last answer is missing or
    ambiguous; "refused" with the `result`; "silent": it got no further; "armed": stopped because
    the vehicle is armed; "cancelled" by the vehicle with the `result`. `last_requested` is the
    number of the item last asked for, `items` what was downloaded, `said` the vehicle's status
    texts, `opaque_id` its number for the list, 0 for none.
    """

    status: Status
    result: int | None = None
    last_requested: int | None = None
    items: tuple[WireItem, ...] = ()
    said: tuple[str, ...] = ()
    opaque_id: int = 0


class _Exchange:
    """One list on its way: its questions, and what the vehicle says."""

    def __init__(self, line: Line, peer: Peer, part: MissionType, *, writes: bool) -> None:
        self._line, self._peer, self._part = line, peer, part
        self._writes = writes and not peer.may_be_armed
        self._texts: list[str] = []
        self.asked = Questions[int](line, peer.pace)
        self.until = 0.0
        """When it is given up, s."""
        self.result: int | None = None
        """What the vehicle said last, if it was no that may be about something else."""

    @property
    def armed(self) -> bool:
        """Whether nothing more is to be written because the vehicle is armed."""
        return self._writes and self._peer.beat is not None and self._peer.beat.armed

    def further(self) -> None:
        """Note that it has got further."""
        self.until, self.result = self._line.now + self._peer.timeouts.silence, None

    def doubt(self, result: int) -> None:
        """Note a refusal that counts only when nothing else is said."""
        self.result = result
        if _OPENING not in self.asked:  # which a busy vehicle is asked until it is free
            self.until = min(self.until, self._line.now + SLOWEST)

    def hear(self) -> Talk[ListMessage | None]:
        """Return what the vehicle says of the list, asking again meanwhile; None: it is over."""
        while self._line.now < self.until and not self.armed:
            if self._line.heard is None:
                self.asked.repeat()
            message = yield from self.wait(min(self.asked.due, self.until))
            match message:
                case ListMessage(target=to, mission_type=part) if part == self._part:
                    if self._peer.own.takes(to):
                        return message
        return None

    def boots(self, result: int, until: float) -> Talk[bool]:
        """Wait for the reason of a refusal; tell whether it was that the vehicle booted.

        Then it has done so: before the time `until`.
        """
        rests, booted = min(self._line.now + _REASONS, until), self._peer.boots
        while self._line.now < rests and not self.armed:
            if booted and result in _NOT_YET:
                if not self._peer.boots:
                    return True
                rests = until
            yield from self.wait(rests)
            booted = booted or self._peer.boots
        self.result = result
        return False

    def wait(self, until: float) -> Talk[Message | None]:
        """Return what the vehicle says next, None where that is nothing by the time `until`."""
        try:
            yield until
        except GeneratorExit:
            self.cancel()
            raise
        heard = self._line.heard
        if heard is None or heard.sender != self._peer.address:
            return None
        if isinstance(heard.message, Heartbeat):
            self._peer.beat = heard.message
        elif isinstance(heard.message, Statustext):
            self._texts = [*self._texts[1 - _TEXTS :], heard.message.text.strip()]
        return heard.message

    def cancel(self) -> None:
        """Tell the vehicle that this transfer is over."""
        self._line.say(MissionAck(self._peer.address, self._part, MavResult.OPERATION_CANCELLED))

    def over(self, reached: int | None = None) -> Outcome:
        """End it where nothing more was heard, and tell the vehicle."""
        self.cancel()
        if self.armed:
            return self.ended("armed", None, reached)
        return self.ended("silent" if self.result is None else "refused", self.result, reached)

    def ended(
        self,
        status: Status,
        result: int | None = None,
        reached: int | None = None,
        items: Sequence[WireItem] = (),
        opaque_id: int = 0,
    ) -> Outcome:
        """Return the outcome."""
        said = tuple(dict.fromkeys(self._texts))
        return Outcome(status, result, reached, tuple(items), said, opaque_id)


def send_list(
    items: Sequence[WireItem], peer: Peer, part: MissionType = MissionType.MISSION
) -> Talk[Outcome]:
    """Upload `items`, of which there is one at least; the vehicle leads.

    - Any item below the count is sent whenever it is asked for, by either request, as
      MISSION_ITEM_INT. PX4 and ArduPilot are sent it again when nothing follows: it was lost, or
      the request for the next one was.
    - PX4 takes the item that it waits for and passes over any other, so it is sent the next one
      too, whichever was lost, but never the last one unasked. If it refuses one of the two, it is
      not known which: the upload begins anew, one item at a time.
    - ArduPilot says INVALID_SEQUENCE of an item that it has, and is sent the next one.
    - An ERROR may be about a duplicate too (PX4: of MISSION_COUNT), and DENIED about a late request
      of a download before: they count when nothing more is asked for.
    - When everything was sent and no answer comes, the outcome is "unknown", and reading back must
      tell.
    - NO_SPACE or UNSUPPORTED from an ArduPilot that boots, as it does after a reboot in the middle,
      means "not yet": it is told again once it is ready.
    """
    line = yield AT_ONCE
    title, last, boots_until = f"uploading {part.title}", len(items) - 1, math.inf
    exchange = _Exchange(line, peer, part, writes=True)
    asked, repeats = exchange.asked, math.isfinite(peer.manners.request_period)
    pairs = passes_over = peer.manners.ignores_other_items

    def send(seq: int) -> None:
        ahead = pairs and seq + 1 < last
        item, *following = (
            MissionItemInt(peer.address, part, each, items[each])
            for each in range(seq, seq + 1 + ahead)
        )
        asked.put(seq, item, again=[*following, item])
        if not repeats:
            asked.clear()

    def begin() -> tuple[int, int]:
        asked.clear()
        exchange.further()
        if not exchange.armed:
            asked.put(_OPENING, MissionCount(peer.address, part, len(items)))
        return _OPENING, _OPENING

    current, furthest = begin()
    while True:
        line.progress = title, furthest + 1, len(items)
        reached = None if current == _OPENING else current
        match (yield from exchange.hear()):
            case None if furthest == last and not exchange.armed:
                return exchange.ended("unknown", exchange.result, reached)
            case None:
                return exchange.over(reached)
            case MissionRequestInt(seq=seq) if seq <= last:
                if seq > current:
                    asked.answer(current)
                elif seq < current:
                    asked.clear()
                if seq > furthest:
                    exchange.further()
                current, furthest, exchange.result = seq, max(furthest, seq), None
                send(seq)
            case MissionAck(type=MavResult.ACCEPTED, opaque_id=number):
                # Before the last item was asked for it can only be about something else.
                if furthest == last:
                    return exchange.ended("accepted", MavResult.ACCEPTED, reached, (), number)
            case MissionAck(type=MavResult.INVALID_SEQUENCE) if not passes_over:
                if asked.times(current) > 1 and current + 1 < last:
                    asked.answer(current)
                    current += 1
                    send(current)
            case MissionAck() if pairs and current != _OPENING and asked.times(current) > 1:
                pairs = False
                exchange.cancel()
                current, furthest = begin()
            case MissionAck(type=result) if result in TENTATIVE:
                exchange.doubt(result)
                if current != _OPENING:
                    asked.clear()
            case MissionAck(type=MavResult.OPERATION_CANCELLED as result):
                return exchange.ended("cancelled", result, reached)
            case MissionAck(type=result):
                boots_until = min(boots_until, line.now + BOOT)
                if not (yield from exchange.boots(result, boots_until)):
                    return exchange.over(reached)
                current, furthest = begin()


def read_list(peer: Peer, part: MissionType = MissionType.MISSION) -> Talk[Outcome]:
    """Download a list and acknowledge it.

    PX4 gives the item that it expects to be asked for, or the one before, and ends the transfer
    with ERROR at any other request (`handle_mission_request_both`): it is asked for one item at a
    time, and so are autopilots that are not known. ArduPilot answers each request by itself
    (`handle_mission_request_int`): like MAVProxy, this asks it for up to five items at once, once
    it is known how long answers take.

    When it gets no further it begins anew, `Timeouts.attempts` times. As a request that came late
    may have ended it, no request is then sent before the one before must have come.
    """
    line = yield AT_ONCE
    exchange, wide = _Exchange(line, peer, part, writes=False), peer.manners.any_request_order
    asked, legacy = exchange.asked, False

    def request(seq: int) -> None:
        asked.put(seq, MissionRequestInt(peer.address, part, seq, legacy))

    for attempt in range(peer.timeouts.attempts):
        if attempt:
            asked.least = max(2 * asked.least, _LATE)
        items, count, number, following = dict[int, WireItem](), -1, 0, 0
        asked.clear()
        exchange.further()
        asked.put(_OPENING, MissionRequestList(peer.address, part))
        while len(items) != count:
            line.progress = f"reading {part.title}", len(items), max(count, 0)
            match (yield from exchange.hear()):
                case None:
                    break
                case MissionCount() as told if _OPENING in asked:
                    asked.answer(_OPENING)
                    count, number = told.count, told.opaque_id
                case MissionCount(count=other) if count not in (-1, other):
                    break  # the list has changed meanwhile
                case MissionItemInt(seq=seq, item=item) if seq in asked:
                    asked.answer(seq)
                    items[seq] = item
                case MissionAck(type=MavResult.UNSUPPORTED) if count >= 0 and not legacy:
                    legacy = True
                    for seq in list(asked):
                        request(seq)
                    continue
                case MissionAck(type=result) if result in {*TENTATIVE, MavResult.INVALID_SEQUENCE}:
                    exchange.doubt(result)  # which may be about a late item of an upload
                    continue
                case MissionAck(type=result) if result != MavResult.ACCEPTED:
                    return exchange.ended("refused", result)
                case _:
                    continue
            exchange.further()
            while not wide and following < count and line.now < asked.last + asked.least:
                yield from exchange.wait(asked.last + asked.least)
            room = _WINDOW if wide and asked.pace.mean is not None else 1
            while following < count and len(asked) < room:
                request(following)
                following += 1
        else:
            ack = MissionAck(peer.address, part, MavResult.ACCEPTED)
            line.say(*[ack] * peer.manners.final_acks)
            found = [items[seq] for seq in range(count)]
            return exchange.ended("accepted", None, None, found, number)
    return exchange.over()


def clear_list(peer: Peer, part: MissionType = MissionType.MISSION) -> Talk[Outcome]:
    """Clear a list; asking twice does no harm, so it is asked until it is answered.

    PX4 says nothing while busy, ArduPilot ERROR.
    """
    line = yield AT_ONCE
    exchange = _Exchange(line, peer, part, writes=True)
    line.progress = f"clearing {part.title}", 0, 0
    exchange.further()
    if not exchange.armed:
        exchange.asked.put(_OPENING, MissionClearAll(peer.address, part))
    while (message := (yield from exchange.hear())) is not None:
        if isinstance(message, MissionAck):
            if message.type != MavResult.ERROR:
                accepted = message.type == MavResult.ACCEPTED
                return exchange.ended("accepted" if accepted else "refused", message.type)
            exchange.doubt(message.type)
    return exchange.over()
