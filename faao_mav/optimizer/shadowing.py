"""Shadowing about the law of the gain: what arrives under it, and flights that it harms less.

Shadowing is a Gaussian field over the places of the aircraft for each hop, independent of the
other's: X dB of standard deviation sigma (`spread_db`) and correlation exp(-r / D) at a distance r
(`correlation_m`). The mean rate of a hop is the less certain the longer the aircraft stays about
one place. To first order the variance of what arrives is

    V = sum_j sigma_j^2 sum_nm a_jn a_jm exp(-|w_n - w_m| / D_j),  a_jn = weight_j / N dI_jn / dX

Where z standard deviations less arrive than in the mean, the shadowing that is expected at a place
w is X_j = -z sigma_j^2 sum_n a_jn exp(-|w - w_n| / D_j) / sqrt(V). Flights that are better under it
stay less about one place.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.rates.field import RateField
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.gain_map import Grid
from faao_mav.radio.spline import Spline

SHADOWINGS = 400
"""Shadowings of which quantiles are told: their error is 7 % of the standard deviation. Chosen."""

_WAVES, _REACH, _OFFSETS = 64, 4.0, 25
"""Waves of which a field is the sum; standard deviations, and points between, at which rates are
known, linear between. Chosen."""

_TINY = 1e-12
"""A rate, bit/s/Hz, and a variance that count as none."""

_CELLS, _PLACES, _ROUND = 64, 1000, 0.25
"""Points along each side of the map of that shadowing; places of the flight of which it is the sum,
at most; part of D over which its correlation is rounded at its peak. Chosen."""

Rates: TypeAlias = Callable[[float], Real]
"""The rates of both hops (2, n), bits, where all gains are so many dB above the law."""

SHADES = (0.25, 0.5, 0.9, 1.4)
"""Standard deviations below the mean that flights are sought for. Chosen: of copters over 100 to
400 m, with 6 dB and D of 25 and 50 m, the best at nine of ten is the third, in the mean the first
or none."""


def shadows(problem: Problem, w: Real, count: int = SHADOWINGS) -> Iterator[Real]:
    """Yield shadowings of both hops at positions w (n, 2), dB, (2, n) each; by the plan's seed.

    Of a station that moves the field is over its places too. A wave number with the spectrum of
    exp(-r / D) is a Gaussian over the size of another.
    """
    radio, rng = problem.plan.radio, np.random.default_rng([problem.plan.radio.seed, 2])
    hops = [*zip(problem.links, radio.gain_laws, radio.spreads, strict=True)]
    for _ in range(count):
        found = []
        for link, law, spread in hops:
            p = link.gains.station
            places = np.hstack([w, p]) if p.ndim > 1 else w
            size = np.abs(rng.standard_normal((_WAVES, 1))) * law.correlation_m
            waves = rng.standard_normal((_WAVES, places.shape[1])) / size
            phases = rng.uniform(0, 2 * np.pi, (_WAVES, 1))
            height = spread * np.sqrt(2 / _WAVES)
            found.append(height * np.cos(waves @ places.T + phases).sum(axis=0))
        yield np.array(found)


def outcomes(problem: Problem, w: Real, rates: Rates, count: int = SHADOWINGS) -> Real:
    """Return what has arrived after each slot under `count` of the `shadows` at w (n, 2).

    Bits per slot and hertz (count, n), each the sum of what was before; see `arriving`.
    """
    most = _REACH * max(problem.plan.radio.spreads)
    db, slots, now = np.linspace(-most, most, _OFFSETS), np.arange(float(len(w))), rates(0.0)
    shares = problem.relay.best_shares(now[0], now[1], problem.kinematics.time_step)
    hops = [Grid.through(db, slots, each) for each in np.stack([*map(rates, db)], axis=1)]

    def arrived(shadow: Real) -> Real:
        under = [hop.value(each, slots) for hop, each in zip(hops, shadow, strict=True)]
        return arriving(problem, np.array(under), shares)

    return np.array([*map(arrived, shadows(problem, w, count))])


def arriving(problem: Problem, rates: Real, shares: Real | None = None) -> Real:
    """Return what has arrived after each slot (n,) at `rates` (2, n), with given or best shares.

    It is a sum, of which the last over n is what the plan maximises, bit/s/Hz: of what a relay
    forwards or, for R_avg, what both hops have carried.
    """
    if (queue := problem.maximised_queue) is None:
        return np.asarray(rates.cumsum(axis=1).min(axis=0))
    relayed = queue.relayed(rates[0], rates[1], problem.kinematics.time_step, shares)
    return relayed.forwarded.cumsum()


@dataclass(frozen=True, slots=True, eq=False)
class Shadowed:
    """What arrives under shadowing, bit/s/Hz: the mean, and quantiles by their probability.

    `worth` is what the plan wants of them: the mean, or the quantile that `radio.reliability` asks
    for. `arrived` are the quantiles after each slot (n,), sums in bits per slot and hertz.
    """

    worth: float
    mean: float
    quantiles: Mapping[float, float]
    arrived: Mapping[float, Real]


def shadowed(solution: Solution) -> Shadowed | None:
    """Return what arrives of a solution with its precoders; None where no spread is known."""
    if not any(solution.plan.radio.spreads):
        return None
    return under_shadowing(
        solution.problem,
        solution.w,
        lambda db: np.array(solution.recomputed_slots(10 ** (db / 10))),
    )


def worth(solution: Solution) -> float:
    """Return what a goal counts of a solution, bit/s/Hz: `Shadowed.worth`, or what is delivered."""
    under = shadowed(solution)
    return solution.delivered_rate if under is None else under.worth


def under_shadowing(problem: Problem, w: Real, rates: Rates) -> Shadowed:
    """Return what arrives at w (n, 2); see `outcomes`."""
    found, reliability = outcomes(problem, w, rates), problem.plan.radio.reliability
    asked = [] if reliability is None else [round(1 - reliability, 9)]
    parts = sorted({0.1, 0.5, 0.9, *asked})
    arrived = dict(zip(parts, np.quantile(found, parts, axis=0), strict=True))
    quantiles = {part: float(sums[-1]) / len(w) for part, sums in arrived.items()}
    mean = float(found[:, -1].mean()) / len(w)
    return Shadowed(quantiles[asked[0]] if asked else mean, mean, quantiles, arrived)


def shaded(problem: Problem, field: RateField, w: Real, z: float) -> RateField:
    """Return `field` under the shadowing that is expected where z standard deviations less arrive.

    That is less than in the mean of a flight at w (n, 2).
    """
    now, slopes = field.value(w.T), field.value(w.T, 0.5) - field.value(w.T, -0.5)
    parts = ([[1], [1]], [[0.99], [1]], [[1], [0.99]])
    most, *less = (arriving(problem, now * np.array(part))[-1] / len(w) for part in parts)
    lost = np.maximum(_TINY, most - np.array(less))
    a = slopes * (lost / lost.sum())[:, None] / len(w)
    radio, every = problem.plan.radio, -(-len(w) // _PLACES)
    far = 2 * max(law.correlation_m for law in radio.gain_laws)
    x, y = (np.linspace(each.min() - far, each.max() + far, _CELLS) for each in w.T)
    felt, variance = [], _TINY
    for law, spread, each in zip(radio.gain_laws, radio.spreads, a, strict=True):
        rounded = max(_ROUND * law.correlation_m, x[1] - x[0], y[1] - y[0])
        away = np.hypot(x[:, None, None] - w[::every, 0], y[:, None] - w[::every, 1])
        sums = np.exp(-np.hypot(away, rounded) / law.correlation_m) @ each[::every]
        felt.append(every * spread**2 * sums)
        variance += float(each @ Spline.through(x, y, felt[-1]).value(*w.T))
    links = []
    for link, each in zip(field.links, felt, strict=True):
        above = 0.0 if link.gains.above is None else link.gains.above.value(x[:, None], y)
        shade = Spline.through(x, y, above - z / np.sqrt(variance) * each)
        links.append(replace(link, gains=replace(link.gains, above=shade)))
    return replace(field, links=tuple(links))
