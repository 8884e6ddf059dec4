"""Figures of a solution beyond its objective R_avg.

`price` has its mutual information, `fresh_rates` its rates on new draws of the fading, `saturation`
the power that it could do without.

>>> from faao_mav import optimize, price, read_plan, saturation
>>> solution = optimize(read_plan("missions/paper.yaml"))
>>> round(saturation(solution).spare_db, 1), round(price(solution).average, 4)  # dB, bit/s/Hz
(19.7, 2.0)
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InputError
from faao_mav.optimizer.design import Link, design
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.channel import rayleigh
from faao_mav.radio.mutual_information import mutual_information
from faao_mav.radio.rate import cutoff_rate

SATURATED = 0.999
"""Part of N log2(rho) from which a link counts as saturated. Chosen."""

_NOISES_PER_PAIR, _SEEDS = 128, 4
"""Noises that each pair of slot and draw has of which the mutual information is averaged, and sets
of noises, whose spread is the standard error of the average over them. Chosen."""

_MOST_NOISES, _LIKELIHOODS = 1 << 15, 1 << 24
"""Noises of a set for all pairs, at most, and likelihoods that they may take. Chosen: means over a
set with the most spread by 1e-3 bit from set to set, with 64-QAM on two antennas by 1e-2.
"""

_DEGREE, _DECIMALS = 5, 9
"""The degree of the polynomial from cutoff rates to mutual information, and decimals of the cutoff
rates, bit, by which the sample is ordered. Chosen."""

_FRESH_DRAWS, _FRESH_SLOTS = 64, 256
"""New draws of the fading per slot where one precoder serves all draws, and slots with some, at
most. Chosen."""


@dataclass(frozen=True, slots=True)
class MutualInformation:
    """The rates (10) with the mutual information (5), (6) in place of the cutoff rate, bit/s/Hz.

    `delivered` is what the relay delivers of it. `error` is the larger of the standard errors of
    the two means.
    """

    bs_uav: float
    uav_user: float
    delivered: float
    error: float

    @property
    def average(self) -> float:
        """The smaller of the two rates, as in (9), bit/s/Hz."""
        return min(self.bs_uav, self.uav_user)


def price(solution: Solution) -> MutualInformation:
    """Return the mutual information of both links along `solution`, bit/s/Hz.

    The noises are fixed: the same plan gives the same value. Raises `InputError` for a plan whose
    `radio.rates` take the place of the alphabet.

    >>> from faao_mav import optimize, read_plan
    >>> solution = optimize(read_plan("missions/copter_relay.yaml"))
    >>> price(solution).average > solution.rates.R_avg  # the cutoff rate bounds it from below
    True
    """
    if solution.problem.uav_user.steps is not None:
        raise InputError("radio.rates: rates of the radio's own have no mutual information")
    (bs_uav, I_U, first), (uav_user, I_G, second) = (
        _information(link, link.channel(solution.w, H_r), P) for link, H_r, P in solution.hops
    )
    delivered = solution.relay(I_U, I_G, solution.shares).rate
    return MutualInformation(bs_uav, uav_user, delivered, max(first, second))


def _information(link: Link, H: Complex, P: Complex) -> tuple[float, Real, float]:
    """Return the mean of (5) or (6) over slots and draws, that of each slot (n,), and the error.

    The pairs of slot and draw are sampled evenly in the order of their cutoff rates. The mutual
    information is nearly a function of the cutoff rate: a polynomial through the sample, by least
    squares, stands for all pairs. The standard error of the mean, bits, is that of the noises and
    that of how the sample scatters about the polynomial, unless all pairs are in it.
    """
    pairs = H.shape[:-2]
    wide = np.broadcast_to(P, (*pairs, *P.shape[-2:]))
    H, P = H.reshape(-1, *H.shape[-2:]), wide.reshape(-1, *P.shape[-2:])
    cutoff = cutoff_rate(H, P, link.modulation, link.noise)
    noises = min(_MOST_NOISES, _LIKELIHOODS // link.classes.symbols)
    count = min(len(H), noises // _NOISES_PER_PAIR)
    # Rounded: the order of equal rates, and so the sample, is the same whoever sums them.
    order = np.argsort(np.round(cutoff, _DECIMALS), kind="stable")
    part = order[np.linspace(0, len(H) - 1, count).astype(np.intp)]
    at = H[part], P[part], link.modulation, link.noise
    sets = np.array([mutual_information(*at, nodes=noises, seed=k) for k in range(_SEEDS)])
    sample = sets.mean(axis=0)
    powers = np.vander(cutoff / link.classes.bits, _DEGREE + 1)
    fit, *_ = np.linalg.lstsq(powers[part], sample)
    fitted = np.clip(powers @ fit, 0.0, link.classes.bits)
    scatter = np.mean((powers[part] @ fit - sample) ** 2) / count if count < len(H) else 0.0
    error = np.sqrt(sets.mean(axis=1).var(ddof=1) / _SEEDS + scatter)
    each = fitted.reshape(-1, pairs[-1]).mean(axis=0)
    return float(each.mean()), each, float(error)


@dataclass(frozen=True, slots=True)
class FreshRates:
    """Rates on draws that the plan does not know, and their standard errors, bit/s/Hz.

    `average` is the smaller of R_U and R_G, as in (9), `delivered` is R_del.
    """

    average: float
    error: float
    delivered: float
    delivered_error: float


def fresh_rates(solution: Solution) -> FreshRates | None:
    """Return the rates of `solution` on new draws of the fading; None unless it was averaged over.

    At most `_FRESH_SLOTS`, evenly apart, have draws of their own. What is delivered is the mean of
    flights that have one of the draws in each slot, forwarded with the planned shares.
    """
    how = design(solution.plan, solution.problem.precoder)
    if not how.averaged:
        return None
    rng = np.random.default_rng([solution.plan.radio.seed, 1])
    slots = len(solution.w)
    step = -(-slots // _FRESH_SLOTS)
    chosen = np.arange(step // 2, slots, step)
    w, draws = solution.w[chosen], _FRESH_DRAWS if how.blind else 1
    found, rates = [], []
    for link, _, P in solution.hops:
        nlos = rayleigh(rng, draws * len(w), link.receive, link.transmit)
        nlos = nlos.reshape(draws, len(w), link.receive, link.transmit)
        fresh = replace(link, nlos=nlos, gains=link.gains.in_slots(chosen))
        H = fresh.channel(w)
        P = P[chosen] if how.blind else how.precoders(link, H)
        at = np.maximum(0.0, link.draw_rates(H, P))
        rates.append(at)
        # The error is that of the draws within each slot, not the spread from slot to slot. With
        # one draw per slot only the spread over all slots is known, an upper estimate.
        spread = at.var(axis=0, ddof=1).mean() if draws > 1 else at.var(ddof=1)
        found.append((float(at.mean()), float(np.sqrt(spread / at.size))))
    # each chosen slot stands for those about it
    nearest = np.minimum(np.arange(slots) // step, len(chosen) - 1)
    delivered = [
        solution.relay(I_U[nearest], I_G[nearest], solution.shares).rate
        for I_U, I_G in zip(*rates, strict=True)
    ]
    larger = max(error for _, error in found)
    error = float(np.std(delivered, ddof=1) / np.sqrt(draws)) if draws > 1 else larger
    return FreshRates(*min(found), float(np.mean(delivered)), error)


@dataclass(frozen=True, slots=True)
class Saturation:
    """Whether the alphabet, not the power, limits the rate.

    `ceiling` is what the alphabet allows of the rate that the plan maximises, bit/s/Hz: the smaller
    N log2(rho) of the two links, or what the relay delivers of it. `spare_db` is by how many dB
    both powers could fall before that rate is below `SATURATED` times the ceiling; 0 for a plan
    that is not saturated.
    """

    ceiling: float
    spare_db: float

    @property
    def saturated(self) -> bool:
        """Whether less power would do; the route then hardly matters."""
        return self.spare_db > 0


def saturation(solution: Solution) -> Saturation:
    """Return how far into saturation `solution` is, with its own route, precoders and shares.

    >>> from faao_mav import optimize, read_plan
    >>> plan = read_plan("missions/paper_active.yaml").changed({"optimizer.method": "direct"})
    >>> saturation(optimize(plan)).saturated
    False
    """
    problem, n = solution.problem, len(solution.w)
    full = np.array([[link.most] for link in problem.links])
    ceiling = problem.value(full.repeat(n, axis=1))

    def spare(db: float) -> float:
        rates = np.array(solution.recomputed_slots(10 ** (-db / 10)))
        return problem.value(rates, solution.shares) - SATURATED * ceiling

    if spare(0.0) < 0:
        return Saturation(ceiling, 0.0)
    from scipy.optimize import brentq  # slow to load; no link has 300 dB to spare

    return Saturation(ceiling, float(brentq(spare, 0.0, 300.0)))
