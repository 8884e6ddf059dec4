"""Many discs ||x|| <= s_0 at once, as second-order cones with Nesterov-Todd scaling.

A point of the m cones of each flight is (3, flights, m): s = (s_0, x) with s_0 > ||x||; slacks s
and multipliers z together are (3, 2, flights, m). Products are those of the Jordan algebra,
s o z = (s^T z, s_0 z_1 + z_0 s_1); det s = s_0^2 - ||s_1||^2; the barrier is -log det s.
Source: Vandenberghe, "The CVXOPT linear and quadratic cone program solvers", 2010.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real

_TINY = float(np.finfo(float).tiny)


def determinant(s: Real) -> Real:
    """Return s_0^2 - ||s_1||^2, (..., flights, m)."""
    size = np.sqrt(s[1] * s[1] + s[2] * s[2])
    return np.asarray((s[0] - size) * (s[0] + size))


def inverse(s: Real) -> Real:
    """Return s^-1 = (s_0, -s_1) / det s: minus half the gradient of the barrier."""
    return _flipped(s / determinant(s))


def reach(s: Real, step: Real) -> Real:
    """Return the largest alpha with s + alpha step in every cone, (..., flights, 1).

    It is huge, not infinite, where any will do.
    """
    second, crossed = step[0] * step[0], s[0] * step[0]
    second -= step[1] * step[1] + step[2] * step[2]
    crossed -= s[1] * step[1] + s[2] * step[2]
    constant = determinant(s)
    root = crossed * crossed - second * constant
    # the least positive root of second a^2 + 2 crossed a + constant, free of cancellation
    rate = np.where(root >= 0, (np.sqrt(np.maximum(root, 0)) - crossed) / constant, -1.0)
    return np.asarray(1 / np.maximum(rate.max(axis=-1, keepdims=True), _TINY))


@dataclass(frozen=True, slots=True)
class Scaling:
    """The symmetric W with W z = W^-1 s, for s and z inside the cones.

    W = eta [[w_0, w_1^T], [w_1, I + w_1 w_1^T / (1 + w_0)]], det w = 1: `point` is w, (3, flights,
    m), `stiffness` eta^-2 and `stretch` 1 + 2 ||w_1||^2, (flights, m). `curvature` is the block
    of W^-2 for x, as (xx, xy, yy), (3, flights, m).
    """

    z: Real
    point: Real
    stiffness: Real
    stretch: Real
    curvature: Real

    @classmethod
    def between(cls, pair: Real) -> "Scaling":
        """Return the scaling for s and z (3, 2, flights, m)."""
        size = np.sqrt(determinant(pair))
        s, opposite = (pair / size).swapaxes(0, 1)
        opposite = _flipped(opposite)
        w = s + opposite
        # det w is that of s and z, 1 each, and twice s^T z
        w /= np.sqrt(2 + 2 * (s[0] * opposite[0] - s[1] * opposite[1] - s[2] * opposite[2]))
        stiffness = size[1] / size[0]
        _, x, y = w
        curvature = np.empty_like(w)
        curvature[0], curvature[1], curvature[2] = x * x, x * y, y * y
        curvature *= 2 * stiffness
        stretch = 1 + 2 * (x * x + y * y)
        curvature[::2] += stiffness
        return cls(pair[:, 1], w, stiffness, stretch, curvature)

    def give(self) -> Real:
        """Return the inverse of `curvature`, (3, flights, m)."""
        found = self.curvature[::-1] / (self.stiffness * self.stiffness * self.stretch)
        found[1] *= -1
        return np.asarray(found)

    def lean(self) -> Real:
        """Return the column of W^-2 from s_0 to x, (2, flights, m)."""
        return np.asarray((-2 * self.stiffness * self.point[0]) * self.point[1:])

    def radial(self, target: Real | None, ds_0: Real, z_1: Real) -> Real:
        """Return the z_0 of a new z_1 (2, flights, m) under z + W^-2 ds = target, or 0 for None.

        It avoids W^-2 ds_1, which loses every digit where a limit is active.
        """
        w, weight = self.point, self.stiffness * ds_0
        push = (2 * w[0] * weight) * w[1:] - z_1
        if target is not None:
            push += target[1:]
        found = 2 * w[0] / self.stretch * (w[1] * push[0] + w[2] * push[1])
        found -= self.stretch * weight
        return np.asarray(found if target is None else found + target[0])

    def second_order(self, ds: Real, dz: Real) -> Real:
        """Return W^-1 (l^-1 o (W^-1 ds o W dz)), l = W z: Mehrotra's correction."""
        # three eta cancel but for eta^-2
        scaled = self._apply(self.z, 1)
        a, b = self._apply(ds, -1), self._apply(dz, 1)
        p = a[0] * b + b[0] * a
        p[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        first = (scaled[0] * p[0] - scaled[1] * p[1] - scaled[2] * p[2]) / determinant(scaled)
        p -= first * scaled
        p /= scaled[0]
        p[0] = first
        return np.asarray(self.stiffness * self._apply(p, -1))

    def _apply(self, x: Real, power: int) -> Real:
        """Return W x or W^-1 x without its eta."""
        w = self.point
        along = w[1] * x[1] + w[2] * x[2]
        found = (along / (1 + w[0]) + power * x[0]) * w
        found += x
        found[0] = w[0] * x[0] + power * along
        return np.asarray(found)


def _flipped(s: Real) -> Real:
    """Turn the x of s round, in place."""
    s[1:] *= -1
    return s
