"""The best rates of the links over the gain: what every bound rests on."""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import Link, design
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.rates.field import SlotRate
from faao_mav.optimizer.rates.table_rate import kind_of, table_rates

_SEARCHED = 25
"""Gains at which precoders are searched where there is no table of modes. Chosen."""

_DIRECTIONS = 257
"""Directions u over which the largest singular values are taken. Chosen."""


_WIDTH = 0.25
"""Decibels before its SNR over which a step of a radio's own rates rises in a bound. Chosen."""


_GAINS = 2_000
"""Gains at which rates are tabulated. Chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class BestRates:
    """Upper bounds on the best rates of both links by l: they rise with it.

    `values` (2, slots or 1, m) at evenly rising l, `gain_logs` (2, m), bits.
    """

    gain_logs: Real
    values: Real

    @property
    def known(self) -> bool:
        """Whether each slot has rates of its own, of known draws."""
        return len(self.values[0]) > 1

    def at(self, link: int, slot: int, gain_log: Real) -> Real:
        """Return the most that `link` has in `slot` at l up to `gain_log` (...), bits."""
        row = self.values[link, slot if self.known else 0]
        return np.asarray(np.interp(gain_log, self.gain_logs[link], row))


def best_rates(problem: Problem) -> BestRates:
    """Return upper bounds on the best rates at all gains that a flight can have."""
    links = problem.links
    known = any(link.nlos is not None and not link.averaged for link in links)
    gain_logs, values = [], []
    for link in links:
        ends = link.gains.extremes(problem.farthest(link))
        gain_log = np.linspace(*ends, _GAINS)
        slots = problem.kinematics.slots if known else 1
        best = best_at(problem, link, np.broadcast_to(gain_log, (slots, len(gain_log))))
        # A curve rises by at most h² |R''| / 8 above its chord; the double allows for R'' being
        # known on the grid only.
        best = best + np.abs(np.diff(best, 2, axis=1)).max(axis=1, keepdims=True) / 4
        gain_logs.append(gain_log)
        values.append(np.maximum.accumulate(best, axis=1))
    return BestRates(np.stack(gain_logs), np.stack(values))


def best_at(problem: Problem, link: Link, gain_log: Real) -> Real:
    """Return the best rate of every slot at l (n, m), bits.

    Where a draw is known for every slot and the channel depends on the direction, the result is an
    upper bound: each singular value of H_r is the largest over all directions.
    """
    optimal = replace(design(problem.plan), scheme="faao", gaussian=False)
    if link.steps is not None:
        link = replace(link, steps=link.steps.widened(_WIDTH, above=True))
    slots, gain_log = len(gain_log), gain_log.T
    if link.nlos is not None and not optimal.averaged:
        singular = _largest_singular_values(link, slots)
        H_r = np.zeros((slots, link.receive, link.transmit), dtype=np.complex128)
        k = np.arange(singular.shape[1])
        H_r[:, k, k] = singular
        link = replace(link, line_of_sight="all_ones", nlos=H_r, rician_factor=0.0)
    if kind_of(link, optimal):
        span = np.array([gain_log.min(), gain_log.max()])
        (table,) = table_rates([(link, span)], optimal)
        return table.value(gain_log, np.zeros(slots)).T
    # One gain after the other, each search starting from the precoders of the last.
    from scipy.interpolate import CubicSpline

    levels = np.linspace(gain_log.min(), gain_log.max(), _SEARCHED)
    each, every = SlotRate(link, optimal), np.ones(slots)
    rates = [each.value(level * every, every) for level in levels]
    return np.asarray(CubicSpline(levels, rates)(gain_log[:, 0])).T


def _largest_singular_values(link: Link, slots: int) -> Real:
    """Return upper bounds on the singular values of H_r over all directions, (slots, modes)."""
    directions = np.linspace(-1, 1, _DIRECTIONS) if link.follows_position else np.zeros(1)
    largest = np.zeros((slots, min(link.receive, link.transmit)))
    for u in directions:
        H_r = link.fade(link.line_of_sight_at(np.full(slots, u)))
        largest = np.maximum(largest, np.linalg.svd(H_r, compute_uv=False))
    # Between two directions of the grid a singular value changes by less than the norm of the
    # change of H_r, in which no phase changes by more than pi (antennas - 1) du.
    du = 1 / (len(directions) - 1) if len(directions) > 1 else 0.0
    phase = np.pi * (max(link.receive, link.transmit) - 1) * du
    share = np.sqrt(link.rician_factor / (1 + link.rician_factor))
    return np.asarray(largest + phase * share * np.sqrt(link.receive * link.transmit))
