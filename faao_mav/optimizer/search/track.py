"""Phase 1: the feasible flight nearest to a path that knows no dynamics, or that breaks the fence.

A path r_n may come from a search over a map, or be a polyline flown at an even speed. The flight
minimises sum_n ||w_n - r_n||^2 under (11)-(13f), then under the fence too: from a flight that is
near the path each obstacle is left on the path's side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import ALLOWED, Constraint, every_excess, unknowns
from faao_mav.optimizer.interior.maximize import constraints_of
from faao_mav.optimizer.interior.rewards import Rewards, StageValues
from faao_mav.optimizer.interior.search import COLD, Search
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory

_TOLERANCE = 1e-4
"""Tolerance of the search: a start need not be the nearest flight to the last metre. Chosen."""

_MOST_STEPS = 200
"""Steps after which a search ends. Chosen."""

_LOOK = 5
"""Steps after which it is looked again for a flight that keeps the limits, where any one will do.
Chosen."""


@dataclass(frozen=True)
class Closeness:
    """The reward of being near a path r: -||w_n - r_n||^2 in units of `LENGTH`, r (n, 2) in m."""

    path: Real

    def __call__(self, w: Real) -> StageValues:
        """Return the rewards at w (2, n), m."""
        away = (w - self.path.T)[:, None] / LENGTH
        value = -(away * away).sum(axis=0)
        hessian = np.reshape((-2.0, 0.0, -2.0), (3, 1, 1)) / LENGTH**2
        return StageValues(value, -2 * away / LENGTH, np.broadcast_to(hessian, (3, *value.shape)))


def nearest_flight(
    kin: Kinematics,
    path: Real,
    start: Trajectory,
    constraints: Sequence[Constraint] = (),
    *,
    first: bool = False,
) -> Trajectory | None:
    """Return the flight nearest to `path` (n, 2) m that keeps the limits of `kin`.

    None where none is found that keeps `constraints` too. `start` is any flight of `kin`. With
    `first` the way there ends with a flight that keeps them.
    """
    for kept in ((), tuple(constraints)) if constraints else ((),):
        every = (*constraints_of(kin), *kept)
        rewards = Rewards(Closeness(path), start.w.T)
        if rewards.flat:
            continue
        search = Search(kin, every, rewards, unknowns(kin, start), tolerance=_TOLERANCE, mu=COLD)
        for most in range(_LOOK, _MOST_STEPS + 1, _LOOK) if first else (_MOST_STEPS,):
            with np.errstate(all="ignore"):
                converged = search.run(most)
            start = kin.follow(search.v.T * kin.max_speed)
            if converged or (first and _keeps(kin, every, start)):
                break
    return start if _keeps(kin, (*constraints_of(kin), *constraints), start) else None


def _keeps(kin: Kinematics, constraints: Sequence[Constraint], flight: Trajectory) -> bool:
    return every_excess(kin, constraints, flight) <= ALLOWED
