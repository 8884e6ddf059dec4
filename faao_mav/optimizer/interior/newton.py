"""One Newton step of the interior-point method, by a banded LU and a border of J + 1.

From (w, v, t), slacks (s, F - t) and multipliers (z, weights, y) the step solves

    H dw + A_w^T y+ - G^T weights+ = 0            A (dw, dv) = -A (w, v)
    A_v^T y+ - D^T z_1+ = 0                       ds = (-margin, D dv)
    z+ + W^-2 ds = mu s^-1 - correction           sum weights+ = 1
    G dw - dt + (F - t) weights+ / weights = mu c / weights

with + for new multipliers, H = -sum_j weights_j Hessian(F_j), G the gradients of the F_j, W the
scaling of `cones`, c the share of the barrier that keeps t below the F_j, and
D v = (v, k (v_{n+1} - v_n)) what the limits bound. A least speed adds to D the half-planes of
`slow`, whose own curvature is left out.

Several flights take their steps side by side, each its own: see `iterate`.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior import cones
from faao_mav.optimizer.interior.banded import SIZE, Factors, Q, V, W, Y
from faao_mav.optimizer.interior.iterate import NONE, FlightScale, Point, Step

_TINY = float(np.finfo(float).tiny)
_UNBOUNDED = np.array([1e20, 0.0, 1e20])[:, None, None]


@dataclass(frozen=True, slots=True)
class Newton:
    """The factored system at a point; `curvature` (3, flights, n) is H with its proximal term.

    `columns` are the solutions for the gradients of F_j, and for mu = 0 without correction.
    """

    scale: FlightScale
    point: Point
    share: float
    scaling: cones.Scaling
    curvature: Real
    give: Real
    factors: Factors
    columns: Real
    border: Real

    @classmethod
    def at(
        cls,
        scale: FlightScale,
        point: Point,
        scaling: cones.Scaling,
        *,
        share: float,
        proximal: Real,
        cut: Flags,
    ) -> "Newton":
        """Factor the system, with the negative part of H cut where `cut` (flights, 1)."""
        n, (links, flights) = scale.matrix.slots, point.total.shape[:2]
        give = np.empty((3, flights, n))  # the last slot has none
        give[..., :-1] = scaling.give()[..., n:] / scale.gain**2
        if not scale.gains.all():
            give[..., :-1] = np.where(scale.gains > 0, give[..., :-1], _UNBOUNDED)
        curvature = -np.einsum("jb,cjbn->cbn", point.weights[..., 0], point.hessian)
        if cut.any():
            curvature = np.where(cut, _convex(curvature), curvature)
        curvature[::2] += proximal
        at_v, forces, push = scaling.curvature[..., :n], scaling.lean() * point.margin, NONE
        if point.slow is not None:
            at_v, push = at_v + point.slow.stiffness(), point.slow.push(0.0, 0.0)
        factors = scale.matrix.factor(curvature, at_v, give)

        right = np.zeros((links + 1, flights, n, SIZE))
        right[:links, ..., W] = point.gradient.transpose(1, 2, 3, 0)
        _load(right[links], scale, give, forces, push)
        ahead = scale.matrix.dynamics(point.w, point.v)
        np.negative(ahead.transpose(1, 2, 0), out=right[links, :, :-1, Y])
        columns = factors.solve(right)

        border = np.einsum("cibn,jbnc->bij", point.gradient, columns[:links, ..., W])
        room = (point.total - point.floor) / point.weights
        border[:, range(links), range(links)] += room[..., 0].T
        return cls(scale, point, share, scaling, curvature, give, factors, columns, border)

    def convex(self, step: Step) -> Flags:
        """Tell whether the systems look like those of minima, by two signs, (flights, 1)."""
        both = self.border + np.swapaxes(self.border, 1, 2)
        both = np.where(np.isfinite(both).all(axis=(1, 2), keepdims=True), both, 0.0)
        size = sum(np.einsum("cbn,cbn->b", x, x) for x in (step.dw, step.dv))
        falls = self.decrease(step) > 1e-8 * size[:, None]
        return np.asarray((np.linalg.eigvalsh(both)[:, :1] > 0) & falls)

    def step(self, mu: Real, correction: Real | None = None, of_slow: Real = NONE) -> Step:
        """Solve for `mu` (flights, 1), less the second-order `correction` (3, flights, m).

        `of_slow` (flights, n) is that of `Slow`. Without a correction mu must be zero.
        """
        point, scaling, scale, slow = self.point, self.scaling, self.scale, self.point.slow
        n, (links, flights) = scale.matrix.slots, point.total.shape[:2]
        alone, target = self.columns[links], None
        if correction is not None:
            target = mu * cones.inverse(point.s) - correction
            right, push = np.zeros((1, flights, n, SIZE)), NONE
            if slow is not None:
                push = slow.push(mu, of_slow) - slow.push(0.0, 0.0)
            _load(right[0], scale, self.give, target[1:], push)
            alone = alone + self.factors.solve(right)[0]

        # G dw - dt + (F - t) weights+ / weights = mu c / weights, and the weights sum to one
        system = np.ones((flights, links + 1, links + 1))
        system[:, :links, :links] = self.border
        system[:, :links, links], system[:, links, links] = -1, 0
        wanted = np.ones((flights, links + 1, 1))
        known = np.einsum("cjbn,bnc->bj", point.gradient, alone[..., W])
        wanted[:, :links, 0] = (mu * self.share / point.weights)[..., 0].T - known
        solved = np.linalg.solve(system, wanted).transpose(1, 0, 2)
        weights, rise = solved[:links], solved[links]
        found = alone + np.einsum("jb,jbnk->bnk", weights[..., 0], self.columns[:links])

        dw, dv, q, y = (found[..., part].transpose(2, 0, 1) for part in (W, V, Q, Y))
        q, y = q[..., :-1], y[..., :-1]
        moves = np.empty_like(point.pair)
        z = moves[:, 1]
        scale.enter(moves[:, 0], -point.margin, dv)
        z[1:, :, n:] = q * scale.per_gain
        # the multipliers of the speeds from stationarity, not from W^-2 ds: that keeps its digits
        z[1:, :, :n] = scale.left_over(y, z[1:, :, n:])
        of_least = NONE, NONE
        if slow is not None:
            slope = slow.slope(dv)
            raised = slow.raised(slope, mu, of_slow)
            z[1:, :, :n] -= slow.u * raised
            of_least = slope, raised - slow.z
        z[0] = scaling.radial(target, -point.margin, z[1:])
        z -= point.z
        return Step(
            dw=dw,
            dv=dv,
            dy=y - point.y,
            moves=moves,
            slow=of_least,
            dweights=weights - point.weights,
            dtotal=np.einsum("cjbn,cbn->jb", point.gradient, dw)[..., None],
            rise=rise,
        )

    def bend(self, step: Step) -> Real:
        """Return dw^T H dw, (flights, 1)."""
        return _quadratic(self.curvature, step.dw)

    def decrease(self, step: Step) -> Real:
        """Return the curvature of the whole model along `step`, (flights, 1)."""
        point = self.point
        kink = point.weights / (point.total - point.floor) * (step.dtotal - step.rise) ** 2
        found = self.bend(step) + _quadratic(self.scaling.curvature, step.ds[1:]) + kink.sum(axis=0)
        if point.slow is not None:
            found += _quadratic(point.slow.stiffness(), step.dv)
        return np.asarray(found)


def _load(right: Real, scale: FlightScale, give: Real, forces: Real, push: Real) -> None:
    """Enter forces (2, flights, 2 n - 1) on what the limits bound, and a `push` on the speeds."""
    n = scale.matrix.slots
    x, y = scale.gains * forces[..., n:]
    xx, xy, yy = give[..., :-1]
    right[..., V] = (forces[..., :n] * scale.matrix.moves_v + push).transpose(1, 2, 0)
    right[:, :-1, Q.start] = xx * x + xy * y
    right[:, :-1, Q.start + 1] = xy * x + yy * y


def _quadratic(packed: Real, x: Real) -> Real:
    """Return sum_n x_n^T M_n x_n, (flights, 1), of M (3, flights, n) and x (2, flights, n)."""
    xx, xy, yy = packed
    east, north = x
    each = xx * east * east + 2 * xy * east * north + yy * north * north
    return np.asarray(each.sum(axis=-1, keepdims=True))


def _convex(packed: Real) -> Real:
    """Return the nearest positive semidefinite matrices, (3, flights, n)."""
    xx, xy, yy = packed
    middle, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    low = np.minimum(middle - radius, 0)
    # with eigenvalues low < 0 <= high: high (M - low I) / (high - low); with both < 0: zero
    share = np.where(low < 0, np.maximum(middle + radius, 0) / np.maximum(2 * radius, _TINY), 1)
    return np.stack([share * (xx - low), share * xy, share * (yy - low)])
