"""Machines and talks: protocol logic without sockets, clocks or sleeping."""

import math
from abc import ABC, abstractmethod
from collections.abc import Generator, Sequence
from typing import Generic, TypeAlias, TypeVar

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


class Line:
    """What a talk knows of its link: the time, s, and what was `heard`, None when time has passed.

    It tells its `progress`, and says messages, which are sent once it waits.
    """

    now = 0.0
    heard: Envelope | None = None
    progress: Progress = ("starting", 0, 0)
    _said: list[Message]

    def say(self, *messages: Message) -> None:
        """Send `messages`."""
        self._said += messages


Talk: TypeAlias = Generator[float, Line, T]
"""A conversation: it yields until when it waits, s, and is sent its line when something is heard or
that time has come; `AT_ONCE` first. What it returns is the outcome of a `Script`; closed, it may
still say a word.
"""

AT_ONCE = -math.inf
"""What a talk yields that only wants its line."""


class Script(Line, Machine[T]):
    """A machine that runs a talk, whose line it is, and whose outcome is not None.

    >>> def knock():
    ...     line = yield AT_ONCE
    ...     line.say("knock")
    ...     line = yield line.now + 2.0
    ...     return "nobody" if line.heard is None else "somebody"
    >>> script = Script(knock())
    >>> script.start(1.0), script.deadline, script.tick(3.0), script.outcome
    (['knock'], 3.0, [], 'nobody')
    """

    def __init__(self, talk: Talk[T]) -> None:
        super().__init__()
        self._talk = talk

    def start(self, now: float) -> Sequence[Message]:
        """Begin the talk."""
        next(self._talk)
        return self._carry_on(None, now)

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        return self._carry_on(envelope, now)

    def _time_out(self, now: float) -> Sequence[Message]:
        return self._carry_on(None, now)

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Close the talk: there is no outcome."""
        self._said, self._due = [], math.inf
        self._talk.close()
        return self._said

    def _carry_on(self, heard: Envelope | None, now: float) -> Sequence[Message]:
        self.now, self._said, self._due = now, [], AT_ONCE
        try:
            while self._due == AT_ONCE:
                self.heard, heard = heard, None
                self._due = self._talk.send(self)
        except StopIteration as end:
            self.outcome = end.value
        return self._said
