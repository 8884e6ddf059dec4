"""What a vehicle is asked: for one of its messages, and whether it is there now."""

from collections.abc import Sequence
from typing import Generic, TypeVar

from faao_mav.wire.machine import AskingMachine, Progress
from faao_mav.wire.messages import CommandLong, Envelope, Message, Timesync
from faao_mav.wire.protocol import Address, MavCommand

M = TypeVar("M", bound=Message)


class AskFor(AskingMachine[list[M]], Generic[M]):
    """A machine that asks `vehicle` for its message of the type `kind`, whose number is `number`.

    Its outcome is a list with the first that comes, asked for or not, or empty.
    """

    def __init__(self, vehicle: Address, number: int, kind: type[M], patience: float = 3.0) -> None:
        super().__init__(patience)
        self._vehicle, self._number, self._kind = vehicle, number, kind

    @property
    def progress(self) -> Progress:
        """Not counted."""
        return f"asking for {self._kind.__name__}", 0, 0

    def _question(self) -> Message:
        return CommandLong(self._vehicle, MavCommand.REQUEST_MESSAGE, 0, float(self._number))

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:  # noqa: ARG002
        message = envelope.message
        if isinstance(message, self._kind) and envelope.sender == self._vehicle:
            self.outcome = [message]
        return ()

    def _give_up(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        self.outcome = []
        return ()

    def cancel(self, now: float) -> Sequence[Message]:
        """Do without."""
        return self._give_up(now)


class AskAlive(AskingMachine[bool]):
    """A machine that asks for the answer to a `number` that nobody could know before.

    It asks for `patience` seconds. Its outcome is whether `vehicle` answered, which
    one that reads MAVLink 1 alone does not: on a link that is signed a recording cannot, and what
    was recorded before the answer is older than it, so that it is passed over from then on.

    >>> vehicle = Address(1, 1)
    >>> asking = AskAlive(vehicle, number=77)
    >>> asking.start(now=0.0)
    [Timesync(tc1=0, ts1=77)]
    >>> asking.on(Envelope(vehicle, Timesync(123_456, 77)), now=0.1)
    ()
    >>> asking.outcome
    True
    """

    progress = ("asking for a sign of life", 0, 0)

    def __init__(self, vehicle: Address, number: int, patience: float = 9.0) -> None:
        super().__init__(patience)
        self._vehicle, self._number = vehicle, number

    def _question(self) -> Message:
        return Timesync(0, self._number)

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:  # noqa: ARG002
        message = envelope.message
        if isinstance(message, Timesync) and envelope.sender == self._vehicle:
            self.outcome = (message.tc1 != 0 and message.ts1 == self._number) or None
        return ()

    def _give_up(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        self.outcome = False
        return ()
