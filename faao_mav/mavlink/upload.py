"""Uploading one list: MISSION_COUNT, then whatever the vehicle asks for."""

from collections.abc import Sequence
from typing import Literal

from faao_mav.errors import InputError
from faao_mav.mavlink.messages import (
    Envelope,
    Heartbeat,
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    Row,
)
from faao_mav.mavlink.protocol import MissionType, Result, State
from faao_mav.mavlink.transfer import Outcome, Peer, Status, Texts, Timeouts


class Upload:
    """A machine that uploads `rows`; the vehicle leads, and is never hurried along.

    - Any row below the count is sent whenever it is asked for, by either request, as
      MISSION_ITEM_INT.
    - INVALID_SEQUENCE is no end for ArduPilot: it says so of duplicates and goes on asking. An
      ERROR may be about a duplicate too (PX4: of MISSION_COUNT, ArduPilot: of the last item): it
      counts when nothing more is asked for.
    - When everything was sent and no answer comes, PX4 is sent the last item again, which it
      acknowledges again. ArduPilot would say ERROR: the outcome is "unknown", and reading back
      must tell.
    - NO_SPACE from an ArduPilot that is still booting means "not yet".

    Raises `InputError` without rows: an empty list is what `Clear` is for.
    """

    def __init__(
        self,
        rows: Sequence[Row],
        peer: Peer,
        mission_type: MissionType = MissionType.MISSION,
        timeouts: Timeouts | None = None,
    ) -> None:
        if not rows:
            raise InputError(f"upload: no {mission_type.title} items; clear the list instead")
        self.outcome: Outcome | None = None
        self._rows, self._peer, self._type = tuple(rows), peer, mission_type
        self._timeouts = timeouts or Timeouts()
        self._texts = Texts(peer.vehicle)
        self._phase: Literal["count", "items", "booting"] = "count"
        self._due = 0.0
        self._left = 0
        self._asked: set[int] = set()
        self._last: int | None = None
        self._booting = False
        self._doubt: int | None = None

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self.outcome else self._due

    @property
    def progress(self) -> tuple[str, int, int]:
        """Rows asked for, of all."""
        return f"uploading {self._type.title}", len(self._asked), len(self._rows)

    def start(self, now: float) -> Sequence[Message]:
        """Announce the rows."""
        self._phase, self._asked, self._doubt = "count", set(), None
        self._left = self._timeouts.retries
        return self._announce(now)

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Give up and tell the vehicle."""
        if self.outcome is not None:
            return ()
        self._end("cancelled")
        return [self._peer.ack(Result.OPERATION_CANCELLED, self._type)]

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Answer a request, take an acknowledgement."""
        if self.outcome is not None:
            return ()
        self._texts.note(envelope)
        match envelope.message:
            case Heartbeat() as heartbeat if envelope.sender == self._peer.vehicle:
                return self._on_heartbeat(heartbeat, now)
            case MissionRequestInt(seq=seq) if self._peer.said(envelope, self._type):
                return self._on_request(seq, now)
            case MissionAck() as ack if self._peer.said(envelope, self._type):
                self._on_ack(ack, now)
        return ()

    def tick(self, now: float) -> Sequence[Message]:
        """Send again, wait on, or end."""
        if self.outcome is not None or now < self._due:
            return ()
        if self._phase == "items":
            return self._tick_items(now)
        if self._phase == "booting" or self._left == 0:
            self._end("silent" if self._doubt is None else "refused", self._doubt)
            return ()
        self._left -= 1
        return self._announce(now)

    def _on_heartbeat(self, heartbeat: Heartbeat, now: float) -> Sequence[Message]:
        self._booting = heartbeat.system_status < State.STANDBY
        if self._phase == "booting" and not self._booting:
            return self.start(now)
        return ()

    def _on_request(self, seq: int, now: float) -> Sequence[Message]:
        if seq >= len(self._rows):
            return ()
        self._phase = "items"
        self._asked.add(seq)
        self._last, self._doubt = seq, None
        self._left = self._timeouts.retries
        self._due = now + (self._patience() if self._complete() else self._timeouts.silence)
        return [self._item(seq)]

    def _on_ack(self, ack: MissionAck, now: float) -> None:
        result = ack.type
        if result == Result.ACCEPTED:
            # Before the last row was asked for it can only be about something else.
            if self._complete():
                self._end("accepted", result, ack.opaque_id)
        elif result == Result.INVALID_SEQUENCE and self._peer.firmware != "px4":
            pass
        elif result == Result.ERROR:
            self._doubt = result
            if self._phase == "items":
                self._due = now + self._timeouts.response
        elif result == Result.NO_SPACE and self._booting:
            self._phase, self._doubt = "booting", result
            self._due = now + self._timeouts.boot
        elif result == Result.OPERATION_CANCELLED:
            self._end("cancelled", result)
        else:
            self._end("refused", result)

    def _tick_items(self, now: float) -> Sequence[Message]:
        if not self._complete():
            self._end("silent" if self._doubt is None else "refused", self._doubt)
            return [self._peer.ack(Result.OPERATION_CANCELLED, self._type)]
        if self._peer.firmware == "px4" and self._left > 0 and self._doubt is None:
            self._left -= 1
            self._due = now + self._timeouts.response
            return [self._item(len(self._rows) - 1)]
        self._end("unknown", self._doubt)
        return ()

    def _complete(self) -> bool:
        return len(self._asked) == len(self._rows)

    def _patience(self) -> float:
        """Return how long to wait for the last answer: ArduPilot asks again after 1 s or more."""
        return self._timeouts.response * (1 if self._peer.firmware == "px4" else 2)

    def _announce(self, now: float) -> Sequence[Message]:
        self._due = now + self._timeouts.response
        vehicle = self._peer.vehicle
        return [MissionCount(vehicle.system, vehicle.component, len(self._rows), self._type)]

    def _item(self, seq: int) -> Message:
        vehicle = self._peer.vehicle
        return MissionItemInt(vehicle.system, vehicle.component, seq, self._type, self._rows[seq])

    def _end(self, status: Status, result: int | None = None, opaque_id: int = 0) -> None:
        said = self._texts.all()
        self.outcome = Outcome(status, result, self._last, (), said, opaque_id)
