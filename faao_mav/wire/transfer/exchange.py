"""What the transfers of one list have in common, and the simplest of them: clearing it."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from faao_mav.autopilot import VehicleType
from faao_mav.autopilot.manners import Manners
from faao_mav.wire.machine import Machine, Progress
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
from faao_mav.wire.transfer.pace import Pace, Questions, Timeouts

Status: TypeAlias = Literal["accepted", "unknown", "refused", "silent", "armed", "cancelled"]

TENTATIVE = frozenset({MavResult.ERROR, MavResult.DENIED})
"""Results that PX4 and ArduPilot also give to late packets of an earlier transfer: they count when
nothing else is said."""

OPENING = -1
"""The question that opens a transfer, where the others are the numbers of items."""

_TEXTS = 5
"""The number of status texts that are kept, the last ones; chosen."""


@dataclass(frozen=True, slots=True)
class Peer:
    """Both ends of a transfer, and what flies at the other: None if its autopilot is not known.

    Unless it `may_be_armed`, nothing more is written once a heartbeat of it says that it is armed.
    `pace` is what its transfers have learnt so far of how long answers take.
    """

    own: Address
    address: Address
    vehicle: VehicleType | None
    may_be_armed: bool = False
    timeouts: Timeouts = field(default_factory=Timeouts)
    pace: Pace = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pace", Pace(self.timeouts))

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
    ambiguous; "refused" with the `result`; "silent": it got no further; "armed": stopped because
    the vehicle is armed; "cancelled" by us, or by the vehicle with the `result`. `last_requested`
    is the number of the item last asked for, `items` what was downloaded, `said` the vehicle's
    status texts, `opaque_id` its number for the list, 0 for none. `armed` tells whether a heartbeat
    said so meanwhile.
    """

    status: Status
    result: int | None = None
    last_requested: int | None = None
    items: tuple[WireItem, ...] = ()
    said: tuple[str, ...] = ()
    opaque_id: int = 0
    armed: bool = False

    @property
    def by_us(self) -> bool:
        """Whether this end cancelled it."""
        return self.status == "cancelled" and self.result is None


class Exchange(Machine[Outcome]):
    """The transfer of one list: it opens with a question and ends with an `Outcome`.

    Its questions are put again at a pace, until the transfer has got no further for
    `Timeouts.silence`. What derives from it gives `_message`, the question under a key, and
    `_take`, which answers the vehicle's messages about the list, and says whether it writes.
    """

    writes = True

    def __init__(self, peer: Peer, mission_type: MissionType = MissionType.MISSION) -> None:
        super().__init__()
        self._peer, self._type, self._timeouts = peer, mission_type, peer.timeouts
        self._questions = Questions[int](peer.pace)
        self._until = 0.0
        """When it is given up, s."""
        self._result: int | None = None
        """What the vehicle said last, if it was no."""
        self._armed = False
        self._texts: list[str] = []

    @abstractmethod
    def _message(self, key: int) -> Message:
        """Return the question under `key`."""

    @abstractmethod
    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:
        """Answer what the vehicle says to us about the list."""

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self.outcome is not None else min(self._questions.due, self._until)

    @property
    def _reached(self) -> int | None:
        """The number of the item last asked for."""
        return None

    def start(self, now: float) -> Sequence[Message]:
        """Ask."""
        self._questions.clear()
        self._get_further(now)
        return self._ask(OPENING, now)

    def _get_further(self, now: float) -> None:
        """Note that the transfer has got further."""
        self._until, self._result = now + self._timeouts.silence, None

    def _ask(self, key: int, now: float) -> list[Message]:
        self._questions.put(key, now)
        return [self._message(key)]

    def _time_out(self, now: float) -> Sequence[Message]:
        if now >= self._until:
            return self._give_up(now)
        return [self._message(key) for key in self._questions.late(now)]

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

    def _doubt(self, result: int, now: float) -> None:
        """Note a refusal that counts only when nothing else is said."""
        self._result = result
        if OPENING not in self._questions:  # which a busy vehicle is asked until it is free
            self._until = min(self._until, now + self._timeouts.response)

    def _give_up(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        return self._stop("silent" if self._result is None else "refused", self._result)

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Give up and tell the vehicle."""
        return () if self.outcome is not None else self._stop("cancelled")

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

    PX4 says nothing while busy, ArduPilot ERROR.

    >>> vehicle = Address(1, 1)
    >>> own = Address(246, 190)
    >>> clearing = Clear(Peer(own, vehicle, None), MissionType.RALLY)
    >>> clearing.start(now=0.0)
    [MissionClearAll(target=Address(system=1, component=1), mission_type=<MissionType.RALLY: 2>)]
    >>> clearing.deadline  # when the question is put again, s
    0.25
    >>> accepted = MissionAck(own, MissionType.RALLY, MavResult.ACCEPTED)
    >>> clearing.on(Envelope(vehicle, accepted), now=0.1)
    ()
    >>> clearing.outcome.status
    'accepted'
    """

    @property
    def progress(self) -> Progress:
        """Not counted."""
        return f"clearing {self._type.title}", 0, 0

    def _message(self, key: int) -> Message:  # noqa: ARG002
        return MissionClearAll(self._peer.address, self._type)

    def _take(self, message: ListMessage, now: float) -> Sequence[Message]:
        if not isinstance(message, MissionAck):
            return ()
        if message.type == MavResult.ERROR:
            self._doubt(message.type, now)
        else:
            self._end("accepted" if message.type == MavResult.ACCEPTED else "refused", message.type)
        return ()
