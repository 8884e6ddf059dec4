"""How long a message takes to the vehicle and back, and how fast the vehicle's clock runs."""

from collections import deque
from statistics import median

from faao_mav.mavlink.messages import Timesync

_KEPT, _LONGEST = 9, 1.0
"""How many round trips on the link are kept, one each half second, whose median counts; and the
most that counts, s. Chosen."""


class RoundTrips:
    """What the answers to TIMESYNC tell; before the second one a round trip takes no time.

    Only those to own questions count: vehicles tell everybody what they answer to anybody.
    """

    def __init__(self) -> None:
        self._asked: deque[int] = deque(maxlen=_KEPT)
        self._kept: deque[tuple[float, int, float]] = deque(maxlen=_KEPT)

    def ask(self, now: float) -> Timesync:
        """Return the question, with the time `now` in it, which the answer repeats."""
        self._asked.append(int(now * 1e9))
        return Timesync(0, self._asked[-1])

    def hear(self, answer: Timesync, now: float) -> None:
        """Take note of an answer."""
        if answer.tc1 and answer.ts1 in self._asked:
            self._kept.append((now, answer.tc1, now - answer.ts1 / 1e9))

    @property
    def clock_speed(self) -> float:
        """How many seconds of the vehicle's clock a second of the world's has."""
        if len(self._kept) < 2:
            return 1.0
        (first, there_first, _), (last, there_last, _) = self._kept[0], self._kept[-1]
        return max((there_last - there_first) / 1e9 / max(last - first, 1e-9), 0.0)

    @property
    def lasting(self) -> float:
        """How long a round trip takes, s of the vehicle's clock."""
        if len(self._kept) < 2:
            return 0.0
        trip = median(trip for _, _, trip in self._kept)
        return min(self.clock_speed * trip, _LONGEST)
