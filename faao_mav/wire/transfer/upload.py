"""Uploading one list: MISSION_COUNT, then whatever the vehicle asks for."""

import math
from collections.abc import Sequence
from typing import Literal

from faao_mav.errors import InputError
from faao_mav.wire.machine import Progress
from faao_mav.wire.messages import (
    Heartbeat,
    ListMessage,
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    WireItem,
)
from faao_mav.wire.protocol import MavResult, MavState, MissionType
from faao_mav.wire.transfer.exchange import TENTATIVE, Exchange, Peer
from faao_mav.wire.transfer.pace import Budget, Pace, Question, Timeouts

_REASONS = 0.3
"""Seconds to wait after a refusal for the status text that gives the reason: chosen, above what
ArduPilot and PX4 took in simulation."""

_HEARTBEAT = 1.5
"""Seconds after a refusal within which a heartbeat tells whether the vehicle has rebooted: vehicles
send one a second; a rebooting ArduCopter's came 0.96 s after it had refused."""

_NOT_YET = frozenset({MavResult.NO_SPACE, MavResult.UNSUPPORTED})
"""What ArduPilot answers while it boots: before it has storage, and before it knows missions."""

_AHEAD = 3
"""Items that are sent beyond the one that was asked for, at most: chosen; each costs a packet for
each repetition."""


class Upload(Exchange):
    """A machine that uploads `items`; the vehicle leads.

    - Any item below the count is sent whenever it is asked for, by either request, as
      MISSION_ITEM_INT.
    - INVALID_SEQUENCE is no end for ArduPilot: it says so of duplicates and goes on asking. An
      ERROR may be about a duplicate too (PX4: of MISSION_COUNT, ArduPilot: of the last item), and
      DENIED about a late request of a download before: they count when nothing more is asked for.
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
    - NO_SPACE or UNSUPPORTED from an ArduPilot that boots means "not yet". UNSUPPORTED is what it
      says right after a reboot in the middle: the next heartbeat is waited for to tell.

    Raises `InputError` without items: an empty list is what `Clear` is for.
    """

    def __init__(
        self,
        items: Sequence[WireItem],
        peer: Peer,
        mission_type: MissionType = MissionType.MISSION,
        timeouts: Timeouts | None = None,
        budget: Budget | None = None,
    ) -> None:
        if not items:
            raise InputError(f"upload: no {mission_type.title} items; clear the list instead")
        # A vehicle that has heard the announcement has asked for an item, and asked again, by then.
        soon = 2 * peer.manners.request_period
        super().__init__(peer, mission_type, timeouts, budget, soon)
        self._items, self._manners = tuple(items), peer.manners
        self._phase: Literal["count", "items", "booting", "refused"] = "count"
        self._booting = False
        self._sent: set[int] = set()
        # The item asked for last, the items sent beyond it, and how many those may be.
        self._last_requested, self._ahead = -1, 0
        self._most_ahead, self._sent_unasked = _AHEAD, False
        self.pace = Pace(self._timeouts, self._manners.request_period)
        self._unanswered = Question(0.0, 0.0)
        self._last_progress = 0.0

    @property
    def progress(self) -> Progress:
        """Items sent, of all."""
        return f"uploading {self._type.title}", len(self._sent), len(self._items)

    def _question(self) -> Message:
        return MissionCount(self._peer.address, self._type, len(self._items))

    def start(self, now: float) -> Sequence[Message]:
        """Announce the items."""
        self._phase, self._sent, self._result = "count", set(), None
        self._last_requested, self._ahead, self._sent_unasked = -1, 0, False
        return super().start(now)

    def _on_heartbeat(self, heartbeat: Heartbeat, now: float) -> Sequence[Message]:
        self._booting = heartbeat.system_status < MavState.STANDBY
        if self._phase == "booting" and not self._booting:
            return self.start(now)
        if self._phase == "refused" and self._booting and self._result == MavResult.UNSUPPORTED:
            self._wait_for_boot(now)
        elif self._phase == "refused":
            self._due = min(self._due, now + _REASONS)
        return ()

    def _wait_for_boot(self, now: float) -> None:
        self._phase = "booting"
        self._budget.allow_boot()
        self._due = now + self._timeouts.boot

    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:
        match message:
            case MissionRequestInt() if self._phase != "refused":
                return self._on_request(message.seq, now)
            case MissionAck() if self._phase != "refused":
                return self._on_ack(message, now)
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        match self._phase:
            case "items":
                return self._time_out_items(now)
            case "booting" | "refused":
                return self._give_up(now)
        return super()._time_out(now)

    def _give_up(self, now: float) -> Sequence[Message]:
        if self._sent_unasked and self._result is not None:
            self._most_ahead = 0
            return self.start(now)
        return super()._give_up(now)

    def _on_request(self, seq: int, now: float) -> Sequence[Message]:
        if seq >= len(self._items):
            return ()
        self._budget.reach("upload", seq + 1)
        if seq <= self._current:
            self._unanswered.send_again(now)
        else:
            if self._last_requested >= 0:
                self.pace.answer(self._unanswered, now)
            self._unanswered = self.pace.ask(now)
        self._last_requested, self._ahead, self._sent_unasked = seq, 0, False
        self._phase, self._last_progress, self._result = "items", now, None
        self._retries_done = 0
        item = self._item(seq)
        if self._all_sent():
            self._due = now + self._reminder_wait()
        elif self._may_repeat():
            self._due = now + self.pace.wait
        else:
            self._due = now + self._timeouts.silence
        return [item]

    def _on_ack(self, ack: MissionAck, now: float) -> Sequence[Message]:
        result = ack.type
        if result == MavResult.ACCEPTED:
            # Before the last item was asked for it can only be about something else.
            if self._all_sent():
                self._end("accepted", result, opaque_id=ack.opaque_id)
        elif result == MavResult.INVALID_SEQUENCE and not self._manners.ignores_other_items:
            return self._on_invalid_sequence(now)
        elif result in TENTATIVE:
            self._result = result
            if self._phase in ("count", "items"):
                self._retries_done = max(self._retries_done, 0)  # it hears: no need to hurry
                sent = self._phase == "items" and self._all_sent()
                self._due = now + (2 * self._timeouts.item if sent else self._timeouts.response)
        elif result in _NOT_YET and self._booting:
            self._result = result
            self._wait_for_boot(now)
        elif result == MavResult.OPERATION_CANCELLED:
            self._end("cancelled", result)
        else:
            self._phase, self._result = "refused", result
            self._due = now + (_HEARTBEAT if result == MavResult.UNSUPPORTED else _REASONS)
        return ()

    def _on_invalid_sequence(self, now: float) -> Sequence[Message]:
        if self._all_sent() and self._retries_done > 0:
            return [self._item(len(self._items) - 1)]
        if self._unanswered.repeats == 0:
            self.pace.answer_again()
            return ()
        if self._ahead == self._room():
            return ()
        self.pace.answer(self._unanswered, now)
        self._unanswered = self.pace.ask(now)
        self._ahead += 1
        self._last_progress, self._due = now, now + self.pace.wait
        return [self._item(self._current)]

    def _time_out_items(self, now: float) -> Sequence[Message]:
        if not self._all_sent():
            quiet = now - self._last_progress >= self._timeouts.silence
            if self._may_repeat() and not quiet and self._result is None:
                self.pace.repeat(self._unanswered, now)
                self._due = now + self.pace.wait
                return self._repetition()
            cancel = self._peer.ack(MavResult.OPERATION_CANCELLED, self._type)
            return [cancel, *self._give_up(now)]
        reminder, retries = self._reminder(), self._timeouts.retries
        if reminder is not None and self._retries_done < retries and self._result is None:
            self._retries_done += 1
            self._due = now + self._reminder_wait()
            return [self._item(reminder)]
        self._end("unknown", self._result)
        return ()

    def _repetition(self) -> Sequence[Message]:
        """Return what is sent when the next request does not come."""
        last = self._current
        if self._manners.ignores_other_items:
            last += min(self._unanswered.repeats, self._room())
            self._sent_unasked = self._sent_unasked or last > self._current
        return [self._item(seq) for seq in range(last, self._current - 1, -1)]

    @property
    def _current(self) -> int:
        """The item that the vehicle waits for, as far as is known: the last one sent in turn."""
        return self._last_requested + self._ahead

    def _all_sent(self) -> bool:
        return len(self._sent) == len(self._items)

    @property
    def _reached(self) -> int | None:
        return self._current if self._sent else None

    def _may_repeat(self) -> bool:
        """Tell whether silence of this vehicle tells that something was lost."""
        is_last = self._last_requested == len(self._items) - 1
        return math.isfinite(self._manners.request_period) and not is_last

    def _room(self) -> int:
        """Return how many items may be sent beyond the one that was asked for."""
        return max(min(self._most_ahead, len(self._items) - 2 - self._last_requested), 0)

    def _reminder(self) -> int | None:
        """Return the item to send again when the last acknowledgement is missing."""
        reminder = self._manners.reminder
        return (
            None
            if reminder is None or -reminder > len(self._items)
            else (len(self._items) + reminder)
        )

    def _reminder_wait(self) -> float:
        """Return how long to wait for the last acknowledgement, before and after a reminder, s."""
        if self._reminder() is None:
            return 2 * self._timeouts.response
        first = max(self._timeouts.item, self.pace.wait)
        return min(first * 2.0 ** max(self._retries_done - 1, 0), self._timeouts.response)

    def _item(self, seq: int) -> Message:
        self._sent.add(seq)
        return MissionItemInt(self._peer.address, self._type, seq, self._items[seq])
