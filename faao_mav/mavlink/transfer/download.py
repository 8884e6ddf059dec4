"""Downloading one list: MISSION_REQUEST_LIST, then its rows."""

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
from faao_mav.mavlink.transfer.pace import Pace, Question, Timeouts
from faao_mav.mavlink.transfer.protocol import MissionType, Result
from faao_mav.mavlink.transfer.transfer import Exchange, Outcome, Peer, Status

_WINDOW = 5  # rows


class Download(Exchange):
    """A machine that downloads a list and acknowledges it.

    - PX4 gives the row that it expects to be asked for, or the one before, and ends the transfer
      at any other request (`handle_mission_request_both`): it is asked for one row at a time, and
      so are autopilots that are not known. ArduPilot answers each request by itself
      (`handle_mission_request_int`): like MAVProxy, this asks it for up to five rows at once,
      unless the link is not known yet or may have become slow.
    - A row is asked for again after the time that `Pace` gives, or at once when a later request
      has been answered: links rarely change the order (as in RFC 8985, until one does).
    - After `Timeouts.silence`, or an error (which may be about a duplicate, and makes PX4 forget
      the transfer), it begins anew, `Timeouts.attempts` times. UNSUPPORTED changes to
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
        self._phase: Literal["list", "items", "resting"] = "list"
        self._legacy = False
        self._rows: dict[int, Row] = {}
        self._asked: dict[int, Question] = {}
        self._presumed_lost: set[int] = set()
        self._in_order = True
        self._next = 0
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
        self._phase = "list"
        self._attempts -= 1
        self._left = self._timeouts.retries
        return self._ask_list(now)

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take the count or a row, ask for more."""
        if self.outcome is not None:
            return ()
        self._texts.note(envelope)
        if self._phase == "resting" or not self._peer.said(envelope, self._type):
            return ()
        match envelope.message:
            case MissionCount(count=count, opaque_id=opaque_id):
                return self._on_count(count, opaque_id, now)
            case MissionItemInt(seq=seq, row=row) if self._phase == "items":
                return self._on_item(seq, row, now)
            case MissionAck(type=result):
                return self._on_ack(result, now)
        return ()

    def tick(self, now: float) -> Sequence[Message]:
        """Ask again, begin anew, or end."""
        if self.outcome is not None or now < self._due:
            return ()
        if self._phase == "resting":
            return self.start(now)
        if self._phase == "list":
            if self._left == 0:
                return self._again(now)
            self._left -= 1
            return self._ask_list(now)
        if now - self._heard >= self._timeouts.silence:
            return self._again(now)
        return self._repeat(now)

    def _on_count(self, count: int, opaque_id: int, now: float) -> Sequence[Message]:
        if self._phase == "items":
            # A repeated answer; another number means that the list has changed meanwhile.
            return () if count == self._count else self._again(now)
        self._phase, self._count, self._opaque_id = "items", count, opaque_id
        self._rows, self._asked, self._next = {}, {}, 0
        return self._proceed(now)

    def _on_item(self, seq: int, row: Row, now: float) -> Sequence[Message]:
        if seq in self._rows:
            self._pace.answer_again()
            self._in_order = self._in_order and seq not in self._presumed_lost
        if seq not in self._asked:
            return ()
        earlier = list(self._asked)[: list(self._asked).index(seq)] if self._in_order else []
        self._presumed_lost.update(earlier)
        self._pace.answer(self._asked.pop(seq), now)
        self._rows[seq] = row
        return [*(self._put_again(lost, now) for lost in earlier), *self._proceed(now)]

    def _on_ack(self, result: int, now: float) -> Sequence[Message]:
        if result == Result.ACCEPTED:
            return ()
        if result == Result.UNSUPPORTED and self._phase == "items" and not self._legacy:
            self._legacy = True
            return [self._put_again(seq, now) for seq in list(self._asked)]
        self._refusal = result
        if self._attempts == 0:
            self._end("refused")
            return ()
        # Not at once: more may be on the way that is about the same.
        self._phase, self._due = "resting", now + self._timeouts.item
        return ()

    def _proceed(self, now: float) -> Sequence[Message]:
        self._refusal = None
        self._heard = now
        if len(self._rows) == self._count:
            self._end("accepted")
            # Twice for PX4: until it hears this, nobody else can begin a transfer for 5 s.
            times = 2 if self._peer.firmware == "px4" else 1
            return [self._peer.ack(Result.ACCEPTED, self._type)] * times
        wide = self._peer.firmware == "ardupilot" and not self._pace.is_doubtful
        out = []
        while self._next < self._count and len(self._asked) < (_WINDOW if wide else 1):
            self._asked[self._next] = self._pace.ask(now)
            out.append(self._request(self._next))
            self._next += 1
        self._schedule()
        return out

    def _repeat(self, now: float) -> Sequence[Message]:
        """Ask again for what is due; for one of them less often from now on."""
        due = [seq for seq, asked in self._asked.items() if asked.put + self._pace.wait <= now]
        if due:
            self._pace.repeat(self._asked[due[0]], now)
        out = [self._put_again(seq, now) for seq in due]
        self._schedule()
        return out

    def _put_again(self, seq: int, now: float) -> Message:
        self._asked[seq] = self._asked.pop(seq)
        self._asked[seq].put_again(now)
        self._schedule()
        return self._request(seq)

    def _schedule(self) -> None:
        self._due = min(asked.put for asked in self._asked.values()) + self._pace.wait

    def _again(self, now: float) -> Sequence[Message]:
        if self._attempts == 0:
            self._end("silent" if self._refusal is None else "refused")
            return [self._peer.ack(Result.OPERATION_CANCELLED, self._type)]
        return self.start(now)

    def _ask_list(self, now: float) -> Sequence[Message]:
        self._due = now + self._timeouts.response
        vehicle = self._peer.vehicle
        return [MissionRequestList(vehicle.system, vehicle.component, self._type)]

    def _request(self, seq: int) -> Message:
        target = (self._peer.vehicle.system, self._peer.vehicle.component)
        return MissionRequestInt(*target, seq, self._type, self._legacy)

    def _end(self, status: Status) -> None:
        whole = status == "accepted"
        rows = tuple(self._rows[seq] for seq in range(self._count)) if whole else ()
        said = self._texts.all()
        self.outcome = Outcome(status, self._refusal, len(self._rows), rows, said, self._opaque_id)
