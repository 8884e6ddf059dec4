"""Downloading one list: MISSION_REQUEST_LIST, then its items."""

import math
from collections.abc import Sequence
from typing import Literal

from faao_mav.wire.machine import Progress
from faao_mav.wire.messages import (
    ListMessage,
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    WireItem,
)
from faao_mav.wire.protocol import MavResult, MissionType
from faao_mav.wire.transfer.exchange import TENTATIVE, Exchange, Peer, Status
from faao_mav.wire.transfer.pace import Budget, Pace, Question, Timeouts

_SPREAD = 0.4
"""By how many seconds packets are first taken to be late on a link that changes their order:
chosen, above the 0.3 s of the links in the tests; it doubles as long as that is not enough."""

_DOUBTS = 2
"""How often a request is repeated in vain, after an ERROR that may be about a late packet, before
the transfer is taken to be over; chosen."""

_WINDOW = 5
"""Items asked for at once where the autopilot answers each request by itself: MAVProxy's number."""


class Download(Exchange):
    """A machine that downloads a list and acknowledges it.

    - PX4 gives the item that it expects to be asked for, or the one before, and ends the transfer
      at any other request (`handle_mission_request_both`): it is asked for one item at a time, and
      so are autopilots that are not known. ArduPilot answers each request by itself
      (`handle_mission_request_int`): like MAVProxy, this asks it for up to five items at once,
      unless the link is not known yet or may have become slow.
    - An item is asked for again after the time that `Pace` gives, or at once when a later request
      has been answered: links rarely change the order (as in RFC 8985, until one does).
    - A request that comes late ends a transfer of PX4 with ERROR; but ERROR and DENIED may as well
      be about late packets of an upload before. When nothing is answered after it, this waits
      until what is under way has come, and begins anew. After a second such end a request is
      repeated no sooner than packets are late (`_SPREAD`), and if it was repeated the next one
      waits until every copy must have come; after a third every request waits so long for the one
      before, as links repeat packets too.
    - After `Timeouts.silence`, or another refusal, it begins anew, `Timeouts.attempts` times.
      UNSUPPORTED changes to MISSION_REQUEST, once.

    How long answers take is known from the pace of an upload `before`.
    """

    writes = False

    def __init__(
        self,
        peer: Peer,
        mission_type: MissionType = MissionType.MISSION,
        timeouts: Timeouts | None = None,
        budget: Budget | None = None,
        before: Pace | None = None,
    ) -> None:
        self._pace = Pace(timeouts or Timeouts(), before=before)
        super().__init__(
            peer,
            mission_type,
            timeouts,
            budget,
            math.inf if self._pace.is_doubtful else max(_SPREAD, self._pace.wait),
        )
        self._attempts_done = 0
        self._phase: Literal["list", "items", "resting"] = "list"
        self._legacy = False
        self._count = self._opaque_id = 0
        self._items: dict[int, WireItem] = {}
        self._requests: dict[int, Question] = {}
        self._next_sequence = 0
        self._presumed_lost: set[int] = set()
        self._in_order = True
        self._last_progress = 0.0
        # Transfers that late packets ended, requests in vain since the last sign of that, the
        # answers to the last item's request that may still come, and when it was sent last.
        self._ended_by_disorder = self._doubts = self._copies_under_way = 0
        self._last_sent = -math.inf

    @property
    def progress(self) -> Progress:
        """Items received, of all."""
        return f"reading {self._type.title}", len(self._items), self._count

    def _question(self) -> Message:
        return MissionRequestList(self._peer.address, self._type)

    @property
    def _reached(self) -> int | None:
        return len(self._items)

    def start(self, now: float) -> Sequence[Message]:
        """Ask for the list."""
        self._phase = "list"
        return super().start(now)

    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:
        if self._phase == "resting":
            return ()
        match message:
            case MissionCount():
                return self._on_count(message.count, message.opaque_id, now)
            case MissionItemInt() if self._phase == "items":
                return self._on_item(message.seq, message.item, now)
            case MissionAck():
                return self._on_ack(message.type, now)
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        match self._phase:
            case "resting":
                return self.start(now)
            case "list":
                return super()._time_out(now)
        if now - self._last_progress >= min(self._timeouts.silence, self._peer.manners.patience):
            return self.start(now) if self._items else self._give_up(now)
        return self._repeat(now) if self._requests else self._proceed(now)

    def _give_up(self, now: float) -> Sequence[Message]:
        self._attempts_done += 1
        if self._attempts_done < self._timeouts.attempts:
            return self.start(now)
        self._finish()
        return [self._peer.ack(MavResult.OPERATION_CANCELLED, self._type)]

    def _on_count(self, count: int, opaque_id: int, now: float) -> Sequence[Message]:
        if self._phase == "items":
            # A repeated answer; another number means that the list has changed meanwhile.
            return () if count == self._count else self._give_up(now)
        self._phase, self._count, self._opaque_id = "items", count, opaque_id
        self._items, self._requests, self._next_sequence = {}, {}, 0
        self._last_progress, self._copies_under_way = now, 0
        return self._proceed(now)

    def _on_item(self, seq: int, item: WireItem, now: float) -> Sequence[Message]:
        if seq in self._items:
            self._pace.answer_again()
            self._in_order = self._in_order and seq not in self._presumed_lost
            if seq == self._next_sequence - 1:
                self._copies_under_way -= 1
        if seq not in self._requests:
            return () if self._requests else self._proceed(now)
        earlier = list(self._requests)[: list(self._requests).index(seq)] if self._in_order else []
        self._presumed_lost.update(earlier)
        request = self._requests.pop(seq)
        self._pace.answer(request, now)
        self._copies_under_way, self._last_sent = request.sent - 1, request.last_sent
        self._items[seq] = item
        self._budget.reach("download", len(self._items))
        self._last_progress, self._result, self._doubts = now, None, 0
        return [*(self._send_again(lost, now) for lost in earlier), *self._proceed(now)]

    def _on_ack(self, result: int, now: float) -> Sequence[Message]:
        if result == MavResult.ACCEPTED:
            return ()
        if result == MavResult.UNSUPPORTED and self._phase == "items" and not self._legacy:
            self._legacy = True
            return [self._send_again(seq, now) for seq in list(self._requests)]
        self._result = result
        if result in TENTATIVE:
            return ()
        self._attempts_done += 1
        if self._attempts_done == self._timeouts.attempts:
            self._finish()
        else:
            self._rest(now)
        return ()

    def _rest(self, now: float) -> None:
        """Begin anew, but not at once: more may be on the way that is about the same."""
        self._phase, self._doubts = "resting", 0
        self._due = now + max(_SPREAD, self._spread)

    @property
    def _spread(self) -> float:
        """How late packets may be, s; 0 while nothing tells that the link changes their order."""
        ended = self._ended_by_disorder
        return 0.0 if ended < 2 else _SPREAD * 2.0 ** max(ended - 3, 0)

    @property
    def _repeat_after(self) -> float:
        """How long after a request it is repeated, s."""
        return max(self._pace.wait, self._spread)

    def _proceed(self, now: float) -> Sequence[Message]:
        if len(self._items) == self._count:
            self._finish()
            return [self._peer.ack(MavResult.ACCEPTED, self._type)] * self._peer.manners.final_acks
        wide = self._peer.manners.any_request_order and not self._pace.is_doubtful
        copies_come = self._copies_under_way > 0 or self._ended_by_disorder > 2
        if copies_come and not wide and now < self._last_sent + self._spread:
            self._due = self._last_sent + self._spread
            return ()
        out = []
        while self._next_sequence < self._count and len(self._requests) < (_WINDOW if wide else 1):
            self._requests[self._next_sequence] = self._pace.ask(now)
            out.append(self._request(self._next_sequence))
            self._next_sequence += 1
        self._schedule()
        return out

    def _repeat(self, now: float) -> Sequence[Message]:
        """Ask again for what is due; for one of them less often from now on."""
        if self._result in TENTATIVE:
            self._doubts += 1
            if self._doubts > _DOUBTS:
                self._ended_by_disorder += 1
                self._rest(now)
                return ()
        due = [
            seq
            for seq, request in self._requests.items()
            if request.last_sent + self._repeat_after <= now
        ]
        out = [self._request(seq) for seq in due]
        for index, seq in enumerate(due):
            self._requests[seq] = request = self._requests.pop(seq)
            if index == 0:
                self._pace.repeat(request, now)
            else:
                request.send_again(now)
        self._schedule()
        return out

    def _send_again(self, seq: int, now: float) -> Message:
        self._requests[seq] = self._requests.pop(seq)
        self._requests[seq].send_again(now)
        self._schedule()
        return self._request(seq)

    def _schedule(self) -> None:
        self._due = (
            min(request.last_sent for request in self._requests.values()) + self._repeat_after
        )

    def _request(self, seq: int) -> Message:
        return MissionRequestInt(self._peer.address, self._type, seq, self._legacy)

    def _finish(self) -> None:
        whole = self._phase == "items" and len(self._items) == self._count
        items = tuple(self._items[seq] for seq in range(self._count)) if whole else ()
        status: Status = "accepted"
        if not whole:
            status = "silent" if self._result is None else "refused"
        self._end(status, self._result, items, self._opaque_id)
