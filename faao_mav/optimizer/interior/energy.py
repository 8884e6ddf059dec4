"""The energy that a flight may take: sum_n P(v_n, a_n) delta_t <= E, one inequality for it all.

P is smooth but not convex: a copter that hovers takes more than one that flies slowly.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.constraint import (
    A,
    Constraint,
    Grid,
    Rows,
    StartStrategy,
    V,
    unknowns,
)
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.plan import Vector
from faao_mav.power import PowerModel, PowerPartials


@dataclass(frozen=True)
class EnergyLimit(Constraint):
    """At most `most` J for flying at the speeds v_n through air that moves with `wind`, m/s.

    With b_n, what is left of the energy for the slots before n, and u_n, what slot n leaves of it,
    both in shares of a slot's even part P_0:

        u_n <= 1 - P(v_n, a_n) / P_0,   b_{n+1} = b_n + u_n,   b_0 = 0,   b_{N+2} / (N + 2) >= 0
    """

    model: PowerModel
    most: float
    time_step: float
    max_speed: float
    max_acceleration: float
    wind: Vector = (0.0, 0.0)
    of = V + A
    own = 2
    after = np.eye(1, 2)
    before = np.ones((1, 2))

    def begin(self, x: Real, strategy: StartStrategy) -> Real:
        """Return b and u."""
        u = self._left(x)[0] - strategy.room * self.headroom
        return np.stack([np.cumsum(u) - u, u])

    def free(self, slots: int) -> Flags:
        """Return that b_0 is given."""
        free = super().free(slots)
        free[0, 0] = False
        return free

    def on(self, grid: Grid, rows: int) -> Flags:
        """Return that the sum is limited at the end."""
        on = np.ones((rows, grid.slots), dtype=np.bool_)
        on[1, :-1] = False
        return on

    def rows(self, x: Real) -> Rows:
        """Return what is left of u_n and in the end."""
        n, left = x.shape[1], self._left(x[:4])
        slope, bend = np.zeros((2, 6, n)), np.zeros((2, 6, 6, n))
        slope[0, :4], bend[0, :4, :4] = left[1], left[2]
        slope[0, 5], slope[1, 4:] = -1, 1 / n
        return Rows(np.stack([left[0] - x[5], (x[4] + x[5]) / n]), slope, bend)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return by how much more `flight` takes, in shares of the limit."""
        return max(0.0, -float(self._left(unknowns(kin, flight)[list(self.of)])[0].mean()))

    def _left(self, x: Real) -> tuple[Real, Real, Real]:
        """Return what slots leave of their even parts at v_n, a_n (4, n), with derivatives."""
        power = self.partials(self.max_speed * x[:2], self.max_acceleration * x[2:])
        unit = self.time_step * x.shape[1] / self.most
        scale = np.repeat([self.max_speed, self.max_acceleration], 2)
        slope = np.concatenate([power.by_v, power.by_a]) * scale[:, None]
        bend = np.empty((4, 4, x.shape[1]))
        for first, packed in ((0, power.by_vv), (2, power.by_aa)):
            bend[first, first], bend[first + 1, first + 1] = packed[0], packed[2]
            bend[first, first + 1] = bend[first + 1, first] = packed[1]
        bend[:2, 2:] = power.by_va
        bend[2:, :2] = power.by_va.swapaxes(0, 1)
        bend *= scale[:, None, None] * scale[:, None]
        return 1 - unit * power.value, -unit * slope, -unit * bend

    def partials(self, v: Real, a: Real) -> PowerPartials:
        """Return the power, W, at v over ground and a, (2, ...), m/s, m/s^2, with derivatives."""
        return self.model.partials(v - np.reshape(self.wind, (2, *[1] * (v.ndim - 1))), a)

    def used(self, flight: Trajectory) -> float:
        """Return what `flight` takes, J."""
        return self.time_step * float(self.partials(flight.v.T, flight.a.T).value.sum())
