"""When to ask again: what the guide says, and how long answers take on this link."""

import math
from dataclasses import dataclass

_DOUBTFUL = 5
"""Questions in a row that only a repetition got an answer to, after which the link may have become
slow; chosen; what another number costs is not measured."""


@dataclass(frozen=True, slots=True)
class Timeouts:
    """How long a transfer waits, s.

    `response`, `item` and `retries` are the guide's: what to re-send, when, how often; on a link
    that is known to be quick, items are re-sent after `quickest` at the earliest: vehicles answer
    in the turns of their main loop, of which the slowest (ArduPlane's) has 50 a second. `silence`
    is how long a vehicle may say nothing in the middle of a transfer before it has given up
    itself: PX4 asks again for 5 s, ArduPilot for 8 s, so that six lost packets in a row end
    nothing. `attempts` is how often a whole transfer is begun. `patience` is what all of it may
    take together, and `per_item` what each item that gets further adds: chosen, so that 8 of 9
    uploads to PX4 are verified which 30 % loss each way, copies and 0.3 s for an answer held up
    longest of 1,000; with 2 s it was none.
    """

    response: float = 1.5
    item: float = 0.25
    quickest: float = 0.02
    retries: int = 5
    silence: float = 9.0
    boot: float = 60.0
    attempts: int = 3
    patience: float = 30.0
    per_item: float = 5.0


class Budget:
    """How long the upload of a list, reading it back and all repetitions may take together.

    Each item of the upload, and of the download, adds to it when it is the furthest so far: a
    vehicle that answers for ever and gets nowhere is given up in time.

    >>> budget = Budget(Timeouts(patience=30.0, per_item=2.0))
    >>> budget.open(now=100.0)
    >>> budget.reach("upload", 1), budget.reach("upload", 1), budget.is_spent(132.0)
    (None, None, False)
    >>> budget.is_spent(132.1)
    True
    """

    def __init__(self, timeouts: Timeouts) -> None:
        self._timeouts = timeouts
        self._opened: float | None = None
        self._earned = timeouts.patience
        self._reached: dict[str, int] = {}

    def open(self, now: float) -> None:
        """Note that the first transfer begins; later ones change nothing."""
        self._opened = now if self._opened is None else self._opened

    def reach(self, way: str, items: int) -> None:
        """Note that `way`, "upload" or "download", has got as far as so many items."""
        further = items - self._reached.get(way, 0)
        if further > 0:
            self._reached[way] = items
            self._earned += further * self._timeouts.per_item

    def allow_boot(self) -> None:
        """Note that the vehicle is still booting, which may take its own time."""
        self._earned = max(self._earned, self._timeouts.boot)

    def is_spent(self, now: float) -> bool:
        """Tell whether it is time to give up."""
        return self._opened is not None and now > self._opened + self._earned


@dataclass(slots=True)
class Question:
    """A question to the vehicle: `first_sent` and `last_sent` are times, s.

    `repeats` counts how often it was sent again for want of an answer, `sent` how often it was sent
    in all.
    """

    first_sent: float
    last_sent: float
    repeats: int = 0
    sent: int = 1

    @property
    def ambiguous(self) -> bool:
        """Whether it was sent more than once, for whatever reason."""
        return self.sent > 1

    def send_again(self, now: float) -> None:
        """Note that it is sent once more, for another reason than that time has passed."""
        self.last_sent = now
        self.sent += 1


class Pace:
    """When to ask again: as TCP does it, from how long answers take.

    - Before the first answer that is `Timeouts.item`; after it, mean and four deviations of the
      time that answers take (RFC 6298, 2), at least `Timeouts.quickest`.
    - The first repetition is a probe and changes nothing (RFC 8985, 7); each further one doubles
      the time (RFC 6298, 5.5), up to half a second or twice the usual.
    - An answer to a repeated question tells nothing of the time that it took (Karn's rule), nor
      does one that took `request_period` seconds: so long after its last question the other end
      asks again by itself. With loss both are common, and the next question is asked in the usual
      time. But of a link that has become slow there would never be a measurement: before the
      first one, and after five such answers in a row, what was doubled stays doubled until a
      question is answered at once (RFC 8961, 4).
    - An answer that comes twice tells it sooner: its question was repeated in vain, so that the
      first answer was to the first asking, and is measured after all (RFC 3708).

    What was measured `before`, in another transfer over the link, holds until something else is.
    """

    def __init__(
        self,
        timeouts: Timeouts,
        request_period: float = math.inf,
        before: "Pace | None" = None,
    ) -> None:
        self._timeouts, self._request_period = timeouts, request_period
        self._mean: float | None = None if before is None else before._mean
        self._deviation: float = 0.0 if before is None else before._deviation
        self.wait = timeouts.item if self._mean is None else self._shortest_wait()
        self._ambiguous_time: float | None = None
        self._ambiguous_in_a_row = 0

    @property
    def is_doubtful(self) -> bool:
        """Whether the link is not known, or may have become slow."""
        return self._mean is None or self._ambiguous_in_a_row >= _DOUBTFUL

    def ask(self, now: float) -> Question:
        """Return a new question."""
        return Question(now, now)

    def repeat(self, question: Question, now: float) -> None:
        """Note that it is sent once more because no answer came."""
        question.send_again(now)
        question.repeats += 1
        if question.repeats > 1 or self.is_doubtful:
            self.wait = min(2 * self.wait, self._longest_wait())

    def answer(self, question: Question, now: float) -> None:
        """Note its answer."""
        duration = now - question.first_sent
        if not question.ambiguous and duration < self._request_period:
            self._learn(duration)
            return
        self._ambiguous_time = duration
        self._ambiguous_in_a_row += 1
        if not self.is_doubtful:
            self.wait = self._shortest_wait()

    def answer_again(self) -> None:
        """Note that the answer before came twice."""
        if self._ambiguous_time is not None:
            self._learn(self._ambiguous_time)

    def _learn(self, duration: float) -> None:
        if self._mean is None:
            self._mean, self._deviation = duration, duration / 2
        else:
            self._deviation += (abs(duration - self._mean) - self._deviation) / 4
            self._mean += (duration - self._mean) / 8
        self._ambiguous_time, self._ambiguous_in_a_row = None, 0
        self.wait = self._shortest_wait()

    def _shortest_wait(self) -> float:
        wait = (self._mean or 0.0) + 4 * self._deviation
        return min(max(wait, self._timeouts.quickest), self._timeouts.response)

    def _longest_wait(self) -> float:
        if self._mean is None:
            return self._timeouts.response
        return min(2 * max(self._timeouts.item, self._shortest_wait()), self._timeouts.response)
