"""Questions that are put until they are answered, at the pace of the link."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from faao_mav.wire.machine import AT_ONCE, Line, Talk
from faao_mav.wire.messages import CommandLong, Envelope, Message, Timesync
from faao_mav.wire.protocol import Address, MavCommand

K = TypeVar("K")
T = TypeVar("T")
M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class Timeouts:
    """When a transfer is given up.

    `silence` is how many seconds it may get no further: PX4 asks again for 5 s, ArduPilot for 8 s.
    `attempts` is how often it is begun.
    """

    silence: float = 9.0
    attempts: int = 3


BOOT = 60.0
"""Seconds that a vehicle may boot; chosen."""

_FIRST, SLOWEST = 0.25, 1.5
"""Seconds after which a question is put again while it is not known how long answers take, and at
the latest: the guide's."""

_QUICKEST = 0.02
"""Seconds after which it is put again at the earliest: vehicles answer in the turns of their main
loop, of which the slowest (ArduPlane's) has 50 a second."""

_GROWTH = 1.25
"""By how much the wait grows with each question that has to be put again; chosen."""

_LONGEST = 0.5
"""The longest time after which a question is put again on a quick link, s; chosen."""


class Pace:
    """How long to `wait` for an answer before it is asked for again, s.

    It is `_FIRST` at first, then the mean and four deviations of the time that answers take
    (RFC 6298). An answer to a question that was put again tells nothing of that time (Karn's rule):
    the wait grows, so that a link that has become slow is measured in the end.
    """

    def __init__(self) -> None:
        self.mean: float | None = None
        """Mean time of answers, s; None before the first one."""
        self._deviation = 0.0
        self.wait = _FIRST

    def repeat(self) -> None:
        """Note that a question has to be put again."""
        self.wait = min(_GROWTH * self.wait, SLOWEST)

    def answer(self, took: float) -> None:
        """Note how long the answer took to a question that was put once."""
        if self.mean is None:
            self.mean, self._deviation = took, took / 2
        else:
            self._deviation += (abs(took - self.mean) - self._deviation) / 4
            self.mean += (took - self.mean) / 8
        self.wait = min(max(self.mean + 4 * self._deviation, _QUICKEST), SLOWEST)


@dataclass(slots=True)
class _Question:
    """What is said when it is late; when it was put last, s, and how often."""

    again: Sequence[Message] = ()
    sent: float = 0.0
    times: int = 0


class Questions(Generic[K]):
    """Questions under way on a line, each under a key: the late ones are put again at a `pace`.

    `least` is how long one waits before it is put again, s, at the least.
    """

    def __init__(self, line: Line, pace: Pace, least: float = 0.0) -> None:
        self._line, self.pace, self.least = line, pace, least
        self._asked: dict[K, _Question] = {}
        self.last = -math.inf
        """When one was put last, s."""

    def __len__(self) -> int:
        return len(self._asked)

    def __iter__(self) -> Iterator[K]:
        return iter(self._asked)

    def put(self, key: K, *messages: Message, again: Sequence[Message] = ()) -> None:
        """Put a question, or one under way once more; `again` is said instead once it is late."""
        question = self._asked.setdefault(key, _Question())
        question.again, question.times = again or messages, question.times + 1
        question.sent = self.last = self._line.now
        self._line.say(*messages)

    def times(self, key: K) -> int:
        """Return how often a question under way was put."""
        return self._asked[key].times if key in self._asked else 0

    def answer(self, key: K) -> None:
        """Note that a question is answered, if it is under way."""
        question = self._asked.pop(key, None)
        if question is not None and question.times == 1:
            self.pace.answer(self._line.now - question.sent)

    def clear(self) -> None:
        """Wait for no answer any more."""
        self._asked.clear()

    @property
    def due(self) -> float:
        """When the next one is to be put again; infinity where there is none."""
        return min(map(self._due, self._asked.values()), default=math.inf)

    def repeat(self, most: float = math.inf) -> list[K]:
        """Put late ones again; return those given up, which were put `most` times."""
        late = [key for key, each in self._asked.items() if self._due(each) <= self._line.now]
        if any(self._asked[key].times == 1 for key in late):
            self.pace.repeat()
        for key in late:
            question = self._asked.pop(key)
            if question.times < most:
                self._asked[key] = question
                self.put(key, *question.again)
        return [key for key in late if key not in self._asked]

    def _due(self, question: _Question) -> float:
        """Return when `question` is put again: each time after twice as long."""
        wait = self.pace.wait * 2.0 ** min(question.times - 1, 8)  # beyond the longest
        return question.sent + max(min(wait, max(_LONGEST, self.pace.wait)), self.least)


def ask(
    what: str,
    question: Message,
    answer: Callable[[Envelope], T | None],
    patience: float = 3.0,
) -> Talk[T | None]:
    """Put one question until it is answered, for `patience` seconds; return the answer, or None.

    `answer` returns what an envelope says to it, None for nothing; `what` is being done in words.
    """
    line = yield AT_ONCE
    line.progress = what, 0, 0
    asked, until = Questions[int](line, Pace()), line.now + patience
    asked.put(0, question)
    while line.now < until:
        line = yield min(asked.due, until)
        found = None if line.heard is None else answer(line.heard)
        if found is not None:
            return found
        asked.repeat()
    return None


def ask_for(vehicle: Address, number: int, kind: type[M]) -> Talk[M | None]:
    """Ask `vehicle` for its message of the type `kind` and that `number`."""

    def answer(envelope: Envelope) -> M | None:
        message = envelope.message
        return message if envelope.sender == vehicle and isinstance(message, kind) else None

    question = CommandLong(vehicle, MavCommand.REQUEST_MESSAGE, 0, float(number))
    return ask(f"asking for {kind.__name__}", question, answer)


def ask_alive(vehicle: Address, number: int, patience: float = 9.0) -> Talk[bool]:
    """Ask for the answer to a `number` that nobody could know before; tell whether it comes.

    One that reads MAVLink 1 alone does not give it. On a link that is signed a recording cannot,
    and what was recorded before the answer is older than it: it is passed over from then on.
    """

    def answer(envelope: Envelope) -> Message | None:
        match envelope.message:
            case Timesync(tc1=tc1, ts1=ts1) as said if envelope.sender == vehicle:
                return said if tc1 and ts1 == number else None
        return None

    said = yield from ask("asking for a sign of life", Timesync(0, number), answer, patience)
    return said is not None
