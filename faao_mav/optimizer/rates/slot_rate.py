"""Rates of links whose fading is known slot by slot."""

from collections.abc import Callable

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.design import Design
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import RatePartials

_STEP = 1e-3
"""Step of l and u in central differences: derivatives of rates of a few bits err by about 1e-5."""


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

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives by l and u, bits (..., n)."""
        rate = self.value
        if self.design.optimal:
            P = self.initial_precoders(gain_log, cosine)
            steering = self._steering(cosine)

            def rate(gain_log: Real, cosine: Real) -> Real:
                turned = self._steering(cosine).conj() * steering * P
                return self.link.draw_rates(self._channel(gain_log, cosine), turned)

        return _by_differences(rate, gain_log, cosine, both=self.link.follows_position)

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return the precoders (..., n, N_t, N_t) at l and u (..., n)."""
        return self._precoders(self._channel(gain_log, cosine))

    def _channel(self, gain_log: Real, cosine: Real) -> Complex:
        """Return H of (1) or (2), (..., n, N_r, N_t), at l and u (..., n)."""
        H_r = self.link.fade(self.link.line_of_sight_at(cosine))
        return np.asarray(np.exp(gain_log / 2)[..., None, None] * H_r)

    def _steering(self, cosine: Real) -> Complex:
        """Return the phases (..., n, N_t, 1) of the transmitting array at u (..., n)."""
        return self.link.line_of_sight_at(cosine)[..., 0, :, None]

    def _precoders(self, H: Complex) -> Complex:
        near = self._last if self.design.optimal else None
        if near is not None and near.shape[:-2] != H.shape[:-2]:  # those of the first flight
            near = np.broadcast_to(
                near.reshape(-1, *near.shape[-3:])[0], (*H.shape[:-2], *near.shape[-2:])
            )
        self._last = P = self.design.precoders(self.link, H, start=near)
        return P


def _by_differences(
    rate: Callable[[Real, Real], Real], gain_log: Real, cosine: Real, *, both: bool
) -> RatePartials:
    """Return `rate` at l and u with central differences by l, and by u too if `both`."""
    h = _STEP

    def at(i: int, j: int) -> Real:
        return rate(gain_log + i * h, cosine + j * h)

    middle, up, down = at(0, 0), at(1, 0), at(-1, 0)
    by_l, by_ll = (up - down) / (2 * h), (up - 2 * middle + down) / h**2
    if not both:
        return RatePartials(middle, by_l, by_ll)
    right, left = at(0, 1), at(0, -1)
    by_lu = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * h**2)
    by_u, by_uu = (right - left) / (2 * h), (right - 2 * middle + left) / h**2
    return RatePartials(middle, by_l, by_ll, by_u, by_lu, by_uu)
