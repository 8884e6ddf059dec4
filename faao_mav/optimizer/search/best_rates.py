"""The best rate of a link over its distance: what every bound rests on."""

from dataclasses import replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.rates.slot_rate import SlotRate
from faao_mav.optimizer.rates.table_rate import kind_of, table_rates

_SEARCHED = 25
"""Gains at which precoders are searched where there is no table of modes. Chosen."""

_DIRECTIONS = 257
"""Directions u over which the largest singular values are taken. Chosen."""


_WIDTH = 0.25
"""Decibels before its SNR over which a step of a radio's own rates rises in a bound. Chosen."""


def best_rates(problem: Problem, link: Link, r: Real) -> tuple[Real, bool]:
    """Return the best rate of every slot at distances r (n, m), bits, and whether it is exact.

    Where a draw is known for every slot and the channel depends on the direction, the result is an
    upper bound: each singular value of H_r is the largest over all directions.
    """
    optimal = replace(design(problem.plan), scheme="faao", gaussian=False)
    exact = link.closed_form and link.measure == "cutoff"
    if link.steps is not None:
        link = replace(link, steps=link.steps.above(_WIDTH))
    gain_log = link.gains.law.log(r**2 + link.gains.height**2, link.gains.height).T
    if link.nlos is not None and not optimal.averaged:
        singular = _largest_singular_values(link, len(r))
        H_r = np.zeros((len(r), link.receive, link.transmit), dtype=np.complex128)
        k = np.arange(singular.shape[1])
        H_r[:, k, k] = singular
        link = replace(link, line_of_sight="all_ones", nlos=H_r, rician_factor=0.0)
    if kind_of(link, optimal):
        span = np.array([gain_log.min(), gain_log.max()])
        (table,) = table_rates([link], optimal, [span])
        return table.value(gain_log, gain_log).T, not optimal.averaged and exact
    # One gain after the other, each search starting from the precoders of the last.
    from scipy.interpolate import CubicSpline

    levels = np.linspace(gain_log.min(), gain_log.max(), _SEARCHED)
    each, every = SlotRate(link, optimal), np.ones(len(r))
    rates = [each.value(level * every, every) for level in levels]
    return np.asarray(CubicSpline(levels, rates)(gain_log[:, 0])).T, exact


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
    return np.asarray(largest + phase * link.los_share * np.sqrt(link.receive * link.transmit))
