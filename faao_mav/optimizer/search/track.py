"""Phase 1: the feasible flight nearest to a path that knows no dynamics, or that breaks the fence.

A path r_n may come from a search over a map, or be a polyline flown at an even speed. The flight
minimises sum_n ||w_n - r_n||^2 under (11)-(13f), then under the fence too: from a flight that is
near the path each obstacle is left on the path's side.
"""

from collections.abc import Sequence

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import Constraint, Rows, every_excess, unknowns
from faao_mav.optimizer.interior.maximize import constraints_of
from faao_mav.optimizer.interior.search import COLD_START, Search
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory

_TOLERANCE = 1e-4
"""Tolerance of the search: a start need not be the nearest flight to the last metre. Chosen."""

ALLOWED = 1e-9
"""The violation of a limit, in solver units, that counts as none: rounding."""

MOST_STEPS = 200
"""Steps after which a search ends. Chosen."""

_LOOK = 5
"""Steps after which it is looked again for a flight that keeps the limits, where any one will do.
Chosen."""


class Closeness:
    """The goal -sum_n ||w_n - r_n||^2 of being near a path r (n, 2), m.

    The unit is the largest gradient at the start w (n, 2).
    """

    noise = 1e-9
    held: tuple[int, ...] = ()

    def __init__(self, path: Real, w: Real) -> None:
        self.path = path.T / LENGTH
        self.unit = 2 * float(np.abs(path - w).max()) / LENGTH

    def worth(self, x: Real) -> Rows:
        """Return -||w_n - r_n||^2 of unknowns x that begin with w."""
        away = x[:2] - self.path
        slope, bend = np.zeros((1, *x.shape)), np.zeros((1, len(x), *x.shape))
        slope[0, :2] = -2 * away / self.unit
        bend[0, [0, 1], [0, 1]] = -2 / self.unit
        return Rows(-(away**2).sum(axis=0)[None] / self.unit, slope, bend)


def nearest_flight(
    kin: Kinematics,
    path: Real,
    start: Trajectory,
    constraints: Sequence[Constraint] = (),
    steps: int = MOST_STEPS,
    *,
    first: bool = False,
) -> Trajectory | None:
    """Return the flight nearest to `path` (n, 2) m that keeps the limits of `kin`.

    None where none is found within `steps` that keeps `constraints` too. `start` is any flight of
    `kin`. With `first` the way there ends with a flight that keeps them.
    """
    for kept in ((), tuple(constraints)) if constraints else ((),):
        every = (*constraints_of(kin), *kept)
        goal = Closeness(path, start.w)
        if goal.unit < _TOLERANCE:
            continue
        search = Search(
            kin, every, goal, unknowns(kin, start), tolerance=_TOLERANCE, strategy=COLD_START
        )
        for most in range(_LOOK, steps + _LOOK, _LOOK) if first else (steps,):
            with np.errstate(all="ignore"):
                v = search.run(min(most, steps))
            start = kin.follow(v.T * kin.max_speed)
            if search.converged or (first and _keeps(kin, every, start)):
                break
    return start if _keeps(kin, (*constraints_of(kin), *constraints), start) else None


def _keeps(kin: Kinematics, constraints: Sequence[Constraint], flight: Trajectory) -> bool:
    return every_excess(kin, constraints, flight) <= ALLOWED
