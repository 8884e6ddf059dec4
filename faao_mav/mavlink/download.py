"""Downloading one list: MISSION_REQUEST_LIST, then row by row."""

from collections.abc import Sequence
from typing import Literal

from faao_mav.mavlink.messages import (
    Envelope,
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    Row,
)
from faao_mav.mavlink.pace import Pace, Timeouts
from faao_mav.mavlink.protocol import MissionType, Result
from faao_mav.mavlink.transfer import Exchange, Outcome, Peer, Status


class Download(Exchange):
    """A machine that downloads a list, one row at a time, and acknowledges it.

    A row is asked for again after `Timeouts.item`, or later on a link that is known to be slow.
    After `Timeouts.silence`, or an error (which may be about a duplicate, and makes
    PX4 forget the transfer), it begins anew, `Timeouts.attempts` times. UNSUPPORTED changes to
    MISSION_REQUEST, once.
    """

    def __init__(
        self,
        peer: Peer,
        mission_type: MissionType = MissionType.MISSION,
        timeouts: Timeouts | None = None,
    ) -> None:
        super().__init__(peer, mission_type, timeouts)
        self._attempts = self._timeouts.attempts
        self._phase: Literal["list", "items"] = "list"
        self._legacy = False
        self._rows: list[Row] = []
        self._count = 0
        self._opaque_id = 0
        self._pace = Pace(self._timeouts)
        self._heard = 0.0
        self._left = 0
        self._refusal: int | None = None

    @property
    def progress(self) -> tuple[str, int, int]:
        """Rows received, of all."""
        return f"reading {self._type.title}", len(self._rows), self._count

    def start(self, now: float) -> Sequence[Message]:
        """Ask for the list."""
        self._phase, self._rows = "list", []
        self._attempts -= 1
        self._left = self._timeouts.retries
        return self._ask_list(now)

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take the count or a row, ask for the next."""
        if self.outcome is not None:
            return ()
        self._texts.note(envelope)
        if not self._peer.said(envelope, self._type):
            return ()
        match envelope.message:
            case MissionCount(count=count, opaque_id=opaque_id):
                return self._on_count(count, opaque_id, now)
            case MissionItemInt(seq=seq, row=row):
                return self._on_item(seq, row, now)
            case MissionAck(type=result):
                return self._on_ack(result, now)
        return ()

    def tick(self, now: float) -> Sequence[Message]:
        """Ask again, begin anew, or end."""
        if self.outcome is not None or now < self._due:
            return ()
        if self._phase == "list":
            if self._left == 0:
                return self._again(now)
            self._left -= 1
            return self._ask_list(now)
        if now - self._heard >= self._timeouts.silence:
            return self._again(now)
        self._pace.repeat()
        return self._ask_row(now)

    def _on_count(self, count: int, opaque_id: int, now: float) -> Sequence[Message]:
        if self._phase == "items":
            # A repeated answer; another number means that the list has changed meanwhile.
            return () if count == self._count else self._again(now)
        self._phase, self._count, self._opaque_id = "items", count, opaque_id
        return self._next(now)

    def _on_item(self, seq: int, row: Row, now: float) -> Sequence[Message]:
        if self._phase != "items" or seq != len(self._rows):
            if self._phase == "items" and seq == len(self._rows) - 1:
                self._pace.answer_again()
            return ()
        self._rows.append(row)
        self._pace.answer(now)
        return self._next(now)

    def _on_ack(self, result: int, now: float) -> Sequence[Message]:
        if result == Result.ACCEPTED:
            return ()
        if result == Result.UNSUPPORTED and self._phase == "items" and not self._legacy:
            self._legacy = True
            return self._ask_row(now)
        self._refusal = result
        if self._attempts == 0:
            self._end("refused")
            return ()
        # Not at once: more may be on the way that is about the same.
        self._phase, self._rows, self._left = "list", [], self._timeouts.retries
        self._attempts -= 1
        self._due = now + self._timeouts.item
        return ()

    def _next(self, now: float) -> Sequence[Message]:
        self._refusal = None
        self._heard = now
        if len(self._rows) < self._count:
            self._pace.ask(now)
            return self._ask_row(now)
        self._end("accepted")
        # Twice for PX4: until it hears this, nobody else can begin a transfer for 5 s.
        times = 2 if self._peer.firmware == "px4" else 1
        return [self._peer.ack(Result.ACCEPTED, self._type)] * times

    def _again(self, now: float) -> Sequence[Message]:
        if self._attempts == 0:
            self._end("silent" if self._refusal is None else "refused")
            return [self._peer.ack(Result.OPERATION_CANCELLED, self._type)]
        return self.start(now)

    def _ask_list(self, now: float) -> Sequence[Message]:
        self._due = now + self._timeouts.response
        vehicle = self._peer.vehicle
        return [MissionRequestList(vehicle.system, vehicle.component, self._type)]

    def _ask_row(self, now: float) -> Sequence[Message]:
        self._due = now + self._pace.wait
        vehicle, seq = self._peer.vehicle, len(self._rows)
        target = (vehicle.system, vehicle.component)
        return [MissionRequestInt(*target, seq, self._type, self._legacy)]

    def _end(self, status: Status) -> None:
        rows = tuple(self._rows) if status == "accepted" else ()
        said, seq = self._texts.all(), len(self._rows)
        self.outcome = Outcome(status, self._refusal, seq, rows, said, self._opaque_id)
