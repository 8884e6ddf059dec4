"""How long a message takes to the vehicle and back, and what the vehicle's clock reads."""

from collections import deque
from statistics import median
from typing import NamedTuple

from faao_mav.wire.messages import Timesync

_KEPT, _LONGEST = 9, 1.0
"""How many round trips on the link are kept, one each half second, whose median counts; and the
most that counts, s. Chosen."""

_ANOTHER_CLOCK = 60.0
"""From so many seconds of the world on a time is one of another clock than the answers'; chosen."""


class _Trip(NamedTuple):
    """A round trip: when we were in the middle of it, and what the vehicle's clock read, s."""

    middle: float
    there: float


class RoundTrips:
    """What the answers to TIMESYNC tell; before the second one a round trip takes no time.

    Only those to own questions count: vehicles tell everybody what they answer to anybody.
    """

    def __init__(self) -> None:
        self._asked: deque[int] = deque(maxlen=_KEPT)
        self._kept: deque[float] = deque(maxlen=_KEPT)
        self._prompt: deque[_Trip] = deque(maxlen=_KEPT)

    def ask(self, now: float) -> Timesync:
        """Return the question, with the time `now` in it, which the answer repeats."""
        self._asked.append(int(now * 1e9))
        return Timesync(0, self._asked[-1])

    def hear(self, answer: Timesync, now: float) -> None:
        """Take note of an answer."""
        asked = answer.ts1 / 1e9
        if answer.tc1 and answer.ts1 in self._asked:
            self._kept.append(now - asked)
            if now - asked <= _LONGEST:
                self._prompt.append(_Trip((asked + now) / 2, answer.tc1 / 1e9))

    @property
    def clock_speed(self) -> float:
        """How many seconds of the vehicle's clock a second of the world's has."""
        if len(self._prompt) < 2:
            return 1.0
        first, last = self._prompt[0], self._prompt[-1]
        return max((last.there - first.there) / max(last.middle - first.middle, 1e-9), 0.0)

    @property
    def lasting(self) -> float:
        """How long a round trip takes, s of the vehicle's clock."""
        if len(self._kept) < 2:
            return 0.0
        return min(self.clock_speed * median(self._kept), _LONGEST)

    def age(self, t: float, now: float) -> float:
        """Return how long ago, s of the world, the vehicle's clock read `t`, s; 0: not known."""
        if len(self._prompt) < 2:
            return 0.0
        last = self._prompt[-1]
        age = now - last.middle + (last.there - t) / max(self.clock_speed, 1e-3)
        return age if 0 < age < _ANOTHER_CLOCK else 0.0
