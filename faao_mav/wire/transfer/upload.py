"""Uploading one list: MISSION_COUNT, then whatever the vehicle asks for."""

import math
from collections.abc import Sequence

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
from faao_mav.wire.transfer.exchange import OPENING, TENTATIVE, Exchange, Peer

_REASONS = 1.5
"""Seconds to wait after a refusal for the status text that gives the reason, and for a heartbeat,
which tells whether the vehicle has rebooted: vehicles send one a second; a rebooting ArduCopter's
came 0.96 s after it had refused."""

_AHEAD = 3
"""How many items beyond the one that it asked for ArduPilot is sent, at most: chosen."""

_NOT_YET = frozenset({MavResult.NO_SPACE, MavResult.UNSUPPORTED})
"""What ArduPilot answers while it boots: before it has storage, and before it knows missions."""


class Upload(Exchange):
    """A machine that uploads `items`; the vehicle leads.

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

    Raises `InputError` without items: an empty list is what `Clear` is for.
    """

    def __init__(
        self,
        items: Sequence[WireItem],
        peer: Peer,
        mission_type: MissionType = MissionType.MISSION,
    ) -> None:
        if not items:
            raise InputError(f"upload: no {mission_type.title} items; clear the list instead")
        super().__init__(peer, mission_type)
        self._items = tuple(items)
        self._current = self._requested = self._furthest = OPENING
        """The item that the vehicle waits for, as far as is known, the one that it asked for last,
        and the furthest one."""
        self._pairs, self._paired = peer.manners.ignores_other_items, False
        """Whether the next item may be sent with the current one, and whether it was."""
        self._refused = self._booting = False
        self._boots_until = math.inf

    @property
    def progress(self) -> Progress:
        """Items sent, of all."""
        return f"uploading {self._type.title}", self._furthest + 1, len(self._items)

    @property
    def _reached(self) -> int | None:
        return None if self._current == OPENING else self._current

    @property
    def _all_sent(self) -> bool:
        return self._furthest == len(self._items) - 1

    def _message(self, key: int) -> Message:
        if key == OPENING:
            return MissionCount(self._peer.address, self._type, len(self._items))
        return MissionItemInt(self._peer.address, self._type, key, self._items[key])

    def start(self, now: float) -> Sequence[Message]:
        """Announce the items."""
        self._current = self._requested = self._furthest = OPENING
        self._refused = self._paired = False
        return super().start(now)

    def _on_heartbeat(self, heartbeat: Heartbeat, now: float) -> Sequence[Message]:
        self._booting = heartbeat.system_status < MavState.STANDBY
        if self._refused and self._result in _NOT_YET:
            if self._booting:
                self._wait_for_boot(now)
            elif self._boots_until < math.inf:
                return self.start(now)
        return ()

    def _wait_for_boot(self, now: float) -> None:
        self._boots_until = min(self._boots_until, now + self._timeouts.boot)
        self._until = self._boots_until

    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:
        match message:
            case _ if self._refused:
                return ()
            case MissionRequestInt(seq=seq) if seq < len(self._items):
                return self._on_request(seq, now)
            case MissionAck(type=MavResult.ACCEPTED, opaque_id=opaque_id):
                # Before the last item was asked for it can only be about something else.
                if self._all_sent:
                    self._end("accepted", MavResult.ACCEPTED, opaque_id=opaque_id)
            case MissionAck(type=result):
                return self._on_refusal(result, now)
        return ()

    def _on_request(self, seq: int, now: float) -> Sequence[Message]:
        if seq > self._current:
            self._answered(now)
        elif seq < self._current:
            self._questions.clear()
        if seq > self._furthest:
            self._get_further(now)
        self._current = self._requested = seq
        self._furthest, self._result = max(self._furthest, seq), None
        return self._send(now)

    def _answered(self, now: float) -> None:
        """Note that the vehicle has what it was sent last."""
        if self._current in self._questions:
            self._questions.answer(self._current, now)

    def _send(self, now: float) -> Sequence[Message]:
        """Send the current item, again where silence of this vehicle tells that it was lost."""
        self._paired = False
        if math.isfinite(self._peer.manners.request_period):
            return self._ask(self._current, now)
        return [self._message(self._current)]

    def _on_refusal(self, result: int, now: float) -> Sequence[Message]:
        if result == MavResult.INVALID_SEQUENCE and not self._peer.manners.ignores_other_items:
            room = min(self._requested + _AHEAD, len(self._items) - 2) - self._current
            if self._questions.times(self._current) > 1 and room > 0:
                self._answered(now)
                self._current += 1
                return self._send(now)
        elif result in TENTATIVE:
            self._doubt(result, now)
            if self._current != OPENING:
                self._questions.clear()
        elif result == MavResult.OPERATION_CANCELLED:
            self._end("cancelled", result)
        else:
            self._questions.clear()
            self._refused, self._result, self._until = True, result, now + _REASONS
            if self._booting and result in _NOT_YET:
                self._wait_for_boot(now)
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        again, following = super()._time_out(now), self._current + 1
        if not again or self.outcome is not None or not 0 < following < len(self._items) - 1:
            return again
        self._paired = self._pairs
        return [self._message(following), *again] if self._pairs else again

    def _give_up(self, now: float) -> Sequence[Message]:
        if self._paired and self._result is not None:
            self._pairs = False
            return self.start(now)
        if self._all_sent and not self._refused:
            self._end("unknown", self._result)
            return ()
        return super()._give_up(now)
