"""Many discs ||x|| <= s_0 at once, as second-order cones with Nesterov-Todd scaling.

An element of the m cones of each flight is (3, flights, m): s = (s_0, x) with s_0 > ||x||; slacks
s and multipliers z together are a pair (3, 2, flights, m). Products are those of the Jordan
algebra, s o z = (s^T z, s_0 z_1 + z_0 s_1); det s = s_0^2 - ||s_1||^2; the barrier is -log det s.
Source: Vandenberghe, "The CVXOPT linear and quadratic cone program solvers", 2010.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real

TINY = float(np.finfo(float).tiny)
"""The smallest normal number: keeps a quotient finite where its denominator may be zero."""


def determinant(s: Real) -> Real:
    """Return det s = s_0^2 - ||s_1||^2, (..., flights, m), from s (3, ..., flights, m).

    >>> float(determinant(np.array([5.0, 3.0, 0.0])))
    16.0
    """
    size = np.sqrt(s[1] * s[1] + s[2] * s[2])
    return np.asarray((s[0] - size) * (s[0] + size))


def inverse(s: Real) -> Real:
    """Return s^-1 = (s_0, -s_1) / det s, minus half the gradient of the barrier, shaped as s."""
    return _reflected(s / determinant(s))


def reach(s: Real, ds: Real) -> Real:
    """Return the largest alpha with s + alpha ds in every cone, (..., flights, 1).

    Where any alpha will do it is huge, not infinite.
    """
    second, crossed = ds[0] * ds[0], s[0] * ds[0]
    second -= ds[1] * ds[1] + ds[2] * ds[2]
    crossed -= s[1] * ds[1] + s[2] * ds[2]
    constant = determinant(s)
    root = crossed * crossed - second * constant
    # the least positive root of second a^2 + 2 crossed a + constant, free of cancellation
    rate = np.where(root >= 0, (np.sqrt(np.maximum(root, 0)) - crossed) / constant, -1.0)
    return np.asarray(1 / np.maximum(rate.max(axis=-1, keepdims=True), TINY))


@dataclass(frozen=True, slots=True)
class Scaling:
    """The symmetric matrix W with W z = W^-1 s, for s and z inside the cones.

    W = eta [[w_0, w_1^T], [w_1, I + w_1 w_1^T / (1 + w_0)]] with det w = 1: `w` (3, flights, m),
    `per_square` = eta^-2 and `stretch` = 1 + 2 ||w_1||^2, (flights, m). The lower right block of
    W^-2, which belongs to x, is `stiffness`: its entries xx, xy, yy, (3, flights, m).
    """

    z: Real
    w: Real
    per_square: Real
    stretch: Real
    stiffness: Real

    @classmethod
    def between(cls, pair: Real) -> "Scaling":
        """Return the scaling for the slacks and multipliers `pair` (3, 2, flights, m)."""
        size = np.sqrt(determinant(pair))
        s, reflected = (pair / size).swapaxes(0, 1)
        reflected = _reflected(reflected)
        w = s + reflected
        # det w is that of s and z, 1 each, and twice s^T z
        w /= np.sqrt(2 + 2 * (s[0] * reflected[0] - s[1] * reflected[1] - s[2] * reflected[2]))
        per_square = size[1] / size[0]
        _, x, y = w
        stiffness = np.empty_like(w)
        stiffness[0], stiffness[1], stiffness[2] = x * x, x * y, y * y
        stiffness *= 2 * per_square
        stretch = 1 + 2 * (x * x + y * y)
        stiffness[::2] += per_square
        return cls(pair[:, 1], w, per_square, stretch, stiffness)

    def compliance(self, chosen: slice = slice(None)) -> Real:
        """Return the inverse of `stiffness` for the `chosen` cones, (3, flights, their number).

        It is exact where a limit is active too.
        """
        per_square = self.per_square[..., chosen]
        size = per_square * per_square * self.stretch[..., chosen]
        inverted = self.stiffness[::-1, :, chosen] / size
        inverted[1] *= -1
        return np.asarray(inverted)

    def coupling(self) -> Real:
        """Return the column of W^-2 from s_0 to x, (2, flights, m)."""
        return np.asarray((-2 * self.per_square * self.w[0]) * self.w[1:])

    def radial(self, target: Real | None, ds_0: Real, z_1: Real) -> Real:
        """Return the z_0 (flights, m) that goes with z_1 (2, flights, m) in z + W^-2 ds = target.

        A `target` of None is zero. W^-2 ds_1, which loses every digit where a limit is active, is
        not formed.
        """
        w, weight = self.w, self.per_square * ds_0
        excess = (2 * w[0] * weight) * w[1:] - z_1
        if target is not None:
            excess += target[1:]
        z_0 = 2 * w[0] / self.stretch * (w[1] * excess[0] + w[2] * excess[1])
        z_0 -= self.stretch * weight
        return np.asarray(z_0 if target is None else z_0 + target[0])

    def second_order(self, ds: Real, dz: Real) -> Real:
        """Return Mehrotra's correction W^-1 (l^-1 o (W^-1 ds o W dz)), l = W z, shaped as ds."""
        # three eta cancel but for eta^-2
        scaled = self._apply(self.z, 1)
        a, b = self._apply(ds, -1), self._apply(dz, 1)
        p = a[0] * b + b[0] * a
        p[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        first = (scaled[0] * p[0] - scaled[1] * p[1] - scaled[2] * p[2]) / determinant(scaled)
        p -= first * scaled
        p /= scaled[0]
        p[0] = first
        return np.asarray(self.per_square * self._apply(p, -1))

    def _apply(self, x: Real, power: int) -> Real:
        """Return W x (`power` 1) or W^-1 x (`power` -1), both without the factor eta."""
        w = self.w
        along = w[1] * x[1] + w[2] * x[2]
        product = (along / (1 + w[0]) + power * x[0]) * w
        product += x
        product[0] = w[0] * x[0] + power * along
        return np.asarray(product)


def _reflected(s: Real) -> Real:
    """Return s with the sign of its x changed, in place."""
    s[1:] *= -1
    return s
