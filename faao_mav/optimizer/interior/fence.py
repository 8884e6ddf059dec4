"""The fence: the whole path stays out of obstacles and inside areas, by a margin.

Between two samples the path is a parabola, nowhere farther than |a| dt^2 / 8 from the chord, its
bulge. So it keeps the margin if the chord keeps margin and bulge. A chord does from a convex
obstacle where one direction u separates both of its ends:

    u . w_n - h(u) >= margin + bulge  and  u . w_{n+1} - h(u) >= margin + bulge

with the support function h. The direction of the greatest distance turns with every step; held
fixed, it is a pair of half-planes inside the true set. A convex area to stay in is the half-planes
of its sides, which do not turn.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.fence_geometry import FenceGeometry
from faao_mav.optimizer.interior.constraint import Constraint, Grid, Rows, W
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory


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
        """Return `FenceGeometry.excess`."""
        return self.geometry.excess(kin, flight)


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
