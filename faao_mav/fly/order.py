"""An order to a vehicle, which is given again until it is carried out."""

from dataclasses import dataclass

from faao_mav.wire.messages import CommandLong
from faao_mav.wire.protocol import Address, MavCommand

AGAIN, TRIES = 1.5, 5
"""Seconds after which an order that is not carried out is repeated, and how often: as the MAVLink
guide has it for missions."""

ACCEPTED, IN_PROGRESS = 0, 5
"""MAV_RESULT."""


@dataclass(slots=True)
class Order:
    """A command that is repeated until it is carried out.

    `due` is when it is sent next, s; `answer` is what became of it, in words.
    """

    command: MavCommand
    params: tuple[float, ...]
    due: float
    sent: int = 0
    refusals: int = 0
    answer: str = "does not answer"

    def given(self, target: Address, now: float) -> CommandLong:
        """Return it for `target`, once more."""
        again = min(self.sent, 255)
        self.sent, self.due = self.sent + 1, now + AGAIN
        return CommandLong(target, self.command, again, *self.params)
