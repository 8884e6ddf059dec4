"""Downloading one list: MISSION_REQUEST_LIST, then its items."""

from collections.abc import Sequence

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
from faao_mav.wire.transfer.exchange import OPENING, TENTATIVE, Exchange, Peer

_LATE = 0.4
"""By how many seconds packets are taken to be late, once one has ended a transfer: chosen, above
the 0.3 s of the links in the tests; it doubles as long as that is not enough."""

_WINDOW = 5
"""Items asked for at once where the autopilot answers each request by itself: MAVProxy's number."""


class Download(Exchange):
    """A machine that downloads a list and acknowledges it.

    PX4 gives the item that it expects to be asked for, or the one before, and ends the transfer
    with ERROR at any other request (`handle_mission_request_both`): it is asked for one item at a
    time, and so are autopilots that are not known. ArduPilot answers each request by itself
    (`handle_mission_request_int`): like MAVProxy, this asks it for up to five items at once, once
    it is known how long answers take.

    When it gets no further it begins anew, `Timeouts.attempts` times. As a request that came late
    may have ended it, no request is then sent before the one before must have come.
    """

    writes = False

    def __init__(self, peer: Peer, mission_type: MissionType = MissionType.MISSION) -> None:
        super().__init__(peer, mission_type)
        self._attempts_left = self._timeouts.attempts
        self._count: int | None = None
        self._opaque_id = 0
        self._items: dict[int, WireItem] = {}
        self._next_sequence = 0
        self._legacy = False

    @property
    def progress(self) -> Progress:
        """Items received, of all."""
        return f"reading {self._type.title}", len(self._items), self._count or 0

    @property
    def _reached(self) -> int | None:
        return len(self._items)

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        due = super().deadline
        return due if due is None or self._questions else min(due, self._resumes)

    @property
    def _resumes(self) -> float:
        """When the next request may be sent, s."""
        return self._questions.last + self._questions.least

    def _message(self, key: int) -> Message:
        if key == OPENING:
            return MissionRequestList(self._peer.address, self._type)
        return MissionRequestInt(self._peer.address, self._type, key, self._legacy)

    def start(self, now: float) -> Sequence[Message]:
        """Ask for the list."""
        self._attempts_left -= 1
        self._count, self._items, self._next_sequence = None, {}, 0
        self._questions.clear()
        self._get_further(now)
        return self._proceed(now)

    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:
        match message:
            case MissionCount(count=count, opaque_id=opaque_id) if OPENING in self._questions:
                self._questions.answer(OPENING, now)
                self._count, self._opaque_id = count, opaque_id
            case MissionCount(count=count) if self._count not in (None, count):
                return self._give_up(now)  # the list has changed meanwhile
            case MissionItemInt(seq=seq, item=item) if seq in self._questions:
                self._questions.answer(seq, now)
                self._items[seq] = item
            case MissionAck(type=result):
                return self._on_ack(result, now)
            case _:
                return ()
        self._get_further(now)
        return self._proceed(now)

    def _on_ack(self, result: int, now: float) -> Sequence[Message]:
        if result in TENTATIVE or result == MavResult.INVALID_SEQUENCE:
            self._doubt(result, now)  # which may be about a late item of an upload
        elif result == MavResult.UNSUPPORTED and self._count is not None and not self._legacy:
            self._legacy = True
        elif result != MavResult.ACCEPTED:
            self._end("refused", result)
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        if now < self._until and not self._questions:
            return self._proceed(now)
        return super()._time_out(now)

    def _proceed(self, now: float) -> Sequence[Message]:
        """Ask for what may be asked for now, or end."""
        if len(self._items) == self._count:
            items = tuple(self._items[seq] for seq in range(self._count))
            self._end("accepted", None, items, self._opaque_id)
            return [self._peer.ack(MavResult.ACCEPTED, self._type)] * self._peer.manners.final_acks
        if now < self._resumes:
            return ()
        if self._count is None:
            return self._ask(OPENING, now)
        wide = self._peer.manners.any_request_order and self._questions.pace.mean is not None
        out: list[Message] = []
        while self._next_sequence < self._count and len(self._questions) < (_WINDOW if wide else 1):
            out += self._ask(self._next_sequence, now)
            self._next_sequence += 1
        return out

    def _give_up(self, now: float) -> Sequence[Message]:
        if self._attempts_left == 0:
            return super()._give_up(now)
        self._questions.least = max(2 * self._questions.least, _LATE)
        return self.start(now)
