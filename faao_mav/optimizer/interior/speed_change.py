"""How fast an airspeed may change: thrust and drag limit it along the path, not across.

With the airspeed s_n = ||v_n - u|| in the wind u, at most a fall d, m/s^2, and at most a power P
per mass, m^2/s^3, that raises it, each slot keeps

    1 - (s_n - s_{n+1}) / (d delta_t) >= 0,  1 - (s_{n+1}^2 - s_n^2) / (2 P delta_t) >= 0
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.cones import TINY
from faao_mav.optimizer.interior.constraint import ScaledFlight
from faao_mav.optimizer.interior.neighbours import Neighbours
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.plan import Vector


@dataclass(frozen=True)
class SpeedChange(Neighbours):
    """In a slot the airspeed falls by at most `fall`, and half its square rises by `rise`.

    In v_max and its square; so is `wind`.
    """

    fall: float
    rise: float
    wind: Vector = (0.0, 0.0)

    def expanded(self, flight: ScaledFlight, v: Real) -> tuple[Real, Real, Real]:  # noqa: ARG002
        """Return both limits, that on the fall first, with their derivatives."""
        x = v - np.reshape(self.wind, (2, 1, 1))
        speed = np.maximum(np.hypot(*x), TINY)
        (east, north), change, sign = x / speed, np.diff(speed), np.array([1.0, -1.0])
        square = np.diff(speed**2) / 2
        across = np.stack([north * north, -east * north, east * east]) / speed
        level = np.broadcast_to(np.array([1.0, 0.0, 1.0])[:, None, None], across.shape)

        def by_ends(fall: Real, rise: Real) -> Real:
            """Return what both limits have of `fall` and `rise` (k, flights, n) at their ends."""
            rows = np.stack([-fall / self.fall, rise / self.rise], axis=1)
            ends = np.stack([rows[..., :-1], rows[..., 1:]])
            return np.asarray(ends * sign.reshape(2, *[1] * rows.ndim))

        return (
            np.stack([1 + change / self.fall, 1 - square / self.rise]),
            by_ends(x / speed, x),
            by_ends(across, level),
        )

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return the largest violation, relative to the limit."""
        missed = kin.residuals(flight)
        fall = missed["fall of airspeed"] / kin.most_fall
        return max(fall, missed["power of airspeed"] / kin.most_power)


def speed_change(kin: Kinematics) -> SpeedChange:
    """Return the limits of `kin` on the change of the airspeed."""
    east, north = (part / kin.max_speed for part in kin.wind)
    rise = kin.most_power * kin.time_step / kin.max_speed**2
    return SpeedChange(kin.most_fall * kin.time_step / kin.max_speed, rise, (east, north))
