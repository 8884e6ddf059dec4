"""What uploads, downloads and clearing have in common.

A machine knows neither sockets nor clocks: it is told the time, in seconds, and what arrived, and
answers with what is to be sent. Whoever runs it calls `tick` at `deadline` and stops when there is
an `outcome`.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeAlias, TypeVar

from faao_mav.mavlink.messages import Envelope, Message, MissionAck, Row, Statustext
from faao_mav.mavlink.transfer.pace import Timeouts
from faao_mav.mavlink.transfer.protocol import Address, Firmware, MissionType, Result

Status: TypeAlias = Literal["accepted", "unknown", "refused", "silent", "cancelled"]


@dataclass(frozen=True, slots=True)
class Peer:
    """Both ends of a transfer, and whose manners the vehicle has."""

    own: Address
    vehicle: Address
    firmware: Firmware

    def said(self, envelope: Envelope, mission_type: MissionType) -> bool:
        """Tell whether `envelope` is from the vehicle, to us, about that list."""
        message = envelope.message
        return (
            envelope.sender == self.vehicle
            and getattr(message, "mission_type", None) == mission_type
            and self.own.takes(
                getattr(message, "target_system", -1), getattr(message, "target_component", -1)
            )
        )

    def ack(self, result: Result, mission_type: MissionType) -> MissionAck:
        """Return the acknowledgement to send to the vehicle."""
        return MissionAck(self.vehicle.system, self.vehicle.component, result, mission_type)


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a transfer ended.

    `status`: "accepted"; "unknown": everything was sent, but the last answer is missing or
    ambiguous; "refused" with the `result`; "silent": nothing came any more; "cancelled" by us, or
    by the vehicle with the `result`. `item` is the row last asked for, `rows` what was
    downloaded, `said` the vehicle's status texts, `opaque_id` its number for the list, 0 for none.
    """

    status: Status
    result: int | None = None
    item: int | None = None
    rows: tuple[Row, ...] = ()
    said: tuple[str, ...] = ()
    opaque_id: int = 0


T_co = TypeVar("T_co", covariant=True)
T = TypeVar("T")


class Machine(Protocol[T_co]):
    """What is run on a link, real or simulated."""

    @property
    def outcome(self) -> T_co | None:
        """The end, or None while running."""
        ...

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        ...

    @property
    def progress(self) -> tuple[str, int, int]:
        """What is going on, how much of it is done, and of how much."""
        ...

    def start(self, now: float) -> Sequence[Message]:
        """Begin."""
        ...

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take note of what arrived."""
        ...

    def tick(self, now: float) -> Sequence[Message]:
        """Take note of the time."""
        ...

    def cancel(self, now: float) -> Sequence[Message]:
        """Give up."""
        ...


class Texts:
    """The last things that the vehicle said in plain words."""

    def __init__(self, vehicle: Address) -> None:
        self._vehicle = vehicle
        self._texts: list[str] = []

    def note(self, envelope: Envelope) -> None:
        """Keep `envelope` if it is a status text of the vehicle."""
        message = envelope.message
        if isinstance(message, Statustext) and envelope.sender == self._vehicle:
            self._texts = [*self._texts[-4:], message.text.strip()]

    def all(self) -> tuple[str, ...]:
        """Return them, oldest first, each once."""
        return tuple(dict.fromkeys(self._texts))


class Exchange:
    """What the transfer of one list always has: both ends, a deadline, an outcome."""

    def __init__(self, peer: Peer, mission_type: MissionType, timeouts: Timeouts | None) -> None:
        self.outcome: Outcome | None = None
        self._peer, self._type = peer, mission_type
        self._timeouts = timeouts or Timeouts()
        self._texts = Texts(peer.vehicle)
        self._due = 0.0

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self.outcome else self._due

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Give up and tell the vehicle."""
        if self.outcome is not None:
            return ()
        self.outcome = Outcome("cancelled", said=self._texts.all())
        return [self._peer.ack(Result.OPERATION_CANCELLED, self._type)]


class Script(Generic[T]):
    """A machine made of machines: a generator yields one after the other and is sent its outcome.

    What the generator returns is the script's outcome.
    """

    def __init__(self, steps: Generator[Machine[Any], Any, T]) -> None:
        self._steps = steps
        self._step: Machine[Any] | None = None
        self.outcome: T | None = None

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self._step is None else self._step.deadline

    @property
    def progress(self) -> tuple[str, int, int]:
        """Those of the present step."""
        return ("starting", 0, 0) if self._step is None else self._step.progress

    def start(self, now: float) -> Sequence[Message]:
        """Begin the first step."""
        return self._advance(None, now)

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Pass on what arrived."""
        if self._step is None:
            return ()
        return [*self._step.on(envelope, now), *self._ended(now)]

    def tick(self, now: float) -> Sequence[Message]:
        """Pass on the time."""
        if self._step is None:
            return ()
        return [*self._step.tick(now), *self._ended(now)]

    def cancel(self, now: float) -> Sequence[Message]:
        """Give up the present step, and with it the rest."""
        if self._step is None:
            return ()
        return [*self._step.cancel(now), *self._ended(now)]

    def _ended(self, now: float) -> Sequence[Message]:
        if self._step is None or self._step.outcome is None:
            return ()
        return self._advance(self._step.outcome, now)

    def _advance(self, outcome: Any, now: float) -> Sequence[Message]:
        try:
            self._step = self._steps.send(outcome)
        except StopIteration as end:
            self._step, self.outcome = None, end.value
            return ()
        return [*self._step.start(now), *self._ended(now)]
