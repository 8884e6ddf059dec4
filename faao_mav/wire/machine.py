"""Machines: protocol logic without sockets, clocks or sleeping."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from typing import Any, Generic, TypeAlias, TypeVar

from faao_mav.wire.messages import CommandLong, Envelope, Message, Timesync
from faao_mav.wire.protocol import Address, MavCommand

T = TypeVar("T")
M = TypeVar("M", bound=Message)

Progress: TypeAlias = tuple[str, int, int]
"""What is going on, how much of it is done, and of how much (0: not counted)."""


class Machine(ABC, Generic[T]):
    """What is run on a link, real or simulated.

    It is told the time in seconds and what arrived, and answers with what is to be sent. Whoever
    runs it calls `start` once, then `on` for each message and `tick` at `deadline`, until there is
    an `outcome`; `cancel` ends it early. What derives from it gives `start`, `_receive` and
    `_time_out`, and sets `_due`, the time of the next `_time_out`, and in the end `outcome`.
    """

    def __init__(self) -> None:
        self.outcome: T | None = None
        self._due = 0.0

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self.outcome is not None else self._due

    @property
    @abstractmethod
    def progress(self) -> Progress:
        """What is going on."""

    @abstractmethod
    def start(self, now: float) -> Sequence[Message]:
        """Begin."""

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take note of what arrived."""
        return () if self.outcome is not None else self._receive(envelope, now)

    def tick(self, now: float) -> Sequence[Message]:
        """Take note of the time."""
        due = self.deadline
        return () if due is None or now < due else self._time_out(now)

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Give up."""
        return ()

    def hang_up(self, now: float) -> Sequence[Message]:
        """End where nobody can be told any more: give up."""
        return self.cancel(now)

    @abstractmethod
    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Answer what arrived before the outcome."""

    @abstractmethod
    def _time_out(self, now: float) -> Sequence[Message]:
        """Do what is due now."""


_FIRST, _LONGEST = 0.25, 1.5
"""Seconds after which a question is put again the first time, and at the latest: the guide's."""


class Ask(Machine[list[T]]):
    """A machine that puts one question until it is answered, for `patience` seconds.

    It is put again after a quarter of a second, and each time after twice as long, up to 1.5 s.
    `answer` returns what an envelope says to it, None for nothing. The outcome is a list of that
    answer, or empty; `what` is being done in words.
    """

    def __init__(
        self,
        what: str,
        question: Message,
        answer: Callable[[Envelope], T | None],
        patience: float = 3.0,
    ) -> None:
        super().__init__()
        self._what, self._question, self._answer = what, question, answer
        self._patience, self._wait, self._until = patience, _FIRST, 0.0

    @property
    def progress(self) -> Progress:
        """Not counted."""
        return self._what, 0, 0

    def start(self, now: float) -> Sequence[Message]:
        """Ask."""
        self._until = now + self._patience
        return self._ask(now)

    def _ask(self, now: float) -> Sequence[Message]:
        self._due = min(now + self._wait, self._until)
        self._wait = min(2 * self._wait, _LONGEST)
        return [self._question]

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:  # noqa: ARG002
        answer = self._answer(envelope)
        self.outcome = None if answer is None else [answer]
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        return self.cancel(now) if now >= self._until else self._ask(now)

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Do without an answer."""
        self.outcome = []
        return ()


def ask_for(vehicle: Address, number: int, kind: type[M]) -> Ask[M]:
    """Return a machine that asks `vehicle` for its message of the type `kind` and that `number`."""

    def answer(envelope: Envelope) -> M | None:
        message = envelope.message
        return message if envelope.sender == vehicle and isinstance(message, kind) else None

    question = CommandLong(vehicle, MavCommand.REQUEST_MESSAGE, 0, float(number))
    return Ask(f"asking for {kind.__name__}", question, answer)


def ask_alive(vehicle: Address, number: int, patience: float = 9.0) -> Ask[Message]:
    """Return a machine that asks for the answer to a `number` that nobody could know before.

    One that reads MAVLink 1 alone does not give it. On a link that is signed a recording cannot,
    and what was recorded before the answer is older than it: it is passed over from then on.

    >>> vehicle = Address(1, 1)
    >>> asking = ask_alive(vehicle, number=77)
    >>> asking.start(now=0.0)
    [Timesync(tc1=0, ts1=77)]
    >>> asking.on(Envelope(vehicle, Timesync(123_456, 77)), now=0.1), bool(asking.outcome)
    ((), True)
    """

    def answer(envelope: Envelope) -> Message | None:
        match envelope.message:
            case Timesync(tc1=tc1, ts1=ts1) as said if envelope.sender == vehicle:
                return said if tc1 and ts1 == number else None
        return None

    return Ask("asking for a sign of life", Timesync(0, number), answer, patience)


class Script(Machine[T]):
    """A machine made of machines: a generator yields one after the other and is sent its outcome.

    What the generator returns is the script's outcome.
    """

    def __init__(self, steps: Generator[Machine[Any], Any, T]) -> None:
        super().__init__()
        self._steps = steps
        self._step: Machine[Any] | None = None

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self._step is None else self._step.deadline

    @property
    def progress(self) -> Progress:
        """What is going on in the present step."""
        return ("starting", 0, 0) if self._step is None else self._step.progress

    def start(self, now: float) -> Sequence[Message]:
        """Begin the first step."""
        return self._advance(None, now)

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        return self._continue(lambda step: step.on(envelope, now), now)

    def _time_out(self, now: float) -> Sequence[Message]:
        return self._continue(lambda step: step.tick(now), now)

    def cancel(self, now: float) -> Sequence[Message]:
        """Give up the present step, and with it the rest."""
        return self._continue(lambda step: step.cancel(now), now)

    def _continue(
        self, told: Callable[[Machine[Any]], Sequence[Message]], now: float
    ) -> Sequence[Message]:
        """Return what the step sends when `told`, and what begins the next one if it ends."""
        if self._step is None:
            return ()
        sent = told(self._step)
        if self._step.outcome is None:
            return sent
        return [*sent, *self._advance(self._step.outcome, now)]

    def _advance(self, outcome: Any, now: float) -> Sequence[Message]:
        try:
            self._step = self._steps.send(outcome)
        except StopIteration as end:
            self._step, self.outcome = None, end.value
            return ()
        return self._continue(lambda step: step.start(now), now)
