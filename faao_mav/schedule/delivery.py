"""What the radio delivers along a flight that is not quite the planned one."""

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.errors import InputError
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.vector import lengths


def delivered(solution: Solution, w: Real, slots: Integers | None = None) -> tuple[Real, Real]:
    """Return (7) and (8), bits, each (n,), where the aircraft is at `w` (n, 2) in slot n.

    Each slot keeps its fading; the line of sight and the path gain are those at `w`. The
    precoders are those of the same slot, or of `slots` (n,), as `nearest_slots` gives for a radio
    that goes by position. Precoders that know the draw of an averaged fading stay with the draw.
    """
    if w.shape != solution.w.shape:
        raise InputError(f"positions {w.shape}; expected one per slot, {solution.w.shape}")
    problem = build_problem(solution.plan)
    found = []
    for link, P in zip(problem.links, (solution.P_B, solution.P_U), strict=True):
        chosen = P if slots is None else P[..., slots, :, :]
        found.append(link.rates(w, link.small_scale(w), chosen))
    I_U, I_G = found
    return I_U, I_G


def nearest_slots(solution: Solution, w: Real) -> Integers:
    """Return for each of `w` (n, 2) the slot (n,) that is planned nearest to it."""
    return np.array([int(np.argmin(lengths(solution.w - place))) for place in w], dtype=int)
