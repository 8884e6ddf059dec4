"""The least speed ||v_n|| >= v_min: slacks and multipliers for the interior-point method.

The limit is not convex. About v_n it is u^T v >= v_min with u = v_n / ||v_n||, a half-plane that
lies inside the true set: a step that keeps the linear slack keeps the true one, which is larger.
The half-planes turn with every step (successive convex approximation, one Newton step each).
Without a least speed, and where v_n is given, slot n is off: s = 1, z = 0, and nothing pulls.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real

_INSIDE = 1e-6  # the solver's least speed is larger by this share, to end inside the true one
_SMALLEST = 1e-9  # a speed whose direction is not to be divided by


@dataclass(frozen=True, slots=True)
class Slow:
    """s = ||v|| - `least` + margin, its multiplier z, and the direction u, scaled speeds.

    `on` (n,) is one where the limit holds; s, z, margin (n,), u (n, 2).
    """

    least: float
    on: Real
    s: Real
    z: Real
    margin: Real
    u: Real

    @classmethod
    def begin(cls, v: Real, least: float, moves: Real, mu: float) -> "Slow":
        """Return centred slacks at v (n, 2), widened where v has little or none."""
        least *= 1 + _INSIDE
        on = moves * float(least > 0)
        margin = on * np.maximum(0, 1.1 * least - np.hypot(*v.T))
        empty = np.zeros(len(v))
        return cls(least, on, empty, empty, margin, empty).moved(v, 0.0, empty).centred(mu)

    def moved(self, v: Real, length: float, z: Real) -> "Slow":
        """Return the slacks at v after the share `length` of a step, with new multipliers."""
        size, margin = np.hypot(*v.T), self.margin * (1 - length)
        u = v / np.maximum(size, _SMALLEST)[:, None] * self.on[:, None]
        s = np.where(self.on > 0, size - self.least + margin, 1.0)
        return replace(self, s=s, z=z, margin=margin, u=u)

    def linear(self, length: float, ds: Real, dz: Real) -> "Slow":
        """Return the linear slacks and multipliers after the share `length` of a step."""
        return replace(self, s=self.s + length * ds * self.on, z=self.z + length * dz)

    def centred(self, mu: float) -> "Slow":
        """Return the same slacks with the multipliers that go with `mu`."""
        return replace(self, z=mu * self.on / self.s)

    def forces(self) -> Real:
        """Return what the limit does to v: u z, (n, 2)."""
        return self.u * self.z[:, None]

    def stiffness(self) -> Real:
        """Return z / s u u^T, packed (n, 3). The curvature of ||v|| is left out: it misleads."""
        x, y = self.u.T
        return np.asarray((self.z / self.s * np.stack([x * x, x * y, y * y])).T)

    def slope(self, dv: Real) -> Real:
        """Return the change of the linear slack along dv, (n,)."""
        return np.asarray((self.u * dv).sum(axis=1) - self.margin)

    def raised(self, ds: Real, mu: float, correction: Real) -> Real:
        """Return the new multipliers: z+ + z / s ds = (mu - correction) / s, (n,)."""
        return np.asarray((self.on * mu - correction - self.z * ds) / self.s)

    def reach(self, ds: Real, dz: Real) -> float:
        """Return the share of a step at which a slack or a multiplier vanishes."""
        moving = np.maximum(self.z, np.finfo(float).tiny)
        falls = max(float((-ds * self.on / self.s).max()), float((-dz * self.on / moving).max()))
        return 1 / falls if falls > 0 else np.inf
