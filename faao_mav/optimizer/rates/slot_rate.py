"""Rates of links whose fading is known slot by slot."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import DirectionPartials, RatePartials

_STEP = 1e-3
"""Step of l and u in central differences: derivatives of rates of a few bits err by about 1e-5."""


class BestRate:
    """The rate that counts at the best precoders, searched in every slot at every call.

    By the envelope theorem its gradient is that at fixed best precoders. Its Hessian is that of
    precoders which are rotated with the line of sight and fixed otherwise; it never exceeds the
    true one. Each search starts from the precoders of the last call.
    """

    exact = False
    """Whether the best precoders have a closed form."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self._last: Complex | None = None

    def precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return the best precoders (..., n, N_t, N_t) at l and u (..., n)."""
        H = channel(self.link, gain_log, cosine)[..., None, :, :]
        self._last = P = self.link.best(H, self._near(gain_log.shape))
        return P

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return precoders (..., n, N_t, N_t) close to the best: those of the last call."""
        near = self._near(gain_log.shape)
        return self.precoders(gain_log, cosine) if near is None else near

    def _near(self, shape: tuple[int, ...]) -> Complex | None:
        """Return the last precoders for slots of `shape`, those of the first flight for others."""
        if self._last is None or self._last.shape[:-2] == shape:
            return self._last
        one = self._last.reshape(-1, *self._last.shape[-3:])[0]
        return np.broadcast_to(one, (*shape, *one.shape[1:]))

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (n,)."""
        P = self.precoders(gain_log, cosine)
        return self.link.draw_rates(channel(self.link, gain_log, cosine), P)

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives with precoders that rotate with the line of sight."""
        link, P = self.link, self.precoders(gain_log, cosine)
        first = np.conj(link.line_of_sight_at(cosine)[..., :1, :])

        def rotated(gain_log: Real, cosine: Real) -> Real:
            turn = first * link.line_of_sight_at(cosine)[..., :1, :]
            return link.draw_rates(channel(link, gain_log, cosine), np.conj(turn).mT * P)

        return differences(rotated, gain_log, cosine, both=link.follows_position)


@dataclass(frozen=True, slots=True, eq=False)
class DifferencedRate:
    """Any rate of the channel, `rate_of(H)` (n,) bits, with derivatives by central differences.

    It serves precoders that follow the channel by a rule of their own: the envelope theorem does
    not hold for them.
    """

    link: Link
    rate_of: Callable[[Complex], Real]

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (n,)."""
        return self.rate_of(channel(self.link, gain_log, cosine))

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives by l and u, bits (n,), in error by about 1e-5."""
        return differences(self.value, gain_log, cosine, both=self.link.follows_position)


def differences(
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
    return RatePartials(middle, by_l, by_ll, DirectionPartials(by_u, by_lu, by_uu))


def channel(link: Link, gain_log: Real, cosine: Real) -> Complex:
    """Return H = e^(l/2) H_r of (1) or (2), (..., n, N_r, N_t), at l and u (..., n)."""
    H_r = link.fade(link.line_of_sight_at(cosine))
    return np.asarray(np.exp(gain_log / 2)[..., None, None] * H_r)
