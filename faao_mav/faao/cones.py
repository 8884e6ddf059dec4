"""Many discs ||x|| <= s_0 at once, as second-order cones with Nesterov-Todd scaling.

A point of m cones is (3, m): s = (s_0, x) with s_0 > ||x||. Products are those of the Jordan
algebra, s o z = (s^T z, s_0 z_1 + z_0 s_1); det s = s_0^2 - ||s_1||^2; the barrier is -log det s.
Source: Vandenberghe, "The CVXOPT linear and quadratic cone program solvers", 2010.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Real


def determinant(s: Real) -> Real:
    """Return s_0^2 - ||s_1||^2, (m,)."""
    size = np.sqrt(s[1] * s[1] + s[2] * s[2])
    return np.asarray((s[0] - size) * (s[0] + size))


def inverse(s: Real) -> Real:
    """Return s^-1 = (s_0, -s_1) / det s: minus half the gradient of the barrier."""
    return np.asarray(np.stack([s[0], -s[1], -s[2]]) / determinant(s))


def reach(s: Real, step: Real) -> float:
    """Return the largest alpha for which s + alpha step stays in every cone; inf if all do."""
    second = step[0] * step[0] - step[1] * step[1] - step[2] * step[2]
    first = s[0] * step[0] - s[1] * step[1] - s[2] * step[2]
    constant = determinant(s)
    root = first * first - second * constant
    # the least positive root of second a^2 + 2 first a + constant, free of cancellation
    rate = np.where(root >= 0, np.sqrt(np.maximum(root, 0)) - first, -1.0) / constant
    fastest = float(rate.max())
    return 1 / fastest if fastest > 0 else np.inf


@dataclass(frozen=True)
class Scaling:
    """The symmetric W with W z = W^-1 s, from s and z (3, m) inside the cones.

    W = eta [[w_0, w_1^T], [w_1, I + w_1 w_1^T / (1 + w_0)]], det w = 1.
    """

    s: Real
    z: Real

    @cached_property
    def stiffness(self) -> Real:
        """eta^-2, (m,)."""
        return np.asarray(np.sqrt(determinant(self.z) / determinant(self.s)))

    @cached_property
    def point(self) -> Real:
        """The scaling point w, (3, m)."""
        s, z = self.s / np.sqrt(determinant(self.s)), self.z / np.sqrt(determinant(self.z))
        w = np.stack([s[0] + z[0], s[1] - z[1], s[2] - z[2]])
        w /= np.sqrt(2 + 2 * (s * z).sum(axis=0))
        return np.asarray(w)

    @cached_property
    def curvature(self) -> Real:
        """The block of W^-2 for x, as (xx, xy, yy), (m, 3)."""
        _, x, y = self.point
        return np.asarray((self.stiffness * np.stack([1 + 2 * x * x, 2 * x * y, 1 + 2 * y * y])).T)

    @cached_property
    def give(self) -> Real:
        """The inverse of `curvature`, (m, 3)."""
        _, x, y = self.point
        both = np.stack([1 + 2 * y * y, -2 * x * y, 1 + 2 * x * x])
        return np.asarray((both / (self.stiffness * (1 + 2 * x * x + 2 * y * y))).T)

    @cached_property
    def lean(self) -> Real:
        """The column of W^-2 from s_0 to x, (2, m)."""
        return np.asarray(-2 * self.stiffness * self.point[0] * self.point[1:])

    def radial(self, target: Real, ds_0: Real, z_1: Real) -> Real:
        """Return the z_0 that goes with a new z_1 (2, m) under z + W^-2 ds = target, (m,).

        It avoids W^-2 ds_1, which loses every digit where a limit is active.
        """
        w = self.point
        outward = w[1] * w[1] + w[2] * w[2]
        push = target[1:] - self.lean * ds_0 - z_1
        along = (w[1] * push[0] + w[2] * push[1]) / (1 + 2 * outward)
        return np.asarray(target[0] - self.stiffness * (1 + 2 * outward) * ds_0 + 2 * w[0] * along)

    def second_order(self, ds: Real, dz: Real) -> Real:
        """Return W^-1 (l^-1 o (W^-1 ds o W dz)), l = W z: Mehrotra's correction, (3, m)."""
        scaled = self._apply(self.z, 1)
        a, b = self._apply(ds, -1), self._apply(dz, 1)
        p = a[0] * b + b[0] * a
        p[0] = (a * b).sum(axis=0)
        u = np.empty_like(p)
        u[0] = (scaled[0] * p[0] - scaled[1] * p[1] - scaled[2] * p[2]) / determinant(scaled)
        u[1:] = (p[1:] - u[0] * scaled[1:]) / scaled[0]
        return self._apply(u, -1)

    def _apply(self, x: Real, power: int) -> Real:
        """Return W x or W^-1 x."""
        w = self.point
        along = w[1] * x[1] + w[2] * x[2]
        found = x + (along / (1 + w[0]) + power * x[0]) * w
        found[0] = w[0] * x[0] + power * along
        root = np.sqrt(self.stiffness)
        return np.asarray(found / root if power > 0 else found * root)
