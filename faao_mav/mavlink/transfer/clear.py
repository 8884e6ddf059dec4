"""Clearing one list."""

from collections.abc import Sequence

from faao_mav.mavlink.messages import Envelope, Message, MissionAck, MissionClearAll
from faao_mav.mavlink.transfer.pace import Timeouts
from faao_mav.mavlink.transfer.protocol import MissionType, Result
from faao_mav.mavlink.transfer.transfer import Exchange, Outcome, Peer, Status


class Clear(Exchange):
    """A machine that clears a list; asking twice does no harm, so it asks until answered.

    An ERROR is the end only if it is repeated: PX4 says nothing while busy, ArduPilot ERROR.
    """

    def __init__(
        self, peer: Peer, mission_type: MissionType, timeouts: Timeouts | None = None
    ) -> None:
        super().__init__(peer, mission_type, timeouts)
        self._left = self._timeouts.retries
        self._refusal: int | None = None

    @property
    def progress(self) -> tuple[str, int, int]:
        """Not counted."""
        return f"clearing {self._type.title}", 0, 0

    def start(self, now: float) -> Sequence[Message]:
        """Ask."""
        self._due = now + self._timeouts.response
        vehicle = self._peer.vehicle
        return [MissionClearAll(vehicle.system, vehicle.component, self._type)]

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Take the answer."""
        if self.outcome is not None:
            return ()
        self._texts.note(envelope)
        message = envelope.message
        if isinstance(message, MissionAck) and self._peer.said(envelope, self._type):
            if message.type == Result.ACCEPTED:
                self._end("accepted", message.type)
            elif message.type == Result.ERROR and self._refusal is None:
                self._refusal = message.type
            else:
                self._end("refused", message.type)
        return ()

    def tick(self, now: float) -> Sequence[Message]:
        """Ask again, or end."""
        if self.outcome is not None or now < self._due:
            return ()
        if self._left == 0:
            self._end("silent" if self._refusal is None else "refused", self._refusal)
            return ()
        self._left -= 1
        return self.start(now)

    def _end(self, status: Status, result: int | None) -> None:
        self.outcome = Outcome(status, result, None, (), self._texts.all())
