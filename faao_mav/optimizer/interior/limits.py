"""What flights keep: speed, acceleration, airspeed, their changes, turns, energy, and the fence.

    (1 - ||v_n||^2) / 2 >= 0,  (1 - ||a_n||^2) / 2 >= 0,  (||v_n - u||^2 - least^2) / 2 >= 0

in the wind u, and the greatest airspeed as the first. Thrust and drag limit how the airspeed
s_n = ||v_n - u|| changes, guidance how fast the path turns over ground: see `Kinematics`. A battery
limits sum_n P(v_n, a_n) delta_t <= E, one inequality for it all. P is smooth but not convex: a
copter that hovers takes more than one that flies slowly.

Of the fence, the whole path stays out of obstacles and inside areas, by a margin. Between two
samples the path is a parabola, nowhere farther than |a| dt^2 / 8 from the chord, its bulge. So it
keeps the margin if the chord keeps margin and bulge. A chord does from a convex obstacle where one
direction u separates both of its ends:

    u . w_n - h(u) >= margin + bulge  and  u . w_{n+1} - h(u) >= margin + bulge

with the support function h. The direction of the greatest distance turns with every step; held
fixed, it is a pair of half-planes inside the true set. A convex area to stay in is the half-planes
of its sides, which do not turn.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import PACKED, Flags, Real
from faao_mav.optimizer.fence_geometry import FenceGeometry
from faao_mav.optimizer.interior.constraint import TINY, A, Constraint, Grid, Rows, V, W
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.plan import Vector
from faao_mav.power import PowerModel, PowerPartials

_SAME = np.eye(2)[:, :, None]
"""The Hessian of half a squared length, in every slot."""


@dataclass(frozen=True)
class Disc(Constraint):
    """g(x) = `side` (||x - center||^2 / `unit`^2 - `radius`^2) / 2 of a place or its derivatives.

    With a `side` of -1 x stays in the disc, with 1 outside. The `center` is (2,), or (2, n) where
    each slot has its own.
    """

    of: tuple[int, ...]  # type: ignore[misc]
    radius: float = 1.0
    center: Vector | Real = (0.0, 0.0)
    side: float = -1.0
    unit: float = 1.0

    def rows(self, x: Real) -> Rows:
        """Return g."""
        away = (x - np.reshape(self.center, (2, -1))) / self.unit
        value = self.side * ((away * away).sum(axis=0) - self.radius**2) / 2
        bend = np.broadcast_to(self.side / self.unit**2 * _SAME, (1, 2, 2, x.shape[1]))
        return Rows(value[None], self.side / self.unit * away[None], bend)


def _by_slot(gain: float, value: Real, slope: Real, bend: Real) -> Rows:
    """Return functions of v_n and v_{n+1} = v_n + `gain` a_n as those of v_n and a_n.

    `slope` (m, 2, 2, n) and `bend` (m, 2, 2, 2, n) are those by either; there are no mixed terms.
    """
    m, n, ends = len(value), value.shape[-1], np.array([[1.0, 0.0], [1.0, gain]])
    return Rows(
        value,
        np.einsum("ep,mein->mpin", ends, slope).reshape(m, 4, n),
        np.einsum("ep,eq,meijn->mpiqjn", ends, ends, bend).reshape(m, 4, 4, n),
    )


@dataclass(frozen=True)
class SpeedChange(Constraint):
    """In a slot the airspeed falls by at most `fall`, and half its square rises by `rise`.

    In v_max and its square; so is `wind`. `gain` is what a_max changes in a slot.
    """

    gain: float
    fall: float
    rise: float
    wind: Vector
    of = V + A

    def rows(self, x: Real) -> Rows:
        """Return 1 - (s_n - s_{n+1}) / fall and 1 - (s_{n+1}^2 - s_n^2) / (2 rise)."""
        v = x[:2] - np.reshape(self.wind, (2, 1))
        ends = np.stack([v, v + self.gain * x[2:]])
        speed = np.maximum(np.hypot(*ends.swapaxes(0, 1)), TINY)
        unit = ends / speed[:, None]
        across = (_SAME - unit[:, :, None] * unit[:, None]) / speed[:, None, None]
        same = np.broadcast_to(_SAME, across.shape)
        scale = np.outer([1 / self.fall, -1 / self.rise], [-1, 1])[..., None]
        value = 1 + (scale * np.stack([speed, speed**2 / 2])).sum(axis=1)
        slope = scale[..., None] * np.stack([unit, ends])
        return _by_slot(self.gain, value, slope, scale[..., None, None] * np.stack([across, same]))


@dataclass(frozen=True)
class TurnRate(Constraint):
    """(`per_speed`^2 c_n^2 - ||a_n||^2) / 2 >= 0 of the speed c_n that counts in turns.

    c_n^2 = (||v_n||^2 + ||v_{n+1}||^2) / 2 + `wind`, in v_max^2; `gain` is as in `SpeedChange`.
    """

    gain: float
    per_speed: float
    wind: float
    of = V + A

    def rows(self, x: Real) -> Rows:
        """Return g."""
        v, a = x[:2], x[2:]
        ends, half = np.stack([v, v + self.gain * a]), self.per_speed**2 / 2
        value = (half * ((ends**2).sum(axis=(0, 1)) + 2 * self.wind) - (a * a).sum(axis=0)) / 2
        same = np.broadcast_to(_SAME, (1, 2, 2, 2, x.shape[1]))
        rows = _by_slot(self.gain, value[None], half * ends[None], half * same)
        rows.slope[0, 2:] -= a
        assert rows.bend is not None
        rows.bend[0, 2:, 2:] -= _SAME
        return rows


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
        bend[:2, :2], bend[2:, 2:] = power.by_vv[PACKED], power.by_aa[PACKED]
        bend[:2, 2:], bend[2:, :2] = power.by_va, power.by_va.swapaxes(0, 1)
        bend *= scale[:, None, None] * scale[:, None]
        return Rows((1 - unit * power.value)[None], -unit * slope[None], -unit * bend[None])

    def partials(self, v: Real, a: Real) -> PowerPartials:
        """Return the power, W, at v over ground and a, (2, ...), m/s, m/s^2, with derivatives."""
        return self.model.partials(v - np.reshape(self.kin.wind, (2, *[1] * (v.ndim - 1))), a)

    def used(self, flight: Trajectory) -> float:
        """Return what `flight` takes, J."""
        return self.kin.time_step * float(self.partials(flight.v.T, flight.a.T).value.sum())


def fence_constraints(fence: FenceGeometry, kin: Kinematics) -> tuple[Constraint, ...]:
    """Return what the flights of `kin` have to keep of `fence`."""
    room = fence.room(kin) / LENGTH
    kept: list[Constraint] = []
    if len(fence.obstacles):
        kept.append(KeepOut(fence, room))
    if len(fence.offsets):
        most = np.maximum(np.append(room, 0), np.insert(room, 0, 0))
        kept.append(KeepIn(fence, most))
    return tuple(kept)


@dataclass(frozen=True)
class _Fence(Constraint):
    """`room` is margin and bulge of intervals or slots in solver units."""

    geometry: FenceGeometry
    room: Real
    of = W
    inside = 1e-6

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return by how much the path of `flight` comes too near, in solver units; 0 if nowhere."""
        clearance = self.geometry.clearance(flight, kin.time_step)
        return max(0.0, self.geometry.margin - clearance) / LENGTH


@dataclass(frozen=True)
class KeepOut(_Fence):
    """Both ends of every interval beyond a half-plane of every obstacle: 2 P rows of slots.

    The first P rows are the half-planes of the interval that begins at a slot, the others those of
    the one that ends there. The slack that starts are given, in 100 m, was chosen: of 0.1, 0.02 and
    0.005 it led a start among forty polygons farthest.
    """

    turns = True
    headroom = 0.02

    def rows(self, x: Real) -> Rows:
        """Return u . w - h(u) - room and u."""
        w, obstacles = LENGTH * x, self.geometry.obstacles
        u, h = obstacles.separation(w[:, :-1], w[:, 1:])
        least, pieces = h / LENGTH + self.room, len(obstacles)
        value, slope = np.ones((2 * pieces, x.shape[1])), np.zeros((2 * pieces, 2, x.shape[1]))
        for rows, at in (
            (slice(None, pieces), slice(None, -1)),
            (slice(pieces, None), slice(1, None)),
        ):
            value[rows, at] = u[0] * x[0, at] + u[1] * x[1, at] - least
            slope[rows, :, at] = u.swapaxes(0, 1)
        return Rows(value, slope)

    def on(self, grid: Grid, rows: int) -> Flags:
        """Return where a slot is free and begins, or ends, an interval."""
        on = super().on(grid, rows).copy()
        on[: rows // 2, -1] = False
        on[rows // 2 :, 0] = False
        return on


@dataclass(frozen=True)
class KeepIn(_Fence):
    """normal . w <= offset - room for every side of the areas to stay in: m rows of slots."""

    def rows(self, x: Real) -> Rows:
        """Return offset - room - normal . w and -normal."""
        normals = self.geometry.normals
        value = self.geometry.offsets[:, None] / LENGTH - self.room - normals @ x
        return Rows(value, np.repeat(-normals[:, :, None], x.shape[1], axis=2))
