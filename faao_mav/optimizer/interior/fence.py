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
from faao_mav.optimizer.interior.constraint import Constraint, ScaledFlight
from faao_mav.optimizer.interior.half_planes import HalfPlanes
from faao_mav.optimizer.interior.separation import ConvexObstacles
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory


@dataclass(frozen=True)
class FenceGeometry:
    """What a flight keeps its distance from: metres of the plan's local frame.

    `obstacles` are convex; `normals` (m, 2) and `offsets` (m,) are sides of convex areas to stay
    in, normal . w <= offset. `margin` is the distance kept.
    """

    obstacles: ConvexObstacles
    normals: Real
    offsets: Real
    margin: float

    def room(self, kin: Kinematics) -> Real:
        """Return margin and bulge (n - 1,) of the intervals of flights of `kin`, m."""
        bulge = kin.max_acceleration * kin.time_step**2 / 8
        bulges = np.full(kin.slots - 1, bulge)
        if not kin.bound_first_acceleration:  # both of its speeds are at most v_max
            bulges[0] = max(bulge, kin.max_speed * kin.time_step / 4)
        return self.margin + bulges

    def constraints(self, kin: Kinematics) -> tuple[Constraint, ...]:
        """Return the constraints of the flights of `kin`."""
        room = self.room(kin) / LENGTH
        kept: list[Constraint] = []
        if len(self.obstacles):
            kept.append(KeepOut(self, self.obstacles.scaled(LENGTH), room))
        if len(self.offsets):
            most = np.maximum(np.append(room, 0), np.insert(room, 0, 0))
            kept.append(KeepIn(self, most))
        return tuple(kept)

    def clearance(self, flight: Trajectory, time_step: float) -> float:
        """Return a lower bound of the distance of the continuous path of `flight`, m.

        It is the distance itself but where a path that bends around a corner is nearest between
        samples.
        """
        least = np.inf
        w, v, a = (x[:, None] for x in (flight.w.T, flight.v.T, flight.a.T))
        if len(self.obstacles):
            u, h = self.obstacles.separation(w[..., :-1], w[..., 1:])
            nearest = _least_along(u, w, v, a, time_step) - h
            least = min(least, float(nearest.min()))
        if len(self.offsets):
            inward = -self.normals.T[:, :, None, None]
            nearest = _least_along(inward, w, v, a, time_step) + self.offsets[:, None, None]
            least = min(least, float(nearest.min()))
        return least

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:
        """Return by how much the path of `flight` comes too near, in solver units; 0 if nowhere."""
        return max(0.0, self.margin - self.clearance(flight, kin.time_step)) / LENGTH


def _least_along(u: Real, w: Real, v: Real, a: Real, dt: float) -> Real:
    """Return the least u . w(t) on the parabola of every interval, exactly."""
    along = [u[0] * x[0, ..., :-1] + u[1] * x[1, ..., :-1] for x in (w, v, a)]
    end = u[0] * w[0, ..., 1:] + u[1] * w[1, ..., 1:]
    place, speed, bend = along
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.where(bend > 0, -speed / bend, -1.0)
    inside = (turn > 0) & (turn < dt)
    turn = np.where(inside, turn, 0.0)
    lowest = place + speed * turn + bend * turn * turn / 2
    return np.asarray(np.minimum(np.minimum(place, end), lowest))


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
    def turns(self) -> bool:
        """True: where a flight slides along an obstacle every half-plane turns."""
        return True

    def slack(self, x: Real) -> tuple[Real, Real]:
        """Return u . w - h(u) - room (2 P, flights, n) and u."""
        u, h = self.obstacles.separation(x[..., :-1], x[..., 1:], self.room)
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
