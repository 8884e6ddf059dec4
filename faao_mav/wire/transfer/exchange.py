"""What the transfers of one list have in common, and the simplest of them: clearing it."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from faao_mav.autopilot import VehicleType
from faao_mav.autopilot.manners import Manners
from faao_mav.wire.machine import AskingMachine, Progress
from faao_mav.wire.messages import (
    Envelope,
    Heartbeat,
    ListMessage,
    Message,
    MissionAck,
    MissionClearAll,
    Statustext,
    WireItem,
)
from faao_mav.wire.protocol import Address, MavResult, MissionType
from faao_mav.wire.transfer.pace import Budget, Timeouts

Status: TypeAlias = Literal[
    "accepted", "unknown", "refused", "silent", "stalled", "armed", "cancelled"
]

TENTATIVE = frozenset({MavResult.ERROR, MavResult.DENIED})
"""Results that PX4 and ArduPilot also give to late packets of an earlier transfer: they count when
nothing else is said."""

_TEXTS = 5
"""The number of status texts that are kept, the last ones; chosen."""


@dataclass(frozen=True, slots=True)
class Peer:
    """Both ends of a transfer, and what flies at the other: None if its autopilot is not known.

    Unless it `may_be_armed`, nothing more is written once a heartbeat of it says that it is armed.
    """

    own: Address
    address: Address
    vehicle: VehicleType | None
    may_be_armed: bool = False

    @property
    def manners(self) -> Manners:
        """How the other end behaves in transfers."""
        return Manners() if self.vehicle is None else self.vehicle.family.manners

    def ack(self, result: MavResult, mission_type: MissionType) -> MissionAck:
        """Return the acknowledgement to send to the vehicle."""
        return MissionAck(self.address, mission_type, result)


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a transfer ended.

    `status`: "accepted"; "unknown": everything was sent, but the last answer is missing or
    ambiguous; "refused" with the `result`; "silent": nothing came any more; "stalled": it got no
    further in the time there is; "armed": stopped because the vehicle is armed; "cancelled" by us,
    or by the vehicle with the `result`. `last_requested` is the number of the item last asked for,
    `items` what was downloaded, `said` the vehicle's status texts, `opaque_id` its number for the
    list, 0 for none. `armed` tells whether a heartbeat said so meanwhile.
    """

    status: Status
    result: int | None = None
    last_requested: int | None = None
    items: tuple[WireItem, ...] = ()
    said: tuple[str, ...] = ()
    opaque_id: int = 0
    armed: bool = False


class Exchange(AskingMachine[Outcome]):
    """The transfer of one list: it opens with a question and ends with an `Outcome`.

    It takes its time from `budget`, its own if none is given. What derives from it gives
    `_question`, which opens the transfer, and `_take`, which answers the vehicle's messages about
    the list, and says whether it writes.
    """

    writes = True

    def __init__(
        self,
        peer: Peer,
        mission_type: MissionType = MissionType.MISSION,
        timeouts: Timeouts | None = None,
        budget: Budget | None = None,
        soon: float = math.inf,
    ) -> None:
        self._timeouts = timeouts or Timeouts()
        wait = self._timeouts.response
        super().__init__(wait, self._timeouts.retries, soon if soon < wait else None)
        self._peer, self._type = peer, mission_type
        self._budget = budget or Budget(self._timeouts)
        self._armed = False
        self._texts: list[str] = []
        self._result: int | None = None
        """What the vehicle said last, if it was no."""

    @abstractmethod
    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:
        """Answer what the vehicle says to us about the list."""

    @property
    def _reached(self) -> int | None:
        """The number of the item last asked for."""
        return None

    def start(self, now: float) -> Sequence[Message]:
        """Ask, and begin to spend the budget."""
        self._budget.open(now)
        return super().start(now)

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take note of what arrived, and of the time."""
        return [*super().on(envelope, now), *self._stop_if_stalled(now)]

    def tick(self, now: float) -> Sequence[Message]:
        """Take note of the time."""
        return [*super().tick(now), *self._stop_if_stalled(now)]

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        message = envelope.message
        if envelope.sender != self._peer.address:
            return ()
        if isinstance(message, Heartbeat):
            self._armed = self._armed or message.armed
            if message.armed and self.writes and not self._peer.may_be_armed:
                return self._stop("armed")
            return self._on_heartbeat(message, now)
        if isinstance(message, Statustext):
            self._texts = [*self._texts[1 - _TEXTS :], message.text.strip()]
        elif isinstance(message, ListMessage) and message.mission_type == self._type:
            return self._take(message, now) if self._peer.own.takes(message.target) else ()
        return ()

    def _on_heartbeat(self, heartbeat: Heartbeat, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Answer the vehicle's heartbeat."""
        return ()

    def _give_up(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        self._end("silent" if self._result is None else "refused", self._result)
        return ()

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Give up and tell the vehicle."""
        return () if self.outcome is not None else self._stop("cancelled")

    def _stop_if_stalled(self, now: float) -> Sequence[Message]:
        stalled = self.outcome is None and self._budget.is_spent(now)
        return self._stop("stalled", self._result) if stalled else ()

    def _stop(self, status: Status, result: int | None = None) -> Sequence[Message]:
        self._end(status, result)
        return [self._peer.ack(MavResult.OPERATION_CANCELLED, self._type)]

    def _end(
        self,
        status: Status,
        result: int | None = None,
        items: tuple[WireItem, ...] = (),
        opaque_id: int = 0,
    ) -> None:
        said = tuple(dict.fromkeys(self._texts))
        self.outcome = Outcome(status, result, self._reached, items, said, opaque_id, self._armed)


class Clear(Exchange):
    """A machine that clears a list; asking twice does no harm, so it asks until answered.

    An ERROR is the end only if it is repeated: PX4 says nothing while busy, ArduPilot ERROR.

    >>> vehicle = Address(1, 1)
    >>> own = Address(246, 190)
    >>> clearing = Clear(Peer(own, vehicle, None), MissionType.RALLY)
    >>> clearing.start(now=0.0)
    [MissionClearAll(target=Address(system=1, component=1), mission_type=<MissionType.RALLY: 2>)]
    >>> clearing.deadline  # when the question is put again, s
    1.5
    >>> accepted = MissionAck(own, MissionType.RALLY, MavResult.ACCEPTED)
    >>> clearing.on(Envelope(vehicle, accepted), now=0.1)
    []
    >>> clearing.outcome.status
    'accepted'
    """

    @property
    def progress(self) -> Progress:
        """Not counted."""
        return f"clearing {self._type.title}", 0, 0

    def _question(self) -> Message:
        return MissionClearAll(self._peer.address, self._type)

    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:  # noqa: ARG002
        if not isinstance(message, MissionAck):
            return ()
        if message.type == MavResult.ACCEPTED:
            self._end("accepted", message.type)
        elif message.type == MavResult.ERROR and self._result is None:
            self._result = message.type
        else:
            self._end("refused", message.type)
        return ()
