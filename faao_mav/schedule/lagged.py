"""What the flight of an aircraft becomes at other speeds that follows its commands with a lag."""

import numpy as np

from faao_mav.arrays import Real
from faao_mav.plan import Vector
from faao_mav.schedule.retimed import Retimed
from faao_mav.schedule.schedule import Schedule
from faao_mav.vector import lengths

_LAG = 2.0
"""The time constant with which a plane's airspeed follows its command, s. Predicted steps of the
command by 0.5 to 3 m/s lag 0.6 to 1.3 s behind where they rise, 2.7 to 4.9 s where they fall."""

_SLOWEST = 1.0
"""The least speed over ground, m/s, that is reckoned with. Chosen."""


class LaggedRetimed(Retimed):
    """The flight of an aircraft whose airspeed takes longer to change than a leg lasts.

    A command that is higher by c from t_1 to t_2 raises the true airspeed by r c (h(t - t_1) -
    h(t - t_2)), with h(t) = 1 - exp(-t / `_LAG`) and `ratio` r of true over commanded airspeed. The
    speed over ground V changes by V_a / (V - u) times as much: V_a is the airspeed, u the part of
    the `wind` along the way.
    """

    def __init__(self, schedule: Schedule, ratio: float, wind: Vector) -> None:
        super().__init__(schedule)
        self._speeds = schedule.route.speeds
        self.limits = np.full(len(self._speeds), np.inf)
        self._durations, self._ways = np.diff(self._t), lengths(self._steps)
        middle = (self._t[1:] + self._t[:-1])[:, None] / 2
        heeded = -np.expm1(-np.maximum(middle - schedule.flown.arrivals, 0) / _LAG)
        heeded[:, 0] = 1.0  # from before the flight begins
        ground = self._steps / self._durations[:, None]
        airspeed, square = lengths(ground - wind), (ground * ground).sum(axis=1)
        along = np.maximum(square - ground @ np.array(wind), _SLOWEST**2)
        share = ratio * airspeed * np.sqrt(square) / along
        self._gains = share[:, None] * (heeded[:, :-1] - heeded[:, 1:])

    def _later(self, speeds: Real) -> Real:
        longer = self._ways / self._flown(speeds) - self._durations
        return np.concatenate([[0.0], np.cumsum(longer)])

    def _later_slopes(self, speeds: Real) -> Real:
        longer = -(self._ways / self._flown(speeds) ** 2)[:, None] * self._gains
        return np.vstack([np.zeros_like(speeds), np.cumsum(longer, axis=0)])

    def _flown(self, speeds: Real) -> Real:
        """Return the speeds over ground (k - 1,) with the commands `speeds` (m - 1,), m/s."""
        ground = self._ways / self._durations + self._gains @ (speeds - self._speeds)
        flown: Real = np.maximum(ground, _SLOWEST)
        return flown
