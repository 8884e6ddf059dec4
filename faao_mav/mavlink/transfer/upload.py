"""Uploading one list: MISSION_COUNT, then whatever the vehicle asks for."""

import math
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
from faao_mav.mavlink.transfer.pace import Pace, Question, Timeouts
from faao_mav.mavlink.transfer.protocol import Firmware, MissionType, Result, State
from faao_mav.mavlink.transfer.transfer import Exchange, Outcome, Peer, Status

_REASONS = 0.3  # s: a vehicle that refuses says why a little later
_AHEAD = 3  # items beyond the one that was asked for
_INSISTS: dict[Firmware, float] = {"px4": 0.25, "ardupilot": 1.0}
"""How long after its last request a vehicle asks again, s."""


class Upload(Exchange):
    """A machine that uploads `rows`; the vehicle leads.

    - Any row below the count is sent whenever it is asked for, by either request, as
      MISSION_ITEM_INT.
    - INVALID_SEQUENCE is no end for ArduPilot: it says so of duplicates and goes on asking. An
      ERROR may be about a duplicate too (PX4: of MISSION_COUNT, ArduPilot: of the last item): it
      counts when nothing more is asked for.
    - When everything was sent and no answer comes, PX4 is sent the last item again, which it
      takes, or acknowledges again. ArduPilot is sent the item before: if it still waits for the
      last one it says INVALID_SEQUENCE, and is sent that; ERROR says that it does not wait any
      more (`GCS_MAVLINK::handle_mission_item`): the outcome is "unknown", and reading back must
      tell. So it is if nothing comes at all.
    - PX4 asks again after 0.25 s, ArduPilot after 1 s. Silence before that means that the item or
      the request for the next one was lost. PX4 takes what it expects and passes over any other
      item without a word (`handle_mission_item_both`): it is sent the next item, and after it the
      same again, of which it takes one, whatever was lost; each further time one more, for what
      it has taken meanwhile. If an item is refused then, it is not known which: the upload begins
      anew without going ahead. ArduPilot says INVALID_SEQUENCE and goes on waiting
      (`MissionItemProtocol::handle_mission_item`): it is sent the same again, and if it says so
      the next one. Neither is sent more than three items ahead, and never the last one unasked:
      that it is asked for shows that the vehicle has the others. Other autopilots lead alone.
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
        super().__init__(peer, mission_type, timeouts)
        self._rows = tuple(rows)
        self._phase: Literal["count", "items", "booting", "refused"] = "count"
        self._left = 0
        self._sent: set[int] = set()
        self._heard = 0.0
        self._pace = Pace(self._timeouts, _INSISTS.get(peer.firmware, math.inf))
        self._question = Question(0.0, 0.0)
        self._asked_for, self._ahead = -1, 0
        self._most_ahead, self._guessing = _AHEAD, False
        self._booting = False
        self._doubt: int | None = None

    @property
    def progress(self) -> tuple[str, int, int]:
        """Rows sent, of all."""
        return f"uploading {self._type.title}", len(self._sent), len(self._rows)

    def start(self, now: float) -> Sequence[Message]:
        """Announce the rows."""
        self._phase, self._sent, self._doubt = "count", set(), None
        self._asked_for, self._ahead, self._guessing = -1, 0, False
        self._left = self._timeouts.retries
        return self._announce(now)

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Answer a request, take an acknowledgement."""
        if self.outcome is not None:
            return ()
        self._texts.note(envelope)
        if self._phase == "refused":
            return ()
        match envelope.message:
            case Heartbeat() as heartbeat if envelope.sender == self._peer.vehicle:
                return self._on_heartbeat(heartbeat, now)
            case MissionRequestInt(seq=seq) if self._peer.said(envelope, self._type):
                return self._on_request(seq, now)
            case MissionAck() as ack if self._peer.said(envelope, self._type):
                return self._on_ack(ack, now)
        return ()

    def tick(self, now: float) -> Sequence[Message]:
        """Send again, wait on, or end."""
        if self.outcome is not None or now < self._due:
            return ()
        if self._phase == "items":
            return self._tick_items(now)
        if self._phase in ("booting", "refused") or self._left == 0:
            return self._give_up(now)
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
        if seq <= self._current:
            self._question.put_again(now)
        else:
            if self._asked_for >= 0:
                self._pace.answer(self._question, now)
            self._question = self._pace.ask(now)
        self._asked_for, self._ahead, self._guessing = seq, 0, False
        self._phase, self._heard, self._doubt = "items", now, None
        self._left = self._timeouts.retries
        item = self._item(seq)
        if self._complete():
            self._due = now + self._patience()
        elif self._repeats():
            self._due = now + self._pace.wait
        else:
            self._due = now + self._timeouts.silence
        return [item]

    def _on_ack(self, ack: MissionAck, now: float) -> Sequence[Message]:
        result = ack.type
        if result == Result.ACCEPTED:
            # Before the last row was asked for it can only be about something else.
            if self._complete():
                self._end("accepted", result, ack.opaque_id)
        elif result == Result.INVALID_SEQUENCE and self._peer.firmware != "px4":
            return self._on_out_of_turn(now)
        elif result == Result.ERROR:
            self._doubt = result
            if self._phase == "items":
                soon = 2 * self._timeouts.item
                self._due = now + (soon if self._complete() else self._timeouts.response)
        elif result == Result.NO_SPACE and self._booting:
            self._phase, self._doubt = "booting", result
            self._due = now + self._timeouts.boot
        elif result == Result.OPERATION_CANCELLED:
            self._end("cancelled", result)
        else:
            self._phase, self._doubt = "refused", result
            self._due = now + _REASONS
        return ()

    def _on_out_of_turn(self, now: float) -> Sequence[Message]:
        if self._complete() and self._left < self._timeouts.retries:
            return [self._item(len(self._rows) - 1)]
        if self._question.repeats == 0:
            self._pace.answer_again()
            return ()
        if self._ahead == self._room():
            return ()
        self._pace.answer(self._question, now)
        self._question = self._pace.ask(now)
        self._ahead += 1
        self._heard, self._due = now, now + self._pace.wait
        return [self._item(self._current)]

    def _tick_items(self, now: float) -> Sequence[Message]:
        quiet = now - self._heard >= self._timeouts.silence
        if not self._complete() and self._repeats() and not quiet and self._doubt is None:
            self._pace.repeat(self._question, now)
            self._due = now + self._pace.wait
            return self._again()
        if not self._complete():
            cancel = self._peer.ack(Result.OPERATION_CANCELLED, self._type)
            return [cancel, *self._give_up(now)]
        reminder = self._reminder()
        if reminder is not None and self._left > 0 and self._doubt is None:
            self._left -= 1
            self._due = now + self._patience()
            return [self._item(reminder)]
        self._end("unknown", self._doubt)
        return ()

    def _again(self) -> Sequence[Message]:
        current = self._current
        if self._peer.firmware == "ardupilot":
            return [self._item(current)]
        last = current + min(self._question.repeats, self._room())
        self._guessing = self._guessing or last > current
        return [self._item(seq) for seq in range(last, current - 1, -1)]

    def _give_up(self, now: float) -> Sequence[Message]:
        if self._guessing and self._doubt is not None:
            self._most_ahead = 0
            return self.start(now)
        self._end("silent" if self._doubt is None else "refused", self._doubt)
        return ()

    @property
    def _current(self) -> int:
        return self._asked_for + self._ahead

    def _complete(self) -> bool:
        return len(self._sent) == len(self._rows)

    def _repeats(self) -> bool:
        return self._peer.firmware in _INSISTS and self._asked_for != len(self._rows) - 1

    def _room(self) -> int:
        return max(min(self._most_ahead, len(self._rows) - 2 - self._asked_for), 0)

    def _patience(self) -> float:
        """Return how long to wait for the last answer, before a reminder and after each."""
        if self._reminder() is None:
            return 2 * self._timeouts.response
        first = max(self._timeouts.item, self._pace.wait)
        return min(first * 2.0 ** (self._timeouts.retries - self._left), self._timeouts.response)

    def _reminder(self) -> int | None:
        last = len(self._rows) - 1
        return {"px4": last, "ardupilot": last - 1 if last else None}.get(self._peer.firmware)

    def _announce(self, now: float) -> Sequence[Message]:
        self._due = now + self._timeouts.response
        vehicle = self._peer.vehicle
        return [MissionCount(vehicle.system, vehicle.component, len(self._rows), self._type)]

    def _item(self, seq: int) -> Message:
        self._sent.add(seq)
        vehicle = self._peer.vehicle
        return MissionItemInt(vehicle.system, vehicle.component, seq, self._type, self._rows[seq])

    def _end(self, status: Status, result: int | None = None, opaque_id: int = 0) -> None:
        said = self._texts.all()
        last = self._current if self._sent else None
        self.outcome = Outcome(status, result, last, (), said, opaque_id)
