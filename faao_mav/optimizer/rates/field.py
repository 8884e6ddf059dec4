"""Both links' rates as functions of the UAV's position: what a flight maximises the means of."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import Design
from faao_mav.optimizer.interior.rewards import StageValues
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.rates import RateModel, link_coordinates
from faao_mav.optimizer.rates.slot_rate import SlotRate
from faao_mav.optimizer.rates.table_rate import kind_of, table_rates
from faao_mav.radio.gain import PER_DB
from faao_mav.radio.rate_steps import RateSteps


@dataclass(frozen=True, slots=True, eq=False)
class RateField:
    """The rates of the `links` by their models `rates`: a `Stage` of J = 2 rewards in bits."""

    links: tuple[Link, ...]
    rates: tuple[RateModel, ...]

    def value(self, w: Real, db: float = 0.0) -> Real:
        """Return the rates (2, ..., n) at positions w (2, ..., n), bits, of gains `db` higher."""
        rates = []
        for link, rate in zip(self.links, self.rates, strict=True):
            at = link_coordinates(link, w)
            rates.append(rate.value(at.gain_log + PER_DB * db, at.cosine))
        return np.stack(rates)

    def __call__(self, w: Real) -> StageValues:
        """Return rates, gradients and Hessians at positions w (2, ..., n), as `Stage` has them."""
        shape = (len(self.links), *w.shape[1:])
        value, gradient, hessian = np.empty(shape), np.empty((2, *shape)), np.empty((3, *shape))
        for j, (link, rate) in enumerate(zip(self.links, self.rates, strict=True)):
            at = link_coordinates(link, w)
            partials = rate.partials(at.gain_log, at.cosine)
            value[j] = partials.value
            gradient[:, j], hessian[:, j] = at.by_position(partials)
        return StageValues(value, gradient, hessian)


_LEAST_WIDTH = 4.0
"""Decibels over which steps of the SNR rise at least, before they are sharpened. Chosen."""


def rate_field(problem: Problem, design: Design, width: float | None = None) -> RateField:
    """Return the rates of `problem` under `design`, as far as a flight can reach.

    Steps of the radio's own rates rise over `width` dB, by default so wide that there is no flat
    between them.
    """
    links = problem.links
    if isinstance(steps := links[0].steps, RateSteps):
        steps = steps.widened(width or max(steps.gap, _LEAST_WIDTH))
        links = replace(links[0], steps=steps), replace(links[1], steps=steps)
    return RateField(links, rate_models(links, design, [problem.farthest(link) for link in links]))


def rate_models(
    links: Sequence[Link], design: Design, farthest: Sequence[float]
) -> tuple[RateModel, ...]:
    """Return the quickest exact rate model of each of the `links` under `design`.

    `farthest` are the largest horizontal distances from their stations, in metres, that they cover.
    """
    tabled, spans = [], []
    for link, distance in zip(links, farthest, strict=True):
        if kind_of(link, design):
            tabled.append(link)
            spans.append(np.array(link.gains.extremes(distance)))
    tables = iter(table_rates(tabled, design, spans))
    return tuple(
        next(tables) if kind_of(link, design) else SlotRate(link, design) for link in links
    )
