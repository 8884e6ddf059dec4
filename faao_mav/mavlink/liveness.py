"""Whether a vehicle is there now, or only a recording of it."""

import math
from collections.abc import Sequence

from faao_mav.mavlink.machine import AskingMachine
from faao_mav.mavlink.messages import Envelope, Message, Timesync
from faao_mav.mavlink.protocol import Address


class AskAlive(AskingMachine[bool]):
    """A machine that asks for the answer to a `number` that nobody could know before.

    It asks twice a second for `patience` seconds. Its outcome is whether `vehicle` answered: on a
    link that is signed a recording cannot, and what was recorded before the answer is older than
    it, so that it is passed over from then on.

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
        super().__init__(0.5, math.ceil(patience / 0.5) - 1)
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
