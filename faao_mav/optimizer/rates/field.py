"""Both links' rates as functions of the UAV's position: what a flight maximises the means of."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import Design
from faao_mav.optimizer.interior.rewards import Stage, StageValues
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.rates import RateModel, by_position, link_coordinates
from faao_mav.optimizer.rates.slot_rate import SlotRate
from faao_mav.optimizer.rates.table_rate import kind_of, table_rates
from faao_mav.radio.gain import PER_DB, GainField
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
            gain_log, cosine = link_coordinates(link, w)
            rates.append(rate.value(gain_log + PER_DB * db, cosine))
        return np.stack(rates)

    def __call__(self, w: Real) -> StageValues:
        """Return rates, gradients and Hessians at positions w (2, ..., n), as `Stage` has them."""
        shape = (len(self.links), *w.shape[1:])
        value, gradient, hessian = np.empty(shape), np.empty((2, *shape)), np.empty((3, *shape))
        for j, (link, rate) in enumerate(zip(self.links, self.rates, strict=True)):
            partials = rate.partials(*link_coordinates(link, w))
            value[j] = partials.value
            gradient[:, j], hessian[:, j] = by_position(link, w, partials)
        return StageValues(value, gradient, hessian)

    def smoothed(self) -> "RateField":
        """Return the rates over maps that are smooth: see `Grid.smoothed`."""
        return self._of([link.gains.smoothed() for link in self.links])

    def in_slot(self, slot: int) -> "RateField":
        """Return the rates everywhere with the stations where they are in a `slot`."""
        return self._of([link.gains.in_slots(slot) for link in self.links])

    def _of(self, gains: Sequence[GainField]) -> "RateField":
        """Return the rates with other `gains` of the links."""
        pairs = zip(self.links, gains, strict=True)
        return replace(self, links=tuple(replace(link, gains=each) for link, each in pairs))


_PLACES = 16
"""Places about each over which rates are blurred. Chosen: with 30 flights are no better."""


@dataclass(frozen=True, slots=True, eq=False)
class Blurred:
    """The mean of a `stage` over places about each: Gaussian, of standard deviation `by`, m.

    Edges of rates become slopes, as steep on either side.
    """

    stage: Stage
    by: float

    def __call__(self, w: Real) -> StageValues:
        """Return rates, gradients and Hessians at positions w (2, ..., n), as `Stage` has them."""
        k = np.arange(_PLACES)
        away = self.by * np.sqrt(-2 * np.log(1 - (k + 0.5) / _PLACES))
        turn = k * np.pi * (3 - np.sqrt(5))  # the golden angle: each is as far from the others
        about = away * np.stack([np.cos(turn), np.sin(turn)])
        about -= about.mean(axis=1, keepdims=True)
        at = self.stage(w[:, None] + about.reshape(2, -1, *[1] * (w.ndim - 1)))
        return StageValues(at.value.mean(axis=1), at.gradient.mean(axis=2), at.hessian.mean(axis=2))


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
    tabled = [
        (link, np.array(link.gains.extremes(distance)))
        for link, distance in zip(links, farthest, strict=True)
        if kind_of(link, design)
    ]
    tables = iter(table_rates(tabled, design))
    return tuple(
        next(tables) if kind_of(link, design) else SlotRate(link, design) for link in links
    )
