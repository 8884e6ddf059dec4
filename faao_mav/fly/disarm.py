"""Disarming a vehicle that was armed, and did not start."""

from collections.abc import Collection, Sequence

from faao_mav.fly.telemetry import Ending
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import CommandAck, CommandLong, Envelope, Heartbeat, Message
from faao_mav.wire.modes import mode_name
from faao_mav.wire.protocol import MavCommand, command_result
from faao_mav.wire.transfer.exchange import Peer

_AGAIN = 1.5
"""Seconds after which it is asked again: the MAVLink guide's for missions."""

_REFUSALS = 5
"""How often it may refuse before it is left; chosen. In the air it always does."""

_ACCEPTED, _IN_PROGRESS = 0, 5
"""MAV_RESULT."""


class Disarm(Machine[Ending]):
    """A machine that asks the vehicle of `peer` to disarm until it has; then the watch ends.

    `then` is the ending of the watch, to which its own adds whether the vehicle is disarmed.
    `armed` is what its last heartbeat said. It ends too when the vehicle keeps refusing, when
    nothing is heard of it for `patience` seconds, and when it is in a mode that is none of `modes`:
    then somebody else has it, and nothing more is sent.
    """

    progress = ("disarming", 0, 0)

    def __init__(
        self,
        peer: Peer,
        then: Ending,
        armed: bool,
        modes: Collection[int | None],
        patience: float,
    ) -> None:
        super().__init__()
        self._peer, self._then, self._modes, self._patience = peer, then, modes, patience
        self._sent = self._refusals = 0
        self._agrees, self._armed = False, armed
        self._heard = 0.0

    def start(self, now: float) -> Sequence[Message]:
        """Ask."""
        self._heard = now
        return self._time_out(now)

    def _time_out(self, now: float) -> Sequence[Message]:
        if now >= self._heard + self._patience:
            self.leave(f"nothing was heard for {self._patience:.0f} s")
            return ()
        self._due = now + _AGAIN
        self._sent += 1
        return [CommandLong(self._peer.address, MavCommand.ARM, min(self._sent - 1, 255))]

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        if envelope.sender != self._peer.address:
            return ()
        self._heard = now
        match envelope.message:
            case CommandAck(target, MavCommand.ARM, result) if self._peer.own.takes(target):
                self._agrees = self._agrees or result == _ACCEPTED
                self._refusals += result not in (_ACCEPTED, _IN_PROGRESS)
                if self._refusals == _REFUSALS:
                    self.leave(f"it answers {command_result(result)}")
            # An answer may be a late one to arming, and a first heartbeat from before that.
            case Heartbeat(armed=False) if self._agrees or self._armed or self._sent > 1:
                self.outcome = Ending(self._then.kind, f"{self._then.text}; it is disarmed")
            case Heartbeat(custom_mode=mode) as beat if mode not in self._modes:
                self.leave(f"the pilot or a failsafe has it, in mode {mode_name(beat)}")
            case Heartbeat(armed=armed):
                self._armed = armed
        return ()

    def leave(self, why: str) -> None:
        """End, though it may still be armed."""
        self.outcome = Ending(self._then.kind, f"{self._then.text}; it may still be armed: {why}")
