"""How long a message takes to the vehicle and back, and how fast the vehicle's clock runs."""

from collections import deque
from statistics import median

from faao_mav.mavlink.messages import Timesync

_KEPT, _LONGEST = 9, 1.0
"""How many round trips on the link are kept, one each half second, whose median counts; and the
most that counts, s. Chosen."""


class RoundTrips:
    """What the answers to TIMESYNC tell; before the second one a round trip takes no time."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, int, float]] = deque(maxlen=_KEPT)

    def hear(self, answer: Timesync, now: float) -> None:
        """Take note of an answer, which has our own time when it was asked in `ts1`, ns."""
        asked = answer.ts1 / 1e9
        if answer.tc1 and 0 < asked <= now:
            self._kept.append((now, answer.tc1, now - asked))

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
