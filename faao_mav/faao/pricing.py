"""What a solution is worth beyond its objective: mutual information, and power to spare."""

from dataclasses import dataclass

import numpy as np

from faao_mav.faao.problem import build_problem
from faao_mav.faao.solution import Solution
from faao_mav.radio.mutual_information import mean_mutual_information

SATURATED = 0.999
"""Share of N log2(rho) from which a link counts as saturated."""

_MAX_SPARE_DB = 300.0
_BISECTIONS = 60


@dataclass(frozen=True, slots=True)
class MutualInformation:
    """(9), (10) with the mutual information (5), (6) in place of its bound, bit/s/Hz.

    `error` is the larger error of the two means, one standard error where it was drawn.
    """

    bs_uav: float
    uav_user: float
    error: float

    @property
    def average(self) -> float:
        """The smaller of both, as in (9)."""
        return min(self.bs_uav, self.uav_user)


def price(solution: Solution, *, tolerance: float = 1e-3) -> MutualInformation:
    """Return the mutual information along `solution` with an error of at most `tolerance`.

    Noise is drawn from the plan's seed, so that the same plan gives the same value.
    """
    problem, rng = build_problem(solution.plan), np.random.default_rng(solution.plan.radio.seed)
    (bs_uav, first), (uav_user, second) = (
        mean_mutual_information(
            link.channel(solution.w, H_r),
            P,
            link.modulation,
            link.noise,
            rng=rng,
            tolerance=tolerance,
        )
        for link, H_r, P in zip(
            problem.links,
            (solution.H_rB, solution.H_rU),
            (solution.P_B, solution.P_U),
            strict=True,
        )
    )
    return MutualInformation(bs_uav, uav_user, max(first, second))


@dataclass(frozen=True, slots=True)
class Saturation:
    """Whether the alphabet, not the link, limits the rate.

    `ceiling` is the least N log2(rho) of both links, bit/s/Hz; `spare_db` by how many dB both
    powers could fall before R_avg leaves `SATURATED` of it, 0 for a plan that is not saturated.
    """

    ceiling: float
    spare_db: float

    @property
    def saturated(self) -> bool:
        """Whether power could be saved: the route hardly matters."""
        return self.spare_db > 0


def saturation(solution: Solution) -> Saturation:
    """Return how far `solution` is into saturation, with its own route and precoders."""
    ceiling = min(link.classes.bits for link in build_problem(solution.plan).links)

    def enough(db: float) -> bool:
        return solution.recomputed(10 ** (-db / 10)).R_avg >= SATURATED * ceiling

    if not enough(0.0):
        return Saturation(ceiling, 0.0)
    low, high = 0.0, _MAX_SPARE_DB
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if enough(middle) else (low, middle)
    return Saturation(ceiling, low)
