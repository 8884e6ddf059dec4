"""What the flight of an aircraft that is slow to change its speed becomes at other speeds."""

import numpy as np

from faao_mav.arrays import Real
from faao_mav.schedule.retimed import Retimed
from faao_mav.schedule.schedule import Schedule
from faao_mav.vector import lengths
from faao_mav.vehicle.vehicle_type import SpeedRates

_CHANGE = 0.05  # the change of a command, m/s, that tells a slope; chosen
# The share of the demand's greatest fall that is reckoned with: on predicted flights ArduPlane's
# airspeed falls by 0.43 to 0.79 m/s² while its demand falls by 0.80.
_FALL_SHARE = 0.6
_SLOWEST = 1.0  # the least speed over ground, m/s, that is reckoned with; chosen


class RampedRetimed(Retimed):
    """The flight of an aircraft whose speed takes longer to change than a leg lasts.

    On each step of the path, of length ds, a true airspeed u is demanded; it goes to `ratio` times
    the leg's command no faster than `rates` say. With other commands another u' is demanded there:
    the aircraft then flies the step at ds/dt + u' - u over ground.
    """

    def __init__(self, schedule: Schedule, rates: SpeedRates, ratio: float) -> None:
        super().__init__(schedule)
        speeds = schedule.route.speeds
        self._rates, self._ratio, self.limits = rates, ratio, np.full(len(speeds), np.inf)
        self._lengths, self._durations = lengths(self._steps), np.diff(self._t)
        ground = self._lengths / self._durations
        self._beyond = ground - self._demanded(speeds[:, None], ground)[0][:, 0]

    def learn(self, after: Schedule) -> None:
        """Take in nothing: the next flight to retime tells all."""

    def _later(self, speeds: Real) -> Real:
        return self._delays(speeds[:, None])[:, 0]

    def _later_slopes(self, speeds: Real) -> Real:
        commands = np.hstack([speeds[:, None], speeds[:, None] + _CHANGE * np.eye(len(speeds))])
        delays = self._delays(commands)
        slopes: Real = (delays[:, 1:] - delays[:, :1]) / _CHANGE
        return slopes

    def _delays(self, speeds: Real) -> Real:
        """Return by how much later each sample is at the `speeds` (m - 1, n), (k, n), s."""
        longer = self._demanded(speeds)[1] - self._durations[:, None]
        return np.vstack([np.zeros_like(speeds[:1]), np.cumsum(longer, axis=0)])

    def _demanded(self, speeds: Real, ground: Real | None = None) -> tuple[Real, Real]:
        """Return the airspeed demanded on each step, m/s, and how long it takes, s: (k - 1, n).

        `speeds` (m - 1, n), m/s, are the commands. `ground` (k - 1,), m/s, is how fast the aircraft
        is over ground, if that is known.
        """
        goals, demand = self._ratio * speeds, self._ratio * speeds[0]
        demands, lasting = np.empty((2, len(self._lengths), speeds.shape[1]))
        for k, leg in enumerate(self._leg[:-1]):
            flown = demand + self._beyond[k] if ground is None else ground[k]
            demands[k], lasting[k] = demand, self._lengths[k] / np.maximum(flown, _SLOWEST)
            fall, rise = self._rates(demand)
            change = np.minimum(goals[leg] - demand, rise * lasting[k])
            demand = demand + np.maximum(change, -_FALL_SHARE * fall * lasting[k])
        return demands, lasting
