"""Machines: protocol logic without sockets, clocks or sleeping."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from typing import Any, Generic, TypeAlias, TypeVar

from faao_mav.wire.messages import Envelope, Message

T = TypeVar("T")

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


class AskingMachine(Machine[T]):
    """A machine that puts one question until there is an answer, for `patience` seconds.

    It is put again after a quarter of a second, and each time after twice as long, up to 1.5 s.
    """

    def __init__(self, patience: float) -> None:
        super().__init__()
        self._patience, self._wait, self._until = patience, _FIRST, 0.0

    @abstractmethod
    def _question(self) -> Message:
        """Return the question."""

    @abstractmethod
    def _give_up(self, now: float) -> Sequence[Message]:
        """End for want of an answer."""

    def start(self, now: float) -> Sequence[Message]:
        """Ask."""
        self._until = now + self._patience
        return self._ask(now)

    def _time_out(self, now: float) -> Sequence[Message]:
        return self._give_up(now) if now >= self._until else self._ask(now)

    def _ask(self, now: float) -> Sequence[Message]:
        self._due = min(now + self._wait, self._until)
        self._wait = min(2 * self._wait, _LONGEST)
        return [self._question()]


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
