"""Both links' rates as functions of the UAV's position: what a flight maximises the means of."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.design import Design, Link
from faao_mav.optimizer.interior.rewards import Stage, StageValues
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.rates import RateModel, by_position, link_coordinates
from faao_mav.optimizer.rates.table_rate import STEP, kind_of, table_rates
from faao_mav.radio.gain import PER_DB, GainField
from faao_mav.radio.rate_steps import RateSteps


class SlotRate:
    """The rate that counts at the precoders of `design`, made for every slot at every call.

    Its derivatives are central differences. Precoders of a classical scheme follow the channel by a
    rule of their own. The best ones are held fixed, but for turning with the line of sight: by the
    envelope theorem the gradient is then exact, and the Hessian never exceeds the true one. Each
    search starts from the precoders of the last call.
    """

    def __init__(self, link: Link, design: Design) -> None:
        self.link, self.design = link, design
        self._last: Complex | None = None

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (..., n)."""
        H = self._channel(gain_log, cosine)
        return self.design.rate(self.link, H, self._precoders(H))

    def partials(self, gain_log: Real, cosine: Real) -> StageValues:
        """Return the rate and its derivatives by l and u: see `RateModel`."""
        rate, h = self.value, STEP
        if self.design.optimal:
            P = self.initial_precoders(gain_log, cosine)
            steering = self._steering(cosine)

            def rate(gain_log: Real, cosine: Real) -> Real:
                turned = self._steering(cosine).conj() * steering * P
                return self.link.draw_rates(self._channel(gain_log, cosine), turned)

        def at(i: int, j: int) -> Real:
            return rate(gain_log + i * h, cosine + j * h)

        middle, up, down = at(0, 0), at(1, 0), at(-1, 0)
        by_l, by_ll = (up - down) / (2 * h), (up - 2 * middle + down) / h**2
        if not self.link.follows_position:
            return StageValues(middle, by_l[None], by_ll[None])
        right, left = at(0, 1), at(0, -1)
        by_lu = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * h**2)
        by_u, by_uu = (right - left) / (2 * h), (right - 2 * middle + left) / h**2
        return StageValues(middle, np.stack([by_l, by_u]), np.stack([by_ll, by_lu, by_uu]))

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return the precoders (..., n, N_t, N_t) at l and u (..., n)."""
        return self._precoders(self._channel(gain_log, cosine))

    def _channel(self, gain_log: Real, cosine: Real) -> Complex:
        H_r = self.link.fade(self.link.line_of_sight_at(cosine))
        return np.asarray(np.exp(gain_log / 2)[..., None, None] * H_r)

    def _steering(self, cosine: Real) -> Complex:
        """Return the phases (..., n, N_t, 1) of the transmitting array at u (..., n)."""
        return self.link.line_of_sight_at(cosine)[..., 0, :, None]

    def _precoders(self, H: Complex) -> Complex:
        near = self._last if self.design.optimal else None
        if near is not None and near.shape[:-2] != H.shape[:-2]:  # those of the first flight
            first = near.reshape(-1, *near.shape[-3:])[0]
            near = np.broadcast_to(first, (*H.shape[:-2], *near.shape[-2:]))
        self._last = P = self.design.precoders(self.link, H, start=near)
        return P


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
        found = [
            by_position(link, w, rate.partials(*link_coordinates(link, w)))
            for link, rate in zip(self.links, self.rates, strict=True)
        ]
        return StageValues(
            np.stack([each.value for each in found]),
            np.stack([each.gradient for each in found], axis=1),
            np.stack([each.hessian for each in found], axis=1),
        )

    def over(self, changed: Callable[..., GainField], *how: int) -> "RateField":
        """Return the rates over path gains that a method of theirs has `changed`, by `how`."""
        links = (replace(link, gains=changed(link.gains, *how)) for link in self.links)
        return replace(self, links=tuple(links))


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

    Of each link it is the quickest exact rate model. Steps of the radio's own rates rise over
    `width` dB, by default so wide that there is no flat between them.
    """
    links = problem.links
    if isinstance(steps := links[0].steps, RateSteps):
        steps = steps.widened(width or max([_LEAST_WIDTH, *np.diff(steps.snr_db)]))
        links = replace(links[0], steps=steps), replace(links[1], steps=steps)
    tabled = [link for link in links if kind_of(link, design)]
    spans = [np.array(link.gains.extremes(problem.farthest(link))) for link in tabled]
    tables = iter(table_rates(list(zip(tabled, spans, strict=True)), design))
    rates = (next(tables) if kind_of(link, design) else SlotRate(link, design) for link in links)
    return RateField(links, tuple(rates))
