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
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.faao import cones
from faao_mav.faao.banded import SIZE, Factors, FlightMatrix, Q, V, W, Y
from faao_mav.faao.kinematics import Kinematics
from faao_mav.faao.rewards import LENGTH
from faao_mav.faao.slow import Slow

_UNBOUNDED = 1e20


def best_floor(total: Real, weight: float) -> float:
    """Return the t that maximises t + `weight` sum_j log(total_j - t)."""
    least = float(total.min())
    # the gradient rises along t and is <= 0 here: Newton's method on it meets no pole below
    floor: float = least - weight * total.shape[0]
    for _ in range(50):
        apart = total - floor
        excess = weight * float((1 / apart).sum()) - 1
        step = excess / (weight * float((1 / apart**2).sum()))
        if abs(excess) < 1e-12 or floor - step == floor:
            break
        floor = floor - step if floor - step < least else (floor + least) / 2
    return floor


class FlightScale:
    """The flight in solver units: what the limits bound as a linear map of the speeds."""

    def __init__(self, kin: Kinematics) -> None:
        self.matrix = FlightMatrix(
            kin.slots,
            kin.max_speed * kin.time_step / LENGTH / 2,
            (kin.start_velocity is not None, kin.end_velocity is not None),
        )
        self.gain = kin.max_speed / (kin.max_acceleration * kin.time_step)
        self.bounded = np.ones((kin.slots - 1, 1))
        self.bounded[: kin.first_bounded_acceleration] = 0

    def limited(self, v: Real) -> Real:
        """Return the free speeds and the bounded accelerations of v (n, 2), (2, 2 n - 1)."""
        a = self.gain * (v[1:] - v[:-1]) * self.bounded
        return np.concatenate([(v * self.matrix.moves_v).T, a.T], axis=1)

    def spread(self, forces: Real) -> Real:
        """Return the transpose of `limited` applied to (2, 2 n - 1), (n, 2)."""
        n = self.matrix.slots
        on_v = forces[:, :n].T.copy()
        on_a = self.gain * self.bounded * forces[:, n:].T
        on_v[1:] += on_a
        on_v[:-1] -= on_a
        return on_v * self.matrix.moves_v


@dataclass(frozen=True, slots=True)
class Point:
    """An iterate. margin (m,) = s_0 - 1: how far the limits are still widened."""

    w: Real
    v: Real
    y: Real
    s: Real
    z: Real
    margin: Real
    slow: Slow
    weights: Real
    total: Real
    floor: float
    gradient: Real
    hessian: Real

    def gap(self) -> float:
        """Return the mean of s^T z over the cones."""
        slow = self.slow
        both = (self.s * self.z).sum() + (slow.s * slow.z).sum()
        return float(both / (self.s.shape[1] + slow.on.sum()))

    def centred(self, mu: float, share: float) -> "Point":
        """Return the same flight with z = mu s^-1."""
        return replace(
            self,
            z=mu * cones.inverse(self.s),
            slow=self.slow.centred(mu),
            floor=best_floor(self.total, share * mu),
        )


@dataclass(frozen=True, slots=True)
class Step:
    """A direction; dtotal (J,) is the first-order change of the F_j, rise that of t.

    `slow` has the changes of s and z of `Slow`.
    """

    dw: Real
    dv: Real
    dy: Real
    ds: Real
    dz: Real
    slow: tuple[Real, Real]
    dweights: Real
    dtotal: Real
    rise: float

    def reach(self, point: Point) -> float:
        """Return the share of the step at which a slack or a multiplier vanishes."""
        falls = float((-self.dweights / point.weights).max())
        return min(
            cones.reach(point.s, self.ds),
            cones.reach(point.z, self.dz),
            point.slow.reach(*self.slow),
            1 / falls if falls > 0 else np.inf,
        )


@dataclass(frozen=True, slots=True)
class Newton:
    """The factored system at a point; `curvature` (n, 3) is H with its proximal term.

    `columns` are the solutions for the gradients of F_j, for mu = 0 without correction, and for
    mu s^-1 with mu = 1: a step without correction is a combination of them.
    """

    scale: FlightScale
    point: Point
    share: float
    scaling: cones.Scaling
    curvature: Real
    give: Real
    at_v: Real
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
        proximal: float,
        exact: bool,
    ) -> "Newton | None":
        """Factor the system with H as it is, if `exact`, else with its negative part cut.

        None if the matrix is singular, or if `exact` and it is not that of a minimum.
        """
        give = scaling.give[scale.matrix.slots :] / scale.gain**2
        if not scale.bounded.all():
            give = np.where(scale.bounded > 0, give, np.array([_UNBOUNDED, 0, _UNBOUNDED]))
        curvature = -np.tensordot(point.weights, point.hessian, 1)
        if not exact:
            curvature = _convex(curvature)
        curvature[:, [0, 2]] += proximal
        n, links = scale.matrix.slots, point.total.shape[0]
        at_v = point.slow.stiffness()
        factors = scale.matrix.factor(curvature, scaling.curvature[:n] + at_v, give)
        if factors is None:
            return None
        right = np.zeros((links + 2, n, SIZE))
        right[:links, :, W] = point.gradient
        _load(right[links], scale, give, scaling.lean * point.margin)
        right[links, :-1, Y] = -scale.matrix.dynamics(point.w, point.v)
        _load(right[-1], scale, give, cones.inverse(point.s)[1:])
        slow, none = point.slow, np.zeros(n)
        right[links, :, V] += slow.u * slow.raised(-slow.margin, 0.0, none)[:, None]
        right[-1, :, V] += slow.u * (slow.on / slow.s)[:, None]
        columns = factors.solve(right)
        flat = point.gradient.reshape(links, -1)
        border = flat @ columns[:links, :, W].reshape(links, -1).T
        border[np.diag_indices(links)] += (point.total - point.floor) / point.weights
        newton = cls(scale, point, share, scaling, curvature, give, at_v, factors, columns, border)
        return newton if not exact or newton.convex() else None

    def convex(self) -> bool:
        """Tell whether the system looks like one of a minimum: two necessary signs."""
        if not np.isfinite(self.border).all():
            return False
        if np.linalg.eigvalsh((self.border + self.border.T) / 2)[0] <= 0:
            return False
        step = self.step(self.point.gap())
        size = float((step.dw * step.dw).sum() + (step.dv * step.dv).sum())
        return self.decrease(step) > 1e-8 * size

    def step(self, mu: float, correction: Real | None = None, of_slow: Real | float = 0.0) -> Step:
        """Solve for `mu`, less the second-order `correction` (3, m), `of_slow` (n,)."""
        point, scaling, scale, slow = self.point, self.scaling, self.scale, self.point.slow
        n, links = scale.matrix.slots, point.total.shape[0]
        alone = self.columns[links] + mu * self.columns[-1]
        target = mu * cones.inverse(point.s)
        if correction is not None:
            right = np.zeros((1, n, SIZE))
            _load(right[0], scale, self.give, -correction[1:])
            right[0, :, V] -= slow.u * np.asarray(of_slow / slow.s)[:, None]
            alone += self.factors.solve(right)[0]
            target -= correction
        ds_0 = -point.margin

        flat = point.gradient.reshape(links, -1)
        system = np.ones((links + 1, links + 1))
        system[:links, :links] = self.border
        system[:links, links], system[links, links] = -1, 0
        wanted = np.ones(links + 1)
        wanted[:links] = mu * self.share / point.weights - flat @ alone[:, W].ravel()
        solved = np.linalg.solve(system, wanted)
        weights, rise = solved[:links], float(solved[links])
        found = alone + np.tensordot(weights, self.columns[:links], 1)

        dw, dv, y = found[:, W], found[:, V], found[:-1, Y]
        ds = np.vstack([ds_0, scale.limited(dv)])
        slope = slow.slope(dv)
        raised = slow.raised(slope, mu, of_slow * np.ones(n))
        z = np.zeros_like(point.z)
        z[1:, n:] = (-found[:-1, Q] / scale.gain * scale.bounded).T
        # the multipliers of the speeds from stationarity, not from W^-2 ds: that keeps its digits
        pushed = slow.u * raised[:, None]
        z[1:, :n] = (scale.matrix.pull(y)[1] - scale.spread(z[1:]) - pushed).T
        z[0] = scaling.radial(target, ds_0, z[1:])
        return Step(
            dw=dw,
            dv=dv,
            dy=y - point.y,
            ds=ds,
            dz=z - point.z,
            slow=(slope, raised - slow.z),
            dweights=weights - point.weights,
            dtotal=flat @ dw.ravel(),
            rise=rise,
        )

    def bend(self, step: Step) -> float:
        """Return dw^T H dw."""
        return float((step.dw * _times(self.curvature, step.dw)).sum())

    def decrease(self, step: Step) -> float:
        """Return the curvature of the whole model along `step`."""
        x, point = step.ds[1:].T, self.point
        stiff = float((x * _times(self.scaling.curvature, x)).sum())
        kink = point.weights / (point.total - point.floor) * (step.dtotal - step.rise) ** 2
        stiff += float((step.dv * _times(self.at_v, step.dv)).sum())
        return self.bend(step) + stiff + float(kink.sum())


def _load(right: Real, scale: FlightScale, give: Real, forces: Real) -> None:
    """Enter forces (2, 2 n - 1) on what the limits bound into a right-hand side (n, 8)."""
    n = scale.matrix.slots
    right[:, V] = forces[:, :n].T * scale.matrix.moves_v
    right[:-1, Q] = scale.gain * _times(give, forces[:, n:].T * scale.bounded) * scale.bounded


def _times(packed: Real, x: Real) -> Real:
    """Return the product of symmetric matrices (n, 3) and vectors (n, 2), (n, 2)."""
    xx, xy, yy = packed.T
    return np.stack([xx * x[:, 0] + xy * x[:, 1], xy * x[:, 0] + yy * x[:, 1]], axis=1)


def _convex(packed: Real) -> Real:
    """Return the nearest positive semidefinite matrices, (n, 3)."""
    xx, xy, yy = packed.T
    middle, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    low = np.minimum(middle - radius, 0)
    # with eigenvalues low < 0 <= high: high (M - low I) / (high - low); with both < 0: zero
    share = np.where(
        low < 0, np.maximum(middle + radius, 0) / np.maximum(2 * radius, np.finfo(float).tiny), 1
    )
    return np.stack([share * (xx - low), share * xy, share * (yy - low)], axis=1)
