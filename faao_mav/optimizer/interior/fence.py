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
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.fence_geometry import FenceGeometry
from faao_mav.optimizer.interior.constraint import Constraint, ScaledFlight
from faao_mav.optimizer.interior.half_planes import HalfPlanes
from faao_mav.optimizer.interior.separation import ConvexObstacles
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory


def fence_constraints(fence: FenceGeometry, kin: Kinematics) -> tuple[Constraint, ...]:
    """Return what the flights of `kin` have to keep of `fence`."""
    room = fence.room(kin) / LENGTH
    kept: list[Constraint] = []
    if len(fence.obstacles):
        kept.append(KeepOut(fence, fence.obstacles.scaled(LENGTH), room))
    if len(fence.offsets):
        most = np.maximum(np.append(room, 0), np.insert(room, 0, 0))
        kept.append(KeepIn(fence, most))
    return tuple(kept)


@dataclass(frozen=True)
class KeepOut(HalfPlanes):
    """Both ends of every interval beyond a half-plane of every obstacle: 2 P rows of slots.

    The first P rows are the half-planes of the interval that begins at a slot, the others those of
    the one that ends there. `obstacles` and `room` (n - 1,), margin and bulge, are in solver units.
    """

    geometry: FenceGeometry
    obstacles: ConvexObstacles
    room: Real
    quantity: ClassVar = "w"

    @property
    def headroom(self) -> float:
        """The slack, in 100 m, that starts are given where they have less.

        Of 0.1, 0.02 and 0.005 it led a start among forty polygons farthest.
        """
        return 0.02

    @property
    def turns(self) -> bool:
        """True: where a flight slides along an obstacle every half-plane turns."""
        return True

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return u . w - h(u) - room (2 P, flights, n) and u."""
        u, h = self.obstacles.separation(x[..., :-1], x[..., 1:])
        least = h + self.room
        pieces, slots = len(self.obstacles), x.shape[-1]
        g = np.ones((2 * pieces, *x.shape[1:]))
        turned = np.zeros((2, *g.shape))
        for rows, at in (
            (slice(None, pieces), slice(None, -1)),
            (slice(pieces, None), slice(1, slots)),
        ):
            g[rows, :, at] = u[0] * x[0, :, at] + u[1] * x[1, :, at] - least
            turned[:, rows, :, at] = u
        return g, turned

    def held(self, flight: ScaledFlight, shape: tuple[int, ...]) -> Real:
        """Return one where a slot is free and begins (ends) an interval, else 0."""
        on = np.array(super().held(flight, shape))
        pieces = len(self.obstacles)
        on[:pieces, :, -1] = 0
        on[pieces:, :, 0] = 0
        return on

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return `FenceGeometry.excess`."""
        return self.geometry.excess(kin, flight)


@dataclass(frozen=True)
class KeepIn(HalfPlanes):
    """normal . w <= offset - room for every side of the areas to stay in: m rows of slots.

    `room` (n,), margin and bulge, is in solver units.
    """

    geometry: FenceGeometry
    room: Real
    quantity: ClassVar = "w"

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return offset - room - normal . w (m, flights, n) and -normal."""
        normals = self.geometry.normals.T[:, :, None, None]
        away = self.geometry.offsets[:, None, None] / LENGTH - self.room
        g = away - normals[0] * x[0] - normals[1] * x[1]
        return g, np.broadcast_to(-normals, (2, *g.shape))

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return `FenceGeometry.excess`."""
        return self.geometry.excess(kin, flight)
