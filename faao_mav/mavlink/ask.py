"""Asking a vehicle for one message, and the places that its messages tell."""

from collections.abc import Sequence
from typing import Generic, TypeVar

from faao_mav.errors import InputError
from faao_mav.mavlink.machine import AskingMachine, Progress
from faao_mav.mavlink.messages import (
    CommandLong,
    Envelope,
    GlobalPositionInt,
    HomePosition,
    Message,
)
from faao_mav.mavlink.protocol import Address, MavCommand
from faao_mav.mission.item import Home

M = TypeVar("M", bound=Message)


class AskFor(AskingMachine[list[M]], Generic[M]):
    """A machine that asks `vehicle` for its message of the type `kind`, whose number is `number`.

    Its outcome is a list with the first that comes, asked for or not, or empty.
    """

    def __init__(
        self, vehicle: Address, number: int, kind: type[M], wait: float = 1.0, retries: int = 2
    ) -> None:
        super().__init__(wait, retries)
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


def place_in(message: GlobalPositionInt | HomePosition) -> Home | None:
    """Return the place that `message` tells, metres above mean sea level; None: it tells none.

    ArduPilot tells 0, 0 as long as it does not know where it is.
    """
    match message:
        case GlobalPositionInt(lat=latitude, lon=longitude, alt=altitude):
            pass
        case HomePosition(latitude, longitude, altitude):
            pass
    try:
        place = Home(latitude / 1e7, longitude / 1e7, altitude / 1000)
    except InputError:
        return None
    return place if latitude or longitude else None
