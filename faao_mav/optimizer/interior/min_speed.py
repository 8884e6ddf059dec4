"""The least speed ||v_n|| >= v_min: slacks and multipliers for the interior-point method.

The limit is not convex. About v_n it is u^T v >= v_min with u = v_n / ||v_n||, a half-plane that
lies inside the true set: a step that keeps the linear slack keeps the true one, which is larger.
The half-planes turn with every step (successive convex approximation, one Newton step each).
Where v_n is given, slot n is off: s = 1, z = 0, and nothing pulls.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real

_INSIDE = 1e-6  # the solver's least speed is larger by this share, to end inside the true one
_SMALLEST = 1e-9  # a speed whose direction is not to be divided by
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, slots=True)
class Slow:
    """s = ||v|| - `least` + margin, its multiplier z, and the direction u, scaled speeds.

    `on` is one where the limit holds. on, s, z, margin (flights, n), u (2, flights, n).
    """

    least: float
    on: Real
    s: Real
    z: Real
    margin: Real
    u: Real

    @classmethod
    def begin(cls, v: Real, least: float, moves: Real, mu: Real | float) -> "Slow":
        """Return centred slacks at v (2, flights, n), widened where v has little or none."""
        least *= 1 + _INSIDE
        on = np.broadcast_to(moves, v.shape[1:])
        margin = on * np.maximum(0, 1.1 * least - np.hypot(*v))
        empty = np.zeros(v.shape[1:])
        return cls(least, on, empty, empty, margin, empty).moved(v, 0.0, empty).centred(mu)

    def moved(self, v: Real, length: Real | float, dz: Real) -> "Slow":
        """Return the slacks at v after the share `length` of a step that changes z by `dz`."""
        size, margin = np.hypot(*v), self.margin * (1 - length)
        u = v * (self.on / np.maximum(size, _SMALLEST))
        s = np.where(self.on > 0, size - self.least + margin, 1.0)
        return replace(self, s=s, z=self.z + length * dz, margin=margin, u=u)

    def centred(self, mu: Real | float) -> "Slow":
        """Return the same slacks with the multipliers that go with `mu`."""
        return replace(self, z=mu * self.on / self.s)

    def gap(self, length: Real | float, ds: Real | float, dz: Real | float) -> Real:
        """Return the sum of s z after the share `length` of a linear step, (flights, 1)."""
        both = (self.s + length * ds * self.on) * (self.z + length * dz)
        return np.asarray(both.sum(axis=-1, keepdims=True))

    def held(self) -> Real:
        """Return how many slots the limit holds in, (flights, 1)."""
        return np.asarray(self.on.sum(axis=-1, keepdims=True))

    def forces(self) -> Real:
        """Return what the limit does to v: u z, (2, flights, n)."""
        return self.u * self.z

    def stiffness(self) -> Real:
        """Return z / s u u^T, (3, flights, n). The curvature of ||v|| is left out: it misleads."""
        x, y = self.u
        return np.asarray(self.z / self.s * np.stack([x * x, x * y, y * y]))

    def slope(self, dv: Real) -> Real:
        """Return the change of the linear slack along dv, (flights, n)."""
        return np.asarray((self.u * dv).sum(axis=0) - self.margin)

    def raised(self, ds: Real, mu: Real | float, correction: Real | float) -> Real:
        """Return the new multipliers: z+ + z / s ds = (mu - correction) / s, (flights, n)."""
        return np.asarray((self.on * mu - correction - self.z * ds) / self.s)

    def push(self, mu: Real | float, correction: Real | float) -> Real:
        """Return the forces on v, (2, flights, n), of new multipliers where v does not change."""
        return self.u * self.raised(-self.margin, mu, correction)

    def reach(self, ds: Real, dz: Real) -> Real:
        """Return the share of a step at which a slack or a multiplier vanishes, (flights, 1)."""
        moving = np.maximum(self.z, _TINY)
        falls = np.maximum(-ds * self.on / self.s, -dz * self.on / moving)
        return np.asarray(1 / np.maximum(falls.max(axis=-1, keepdims=True), _TINY))
