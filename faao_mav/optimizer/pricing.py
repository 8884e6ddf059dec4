"""What a solution is worth beyond its objective: mutual information, and power to spare."""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Complex
from faao_mav.optimizer.design import design
from faao_mav.optimizer.problem import Link, build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.channel import rayleigh
from faao_mav.radio.mutual_information import mean_mutual_information
from faao_mav.radio.rate import cutoff_rate

SATURATED = 0.999
"""Share of N log2(rho) from which a link counts as saturated."""

_MOST_PAIRS, _PART_PAIRS, _PARTS = 1000, 150, 6
_COARSER = 6.0  # the noise of a part may err more: its slots and draws do
_FRESH_DRAWS = 64
_FRESH_SEARCHES = 128

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

    Where fading is averaged over, slots and draws are sampled, and the error, which is stated, is
    what the sample leaves: some 5e-3. Noise is drawn from the plan's seed, so that the same plan
    gives the same value.
    """
    problem, rng = build_problem(solution.plan), np.random.default_rng(solution.plan.radio.seed)
    (bs_uav, first), (uav_user, second) = (
        _mean_information(link, link.channel(solution.w, H_r), P, rng, tolerance)
        for link, H_r, P in zip(
            problem.links,
            (solution.H_rB, solution.H_rU),
            (solution.P_B, solution.P_U),
            strict=True,
        )
    )
    return MutualInformation(bs_uav, uav_user, max(first, second))


def _mean_information(
    link: Link, H: Complex, P: Complex, rng: np.random.Generator, tolerance: float
) -> tuple[float, float]:
    """Mean of (5) or (6) over slots, and over draws where there are any, with its error.

    Of many pairs of slot and draw a sample is enough, taken evenly along their cutoff rates, with
    which the mutual information goes hand in hand. It is taken in parts, whose spread is the error.
    """
    wide = np.broadcast_to(P, (*H.shape[:-2], *P.shape[-2:]))
    H, P = H.reshape(-1, *H.shape[-2:]), wide.reshape(-1, *P.shape[-2:])
    if len(H) <= _MOST_PAIRS:
        return mean_mutual_information(
            H, P, link.modulation, link.noise, rng=rng, tolerance=tolerance
        )
    order = np.argsort(cutoff_rate(H, P, link.classes, link.noise), kind="stable")
    step = len(H) // _PART_PAIRS
    each = _COARSER * tolerance * float(np.sqrt(_PARTS))
    means, errors = [], []
    for offset in rng.permutation(step)[:_PARTS]:
        part = order[offset::step]
        mean, error = mean_mutual_information(
            H[part], P[part], link.modulation, link.noise, rng=rng, tolerance=each
        )
        means.append(mean)
        errors.append(error)
    spread = float(np.std(means, ddof=1))
    return float(np.mean(means)), max(spread, *errors) / float(np.sqrt(len(means)))


@dataclass(frozen=True, slots=True)
class FreshRates:
    """R_U and R_G of (10) on fading that was not planned on, with standard errors, bit/s/Hz."""

    bs_uav: float
    uav_user: float
    bs_uav_error: float
    uav_user_error: float

    @property
    def average(self) -> float:
        """The smaller of both, as in (9)."""
        return min(self.bs_uav, self.uav_user)

    @property
    def error(self) -> float:
        """The standard error of the smaller of both."""
        return self.bs_uav_error if self.bs_uav <= self.uav_user else self.uav_user_error


def fresh_rates(solution: Solution) -> FreshRates | None:
    """Return what `solution` carries on new draws of the fading; None unless it was averaged over.

    Every slot has draws of its own. Precoders that know the draw are made anew for each, on a
    regular sample of the slots.
    """
    problem, wanted = build_problem(solution.plan), design(solution.plan)
    if not wanted.averaged:
        return None
    rng = np.random.default_rng([solution.plan.radio.seed, 1])
    slots = len(solution.w)
    step = 1 if wanted.blind else -(-slots // _FRESH_SEARCHES)
    chosen = np.arange(step // 2, slots, step)
    w, draws = solution.w[chosen], _FRESH_DRAWS if wanted.blind else 1
    found = []
    for link, P in zip(problem.links, (solution.P_B, solution.P_U), strict=True):
        nlos = rayleigh(rng, draws * len(w), link.receive, link.transmit)
        fresh = replace(link, nlos=nlos.reshape(draws, len(w), link.receive, link.transmit))
        H = link.channel(w, fresh.small_scale(w))
        known = P[chosen] if wanted.blind else wanted.precoders(link, H)
        rates = cutoff_rate(H, known, link.classes, link.noise)
        # The slots' own means differ: within a slot it is the draws that err. One draw per slot
        # leaves only the spread over all, an upper estimate.
        spread = rates.var(axis=0, ddof=1).mean() if draws > 1 else rates.var(ddof=1)
        found.append((float(rates.mean()), float(np.sqrt(spread / rates.size))))
    (bs_uav, first), (uav_user, second) = found
    return FreshRates(bs_uav, uav_user, first, second)


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
