"""When to ask again: what the guide says, and how long answers take on this link."""

import math
from dataclasses import dataclass

_DOUBTFUL = 5  # questions in a row that only a repetition got an answer to


@dataclass(frozen=True, slots=True)
class Timeouts:
    """How long a transfer waits, s.

    `response`, `item` and `retries` are the guide's: what to re-send, when, how often; on a link
    that is known to be quick, items are re-sent after `quickest` at the earliest: vehicles answer
    in the turns of their main loop, of which the slowest (ArduPlane's) has 50 a second. `silence`
    is how long a vehicle may say nothing in the middle of a transfer before it has given up
    itself: PX4 asks again for 5 s, ArduPilot for 8 s, so that six lost packets in a row end
    nothing. `attempts` is how often a whole transfer is begun.
    """

    response: float = 1.5
    item: float = 0.25
    quickest: float = 0.02
    retries: int = 5
    silence: float = 9.0
    boot: float = 60.0
    attempts: int = 3


@dataclass(slots=True)
class Question:
    """What wants an answer: when it was `asked` first, and `put` last.

    `repeats` are for want of an answer; `ambiguous` tells that it was put more than once.
    """

    asked: float
    put: float
    repeats: int = 0
    ambiguous: bool = False

    def put_again(self, now: float) -> None:
        """Note that it is put once more, for another reason than that time has passed."""
        self.put, self.ambiguous = now, True


class Pace:
    """When to ask again: as TCP does it, from how long answers take.

    - Before the first answer that is `Timeouts.item`; after it, mean and four deviations of the
      time that answers take (RFC 6298, 2), at least `Timeouts.quickest`.
    - The first repetition is a probe and changes nothing (RFC 8985, 7); each further one doubles
      the time (RFC 6298, 5.5), up to half a second or twice the usual.
    - An answer to a repeated question tells nothing of the time that it took (Karn's rule), nor
      does one that took `insists` seconds: so long after its last question the other end asks
      again by itself. With loss both are common, and the next question is asked in the usual
      time. But of a link that has become slow there would never be a measurement: before the
      first one, and after five such answers in a row, what was doubled stays doubled until a
      question is answered at once (RFC 8961, 4).
    - An answer that comes twice tells it sooner: its question was repeated in vain, so that the
      first answer was to the first asking, and is measured after all (RFC 3708).
    """

    def __init__(self, timeouts: Timeouts, insists: float = math.inf) -> None:
        self.wait = timeouts.item
        self._timeouts, self._insists = timeouts, insists
        self._mean: float | None = None
        self._deviation = 0.0
        self._unsure_of: float | None = None
        self._in_a_row = 0

    @property
    def is_doubtful(self) -> bool:
        """Whether the link is not known, or may have become slow."""
        return self._mean is None or self._in_a_row >= _DOUBTFUL

    def ask(self, now: float) -> Question:
        """Return a new question."""
        return Question(now, now)

    def repeat(self, question: Question, now: float) -> None:
        """Note that it is put once more because no answer came."""
        question.put_again(now)
        question.repeats += 1
        if question.repeats > 1 or self.is_doubtful:
            self.wait = min(2 * self.wait, self._most())

    def answer(self, question: Question, now: float) -> None:
        """Note its answer."""
        took = now - question.asked
        if not question.ambiguous and took < self._insists:
            self._learn(took)
            return
        self._unsure_of = took
        self._in_a_row += 1
        if not self.is_doubtful:
            self.wait = self._least()

    def answer_again(self) -> None:
        """Note that the answer before came twice."""
        if self._unsure_of is not None:
            self._learn(self._unsure_of)

    def _learn(self, took: float) -> None:
        if self._mean is None:
            self._mean, self._deviation = took, took / 2
        else:
            self._deviation += (abs(took - self._mean) - self._deviation) / 4
            self._mean += (took - self._mean) / 8
        self._unsure_of, self._in_a_row = None, 0
        self.wait = self._least()

    def _least(self) -> float:
        least = (self._mean or 0.0) + 4 * self._deviation
        return min(max(least, self._timeouts.quickest), self._timeouts.response)

    def _most(self) -> float:
        most = self._timeouts.response
        if self._mean is not None:
            most = min(2 * max(self._timeouts.item, self._least()), most)
        return most
