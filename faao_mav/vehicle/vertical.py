"""Climbs and descents outside waypoint flight: take-off, return to launch, landing."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class VerticalProfile:
    """How fast a vehicle climbs and descends (m/s, m/s²), and how it returns to launch.

    A take-off takes `spool` seconds before it climbs; the last `landing_height` metres of a landing
    are flown at `landing_speed`. A return climbs to `return_height`, m above home; one that
    `keeps_height` never descends for it. `lands_on_return`: the return ends on the ground, else the
    vehicle goes on circling over home.
    """

    take_off_speed: float
    climb_speed: float
    descent_speed: float
    acceleration: float
    landing_speed: float
    landing_height: float
    return_height: float
    spool: float
    keeps_height: bool = True
    lands_on_return: bool = True

    def take_off(self, height: float) -> float:
        """Return how long a take-off to `height` (m) takes, s."""
        return self.spool + self._ramped(height, self.take_off_speed)

    def climb(self, height: float) -> float:
        """Return how long a climb of `height` (m) takes, s."""
        return self._ramped(height, self.climb_speed)

    def descend(self, height: float) -> float:
        """Return how long the way down to the ground takes, s."""
        slow = min(max(height, 0.0), self.landing_height)
        return slow / self.landing_speed + self._ramped(height - slow, self.descent_speed)

    def returns_at(self, height: float) -> float:
        """Return the height, m above home, at which it returns from `height`."""
        return max(height, self.return_height) if self.keeps_height else self.return_height

    def _ramped(self, height: float, speed: float) -> float:
        return height / speed + speed / self.acceleration if height > 0 else 0.0
