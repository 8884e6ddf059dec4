"""Successive convex approximation: what the trajectory step and the precoder step do."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from faao_mav.arrays import Real

MAX_STEPS = 20
"""Convex problems per step of Algorithm 1 at most. Chosen: the paper gives no number."""

MIN_DECREASE = 1e-4
"""Decrease of the objective, relative to its gap, below which a step ends. Chosen."""

NEGLIGIBLE = 1e-12
"""Gap of the objective, as a part of its largest value, that counts as zero: rounding errors."""

CAP = 40.0
"""Largest exponent that is handed to the solver: e^-40 is 4e-18."""

_DECIMALS = 6
"""Decimals of the exponents that are handed to the solver, and significant digits of the gap.

What is left of rounding errors, which differ from processor to processor, changes the number of the
solver's iterations, and its solution by up to 1e-3 m. Chosen: no decrease below `MIN_DECREASE`
hangs on more.
"""

Point = TypeVar("Point")


def successive_approximation(
    start: Point,
    objective: Callable[[Point], float],
    solve_about: Callable[[Point, float], Point],
    *,
    floor: float,
    scale: float,
) -> Point:
    """Return the point that repeated convex problems lead to from the feasible `start`.

    `objective`, the true value of a point, never increases; `floor` is a lower bound on it, the gap
    the distance to that, `scale` the largest possible gap. `solve_about` gives the solution of the
    convex problem about a point with a gap.
    """
    point, value = start, objective(start)
    for _ in range(MAX_STEPS):
        gap = value - floor
        if gap <= NEGLIGIBLE * scale:
            break
        candidate = solve_about(point, float(f"{gap:.{_DECIMALS}g}"))
        reached = objective(candidate)
        decrease = max(0.0, value - reached)
        if reached < value:
            point, value = candidate, reached
        if decrease <= MIN_DECREASE * gap:
            break
    return point


def rounded(x: Real) -> Real:
    """Return the exponents or slopes `x` to `_DECIMALS` decimals, the same on all processors."""
    return np.round(x, _DECIMALS)


def shrink(c: Real) -> Real:
    """Return the factor min(1, CAP / c) for exponents worth `c` at the point of expansion.

    Exponents of 10^4 make cones that no solver scales. Such a term is worth e^-10000 and may be
    replaced by any larger one that is negligible as well: t -> t CAP / c. For t >= 0 that raises
    e^-t; for t < 0 the term stays above 1, which the true term never exceeds. The surrogate remains
    an upper bound, with an error below e^-CAP at the point of expansion.

    >>> shrink(np.array([4.0, 400.0])).tolist()
    [1.0, 0.1]
    """
    return np.minimum(1.0, CAP / np.maximum(c, CAP))
