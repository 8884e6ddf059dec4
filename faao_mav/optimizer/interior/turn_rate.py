"""How fast a path may turn: the guidance follows at most an angle per second, over ground.

With a_n = (v_{n+1} - v_n) / delta_t, at most omega, rad/s, and the speed c_n that counts in a turn,
c_n^2 = (||v_n||^2 + ||v_{n+1}||^2) / 2 + ||u||^2 / 3 in the wind u, as `Kinematics` says, each slot
keeps

    (omega^2 c_n^2 - ||a_n||^2) / 2 >= 0
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import ScaledFlight
from faao_mav.optimizer.interior.neighbours import Neighbours
from faao_mav.optimizer.kinematics import Kinematics, Trajectory


@dataclass(frozen=True)
class TurnRate(Neighbours):
    """An acceleration in a_max is at most `per_speed` times the speed in v_max.

    `wind` is the squared speed that counts at no speed over ground, in v_max^2.
    """

    per_speed: float
    wind: float

    def hold(self, flight: ScaledFlight) -> float:
        """Return the curvature of ||a_n||^2 / 2 by v_{n+1} - v_n."""
        return flight.gain**2

    def expanded(self, flight: ScaledFlight, v: Real) -> tuple[Real, Real, Real]:
        """Return the limit with its derivatives."""
        ends, half = np.stack([v[..., :-1], v[..., 1:]]), self.per_speed**2 / 2
        change, square = ends[1] - ends[0], (ends * ends).sum(axis=(0, 1))
        fast, turned = half * (square + 2 * self.wind), self.hold(flight) * change
        slopes = half * ends + np.stack([turned, -turned])
        bends = np.zeros((2, 3, 1, *square.shape))
        bends[:, ::2] = half
        return (fast - (turned * change).sum(axis=0))[None] / 2, slopes[:, :, None], bends

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest violation, relative to a_max."""
        return kin.residuals(flight)["turn"] / kin.max_acceleration


def turn_rate(kin: Kinematics) -> TurnRate:
    """Return the limit of `kin` on turns."""
    per_speed = kin.most_turn * kin.max_speed / kin.max_acceleration
    return TurnRate(per_speed, kin.wind_in_turns**2 / kin.max_speed**2)
