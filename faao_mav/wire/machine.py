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


_EARLY = 3
"""How often a question is put again early, where that is asked for. Chosen: 200 uploads of 200
items to a mock PX4, with 20 % loss each way, took at most 11.6 s with one, 10.2 s with three."""


class AskingMachine(Machine[T]):
    """A machine that begins with a question, and repeats it until there is an answer.

    The question is put again every `wait` seconds, `retries` times; then `_give_up` is called.
    With `soon` it is put `_EARLY` times more before that, each time after so many seconds.
    """

    def __init__(self, wait: float, retries: int, soon: float | None = None) -> None:
        super().__init__()
        self._wait, self._retries, self._soon = wait, retries, soon
        self._retries_done = 0

    @abstractmethod
    def _question(self) -> Message:
        """Return the question."""

    @abstractmethod
    def _give_up(self, now: float) -> Sequence[Message]:
        """End, or begin anew, for want of an answer."""

    def start(self, now: float) -> Sequence[Message]:
        """Ask."""
        self._retries_done = 0 if self._soon is None else -_EARLY
        return self._ask(now)

    def _time_out(self, now: float) -> Sequence[Message]:
        if self._retries_done == self._retries:
            return self._give_up(now)
        self._retries_done += 1
        return self._ask(now)

    def _ask(self, now: float) -> Sequence[Message]:
        early = self._soon if self._retries_done < 0 else None
        self._due = now + (self._wait if early is None else early)
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
