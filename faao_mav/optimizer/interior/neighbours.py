"""Constraints g(v_n, v_{n+1}) >= 0 on the speeds before and after each slot.

As `min_speed` says, a flight can turn as a whole, which such limits do not feel: their curvature
counts, and slacks follow them to first order only.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.banded import Entry, V
from faao_mav.optimizer.interior.cones import TINY
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    Move,
    ScaledFlight,
    Start,
    Stiffness,
    largest,
    summed,
)
from faao_mav.optimizer.interior.half_planes import MOST_MISSED, Slacks
from faao_mav.optimizer.interior.min_speed import INSIDE

_HEADROOM = 0.1
"""The slack of a cold start that has less, in the unit of g; less of a warm one. Chosen."""


class Neighbours(Constraint):
    """Limits g(v_n, v_{n+1}) >= 0, some in every slot, with their curvature.

    g curves by -`hold` ||v_{n+1} - v_n||^2 / 2, and beyond that by v_n and by v_{n+1} alone.
    """

    @property
    def curved(self) -> bool:
        """Return True."""
        return True

    def hold(self, flight: ScaledFlight) -> float:  # noqa: ARG002
        """Return the curvature of -g by v_{n+1} - v_n."""
        return 0.0

    @abstractmethod
    def expanded(self, flight: ScaledFlight, v: Real) -> tuple[Real, Real, Real]:
        """Return g, its gradients and its second derivatives, `hold` left out, at the speeds v.

        The scaled v is (2, flights, n), g (rows, flights, n - 1). The gradients (2, 2, *g) are by
        v_n, then by v_{n+1}, and so are the second derivatives (2, 3, *g): xx, xy, yy.
        """

    def entries(self, slots: int, first: int) -> Sequence[Entry]:  # noqa: ARG002
        """Return the room for what couples neighbouring speeds."""
        return (Entry(V.stop - 1, V.start, np.zeros(slots - 1), ahead=1),)

    def begin(self, flight: ScaledFlight, start: Start) -> "NeighboursState":
        """Return the centred state at `start`, widened where little of a limit is left."""
        g, slopes, bends = self.expanded(flight, start.v)
        on, none = np.broadcast_to(1.0 * (flight.gains > 0), g.shape), np.zeros(g.shape)
        margin = on * np.maximum(0, _HEADROOM * min(1.0, start.margin) - (g - INSIDE))
        s = np.where(on > 0, g - INSIDE + margin, 1.0)
        state = NeighboursState(on, s, none, margin, self, flight, g, slopes, bends)
        return state.centred(start.mu)


@dataclass(frozen=True)
class NeighboursState(Slacks):
    """The limits at an iterate; on, s, z, margin and g, `slack`, are (rows, flights, n - 1).

    `slopes` and `bends` are what `expanded` says.
    """

    constraint: Neighbours
    flight: ScaledFlight
    slack: Real
    slopes: Real
    bends: Real

    def at(self, v: Real) -> "NeighboursState":
        """Return the state with the limits at the scaled speeds `v` (2, flights, n)."""
        slack, slopes, bends = self.constraint.expanded(self.flight, v)
        return replace(self, slack=slack, slopes=slopes, bends=bends)

    def forces(self) -> Forces:
        """Return the gradients times z."""
        return self._forces(self.z)

    def stiffness(self) -> Stiffness:
        """Return z / s J^T J, and the curvatures times z."""
        both, (before, after) = self.on * self.z / self.s, self.slopes
        east, north = self.slopes[:, 0], self.slopes[:, 1]
        outer = np.stack([east * east, east * north, north * north], axis=1)
        on_v = _joined((both * outer).sum(axis=2))
        between = (both * before[:, None] * after[None]).sum(axis=2)
        held = self.constraint.hold(self.flight) * self.z.sum(axis=0)
        on_v[::2] += _joined(np.stack([held, held]))
        for axis in (0, 1):
            between[axis, axis] -= held
        turning = -_joined((self.z * self.bends).sum(axis=2))
        return Stiffness(v=on_v, turning=turning, between=between)

    def push(self, target: Real | None) -> Forces:
        """Return the forces of the margins, or of `target`, where the speeds stay."""
        return self._forces(self.raised(-self.margin, None) if target is None else target)

    def solved(
        self,
        move: Move,
        target: Real | None,
        rest: Forces,  # noqa: ARG002
    ) -> tuple[tuple[Real, Real, Real, Real], Forces]:
        """Return the changes of linear slack and multiplier, and twice what is missed of g.

        The last of the changes is what of that is `hold`'s.
        """
        dv = np.stack([move.v[..., :-1], move.v[..., 1:]])
        ds = (self.slopes * dv[:, :, None]).sum(axis=(0, 1)) - self.margin
        z = self.raised(ds, target)
        (east, north), change = dv[:, :, None].swapaxes(0, 1), dv[1] - dv[0]
        xx, xy, yy = self.bends.swapaxes(0, 1)
        bent = (xx * east * east + 2 * xy * east * north + yy * north * north).sum(axis=0)
        held = self.constraint.hold(self.flight) * (change * change).sum(axis=0)
        return (ds, z - self.z, bent - held, held), self._forces(z)

    def curvature(self, step: Any) -> Real:
        """Return the sum of z / s ds^2, the margins left out, and of z times what is held."""
        return super().curvature(step[:2]) + summed(self.z * step[3])

    def reach(self, step: Any) -> Real:
        """Return the share at which a slack or a multiplier vanishes, or too much is missed."""
        missed = self.on * step[2] / 2 / np.maximum(self.s, MOST_MISSED)
        return np.minimum(super().reach(step), 1 / np.sqrt(np.maximum(largest(missed), TINY)))

    def violation(self) -> Real:
        """Return the largest margin, tenfold as it is missed in second order."""
        return 10 * super().violation()

    def moved(self, w: Real, v: Real, share: Real, step: Any) -> "NeighboursState":  # noqa: ARG002
        """Return the state after `share` of `step`, with the limits at v."""
        s, z = self.s + share * step[0] * self.on, self.z + share * step[1] * self.on
        then = replace(self, s=s, z=z).at(v)
        return replace(then, margin=(s - then.slack + INSIDE) * self.on)

    def missing(self, share: Real, step: Any, then: "NeighboursState") -> Real:
        """Return by how much more of the limits is missed than the model says, weighted.

        Without it some searches go to and fro: a flight of 25 s with a least speed of 5 m/s.
        """
        more = then.margin - (1 - share) * self.margin - share**2 / 2 * step[3]
        return summed(then.z * np.maximum(0, more))

    def centred(self, mu: Real) -> "NeighboursState":
        """Return the same slacks with z = mu / s."""
        return replace(self, z=mu * self.on / self.s)

    def _forces(self, z: Real) -> Forces:
        pull = _joined((self.on * z * self.slopes).sum(axis=2))
        return Forces(v=pull * self.flight.matrix.moves_v)


def _joined(ends: Real) -> Real:
    """Return the sums (..., flights, n) of `ends` (2, ..., flights, n - 1) before and after."""
    before, after = ends
    sums = np.zeros((*before.shape[:-1], before.shape[-1] + 1))
    sums[..., :-1] += before
    sums[..., 1:] += after
    return sums
