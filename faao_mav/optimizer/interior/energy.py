"""The energy that a flight may take: sum_n P(v_n, a_n) delta_t <= E, one inequality for it all.

P is smooth but not convex: a copter that hovers takes more than one that flies slowly.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import A, Constraint, Rows, V
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.power import PowerModel, PowerPartials


@dataclass(frozen=True)
class EnergyLimit(Constraint):
    """At most `most` J for a flight of `kin`: by `model`, of speeds through the air.

    g is what is left in shares of a slot's even part. The method leaves a share `inside` unused.
    """

    model: PowerModel
    most: float
    kin: Kinematics
    of = V + A
    total = True

    def rows(self, x: Real) -> Rows:
        """Return what each slot takes less than its even part."""
        scale = np.repeat([self.kin.max_speed, self.kin.max_acceleration], 2)
        power = self.partials(*np.split(scale[:, None] * x, 2))
        unit = self.kin.time_step * x.shape[1] / self.most
        slope = np.concatenate([power.by_v, power.by_a]) * scale[:, None]
        bend = np.empty((4, 4, x.shape[1]))
        for first, packed in ((0, power.by_vv), (2, power.by_aa)):
            bend[first, first], bend[first + 1, first + 1] = packed[0], packed[2]
            bend[first, first + 1] = bend[first + 1, first] = packed[1]
        bend[:2, 2:] = power.by_va
        bend[2:, :2] = power.by_va.swapaxes(0, 1)
        bend *= scale[:, None, None] * scale[:, None]
        return Rows((1 - unit * power.value)[None], -unit * slope[None], -unit * bend[None])

    def partials(self, v: Real, a: Real) -> PowerPartials:
        """Return the power, W, at v over ground and a, (2, ...), m/s, m/s^2, with derivatives."""
        return self.model.partials(v - np.reshape(self.kin.wind, (2, *[1] * (v.ndim - 1))), a)

    def used(self, flight: Trajectory) -> float:
        """Return what `flight` takes, J."""
        return self.kin.time_step * float(self.partials(flight.v.T, flight.a.T).value.sum())
