"""Rates of links whose fading is known slot by slot."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.design import Design
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import RatePartials
from faao_mav.radio.constellation import coordinates
from faao_mav.radio.rate import class_sum

_LN2 = float(np.log(2.0))

_STEP = 1e-3
"""Step of l and u in central differences: derivatives of rates of a few bits err by about 1e-5."""


class SlotRate:
    """The rate that counts at the precoders of `design`, made for every slot at every call.

    For the best ones the gradient is that at fixed precoders, by the envelope theorem, and the
    Hessian that of `FixedRate`, which never exceeds the true one; each search starts from the
    precoders of the last call. Those of a classical scheme follow the channel by a rule of their
    own, and the derivatives are central differences.
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
        if not self.design.optimal:
            both = self.link.follows_position
            return by_differences(self.value, gain_log, cosine, both=both)
        P = self._precoders(self._channel(gain_log, cosine))
        return FixedRate(self.link, unturned(self.link, cosine, P)).partials(gain_log, cosine)

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return the precoders (..., n, N_t, N_t) at l and u (..., n)."""
        return self._precoders(self._channel(gain_log, cosine))

    def _channel(self, gain_log: Real, cosine: Real) -> Complex:
        """Return H = e^(l/2) H_r of (1) or (2), (..., n, N_r, N_t), at l and u (..., n)."""
        H_r = self.link.fade(self.link.line_of_sight_at(cosine))
        return np.asarray(np.exp(gain_log / 2)[..., None, None] * H_r)

    def _precoders(self, H: Complex) -> Complex:
        near = self._last if self.design.optimal else None
        if near is not None and near.shape[:-2] != H.shape[:-2]:  # those of the first flight
            near = np.broadcast_to(
                near.reshape(-1, *near.shape[-3:])[0], (*H.shape[:-2], *near.shape[-2:])
            )
        self._last = P = self.design.precoders(self.link, H, start=near)
        return P


@dataclass(frozen=True, slots=True, eq=False)
class FixedRate:
    """The rate that counts at precoders P(u) = D(u) Q, which turn with the line of sight.

    D has the steering phases of the transmitting array, none with a line of sight of ones; `Q`
    (..., n, N_t, N_t) is that which `unturned` gives.
    """

    link: Link
    Q: Complex

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (n,)."""
        H_r = self.link.fade(self.link.line_of_sight_at(cosine))
        H = np.exp(gain_log / 2)[..., None, None] * H_r
        return self.link.draw_rates(H, self.initial_precoders(gain_log, cosine))

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:  # noqa: ARG002
        """Return P (..., n, N_t, N_t) at u (..., n)."""
        return np.asarray(self.link.line_of_sight_at(cosine)[..., 0, :, None].conj() * self.Q)

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives by l and u, bits (n,).

        Those of the mutual information are differences. The cutoff rate has exact slopes, whose
        differences are the second derivatives.
        """
        follows = self.link.follows_position
        if self.link.measure != "cutoff":
            return by_differences(self.value, gain_log, cosine, both=follows)
        h = _STEP
        by_l, by_u = self._slopes(gain_log, cosine)
        (l_up, u_up), (l_down, u_down) = (self._slopes(gain_log + d, cosine) for d in (h, -h))
        value, by_ll = self.value(gain_log, cosine), (l_up - l_down) / (2 * h)
        if not follows:
            return RatePartials(value, by_l, by_ll)
        right, left = (self._slopes(gain_log, cosine + d)[1] for d in (h, -h))
        by_lu, by_uu = (u_up - u_down) / (2 * h), (right - left) / (2 * h)
        return RatePartials(value, by_l, by_ll, by_u, by_lu, by_uu)

    def _slopes(self, gain_log: Real, cosine: Real) -> tuple[Real, Real]:
        """Return the derivatives of the cutoff rate by l and u, bits (n,).

        With D_k = φ_k z the exponents, linear in the coordinates z of Z = P^H H^H H P / (4 σ²), and
        weights over all classes but zero that have the mean m and the part p of all classes' sum,
        they are p m z_a / ln 2; z and its derivative by l are one. H^LoS = D_r 1 1^T D^H with
        steering phases D_r, so that the rate at P = D Q is that at Q of D_r^H H_r D, of which only
        the scattered part depends on u.
        """
        link = self.link
        los = link.line_of_sight_at(cosine)
        scale = np.sqrt(np.exp(gain_log) / (4 * link.noise))[..., None, None]
        H = np.conj(los) * link.fade(los)
        sign = 1 if link.to_relay else -1
        phase = 1j * np.pi * sign * (np.arange(link.receive)[:, None] - np.arange(link.transmit))
        A, A_u = (scale * (M @ self.Q) for M in (H, phase * (H - link.los_share)))
        z = coordinates(A.conj().mT @ A)
        crossed = A.conj().mT @ A_u
        z_u = coordinates(crossed + crossed.conj().mT)
        s, mean = class_sum(link.classes).moments(z.reshape(-1, z.shape[-1]))
        part = np.exp(-np.logaddexp(0.0, -s)).reshape(z.shape[:-1]) / _LN2
        mean = mean.reshape(z.shape)
        return part * np.sum(mean * z, axis=-1), part * np.sum(mean * z_u, axis=-1)


def unturned(link: Link, cosine: Real, P: Complex) -> Complex:
    """Return Q = D(u)^H P of precoders P (..., n, N_t, N_t) at u (..., n)."""
    return np.asarray(link.line_of_sight_at(cosine)[..., 0, :, None] * P)


def by_differences(
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
