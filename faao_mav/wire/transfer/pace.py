"""When a question is put again: from how long answers take on this link."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

K = TypeVar("K")


@dataclass(frozen=True, slots=True)
class Timeouts:
    """How long a transfer waits, s.

    `response` and `item` are the guide's: the longest time after which a question is put again, and
    the time before it is known how long answers take. `quickest` is the shortest: vehicles answer
    in the turns of their main loop, of which the slowest (ArduPlane's) has 50 a second. `silence`
    is how long a transfer may get no further before it is given up: PX4 asks again for 5 s,
    ArduPilot for 8 s. `boot` is how long a vehicle may boot, `attempts` how often a whole transfer
    is begun.
    """

    response: float = 1.5
    item: float = 0.25
    quickest: float = 0.02
    silence: float = 9.0
    boot: float = 60.0
    attempts: int = 3


_GROWTH = 1.25
"""By how much the wait grows with each question that has to be put again; chosen."""

_LONGEST = 0.5
"""The longest time after which a question is put again on a quick link, s; chosen."""


class Pace:
    """How long to `wait` for an answer before it is asked for again, s.

    It is `Timeouts.item` at first, then the mean and four deviations of the time that answers take
    (RFC 6298). An answer to a question that was put again tells nothing of that time (Karn's rule):
    the wait grows, so that a link that has become slow is measured in the end.
    """

    def __init__(self, timeouts: Timeouts) -> None:
        self._timeouts = timeouts
        self.mean: float | None = None
        """Mean time of answers, s; None before the first one."""
        self._deviation = 0.0
        self.wait = timeouts.item

    def repeat(self) -> None:
        """Note that a question has to be put again."""
        self.wait = min(_GROWTH * self.wait, self._timeouts.response)

    def answer(self, took: float) -> None:
        """Note how long the answer took to a question that was put once."""
        if self.mean is None:
            self.mean, self._deviation = took, took / 2
        else:
            self._deviation += (abs(took - self.mean) - self._deviation) / 4
            self.mean += (took - self.mean) / 8
        wait = max(self.mean + 4 * self._deviation, self._timeouts.quickest)
        self.wait = min(wait, self._timeouts.response)


@dataclass(slots=True)
class _Question:
    """When it was put last, s, how often it was put, and how often because no answer had come."""

    sent: float
    times: int = 1
    late: int = 0


class Questions(Generic[K]):
    """Questions under way, each under a key: those without an answer are put again at a `pace`.

    >>> asked = Questions[str](Pace(Timeouts()))
    >>> asked.put("home", now=0.0)
    >>> asked.due, asked.late(now=0.25), asked.due
    (0.25, ['home'], 0.75)
    >>> asked.answer("home", now=0.3), asked.due
    (None, inf)
    """

    def __init__(self, pace: Pace) -> None:
        self.pace = pace
        self.least = 0.0
        """Seconds that a question waits before it is put again, at least."""
        self.last = -math.inf
        """When one was put last, s."""
        self._asked: dict[K, _Question] = {}

    def __len__(self) -> int:
        return len(self._asked)

    def __iter__(self) -> Iterator[K]:
        return iter(self._asked)

    def put(self, key: K, now: float) -> None:
        """Note that a question is put, or put once more without being late."""
        question = self._asked.setdefault(key, _Question(now, 0))
        question.sent, question.times = now, question.times + 1
        self.last = now

    def times(self, key: K) -> int:
        """Return how often a question under way was put."""
        return self._asked[key].times if key in self._asked else 0

    def answer(self, key: K, now: float) -> None:
        """Note that a question is answered."""
        question = self._asked.pop(key)
        if question.times == 1:
            self.pace.answer(now - question.sent)

    def clear(self) -> None:
        """Wait for no answer any more."""
        self._asked.clear()

    @property
    def due(self) -> float:
        """When the next one is to be put again; infinity where there is none."""
        return min(map(self._due, self._asked.values()), default=math.inf)

    def late(self, now: float) -> list[K]:
        """Return which are to be put again now, as they are."""
        late = [key for key, question in self._asked.items() if self._due(question) <= now]
        if any(self._asked[key].late == 0 for key in late):
            self.pace.repeat()
        for key in late:
            self._asked[key].late += 1
            self.put(key, now)
        return late

    def _due(self, question: _Question) -> float:
        """Return when `question` is put again: each time after twice as long."""
        wait = self.pace.wait * 2.0**question.late
        return question.sent + max(min(wait, max(_LONGEST, self.pace.wait)), self.least)
