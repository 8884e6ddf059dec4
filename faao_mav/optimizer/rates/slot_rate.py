"""Rates of links whose fading is known slot by slot."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import DirectionPartials, RatePartials
from faao_mav.radio.rate import cutoff_rate

_LN2 = float(np.log(2.0))

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
        """Return the rate and its derivatives with precoders that rotate with the line of sight.

        Those of the mutual information are differences, with precoders that stay.
        """
        P = self.precoders(gain_log, cosine)
        if self.link.measure != "cutoff":
            held = DifferencedRate(self.link, partial(self.link.draw_rates, P=P))
            return held.partials(gain_log, cosine)
        return FixedRate(self.link, P, rotating=True).partials(gain_log, cosine)


@dataclass(frozen=True, slots=True, eq=False)
class FixedRate:
    """The cutoff rate (7), (8) at given precoders P (n, N_t, N_t).

    `rotating` precoders follow the direction of the line of sight, P(u) = D(u) Q with the steering
    phases D of the transmitting array; the derivatives are then those of R_0 at P(u).
    """

    link: Link
    P: Complex
    rotating: bool = False

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (n,)."""
        H = channel(self.link, gain_log, cosine)
        return cutoff_rate(H, self.P, self.link.classes, self.link.noise)

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its exact derivatives by l and u, bits (n,).

        With D_k = e^l q_k(u) and the weights p_k = mult_k e^-D_k / sum, the zero class included,
        R_0 = const - log2 sum_k mult_k e^-D_k has the slope sum p_k D_k' / ln 2 and the second
        derivative (sum p_k (D_k'' - D_k'²) + (sum p_k D_k')²) / ln 2.
        """
        link, classes = self.link, self.link.classes
        P, H_r, H_u, H_uu = self._by_cosine(cosine)
        Pu = np.sqrt(np.exp(gain_log) / (4 * link.noise))[..., None, None] * (P @ classes.vectors.T)
        z = H_r @ Pu
        D = _inner(z, z)
        least = np.minimum(0.0, np.log(classes.symbols / classes.multiplicity).min())
        e = classes.multiplicity * np.exp(-D + least)
        total = e.sum(axis=-1) + classes.symbols * np.exp(least)
        p = e / total[..., None]
        value = cutoff_rate(np.exp(gain_log / 2)[..., None, None] * H_r, P, classes, link.noise)

        def mean(terms: Real) -> Real:
            return np.asarray(np.sum(p * terms, axis=-1))

        m_l = mean(D)
        by_ll = mean(D - D**2) + m_l**2
        if H_u is None or H_uu is None:
            return RatePartials(value, m_l / _LN2, by_ll / _LN2)
        dz = H_u @ Pu
        D_u = 2 * _inner(z, dz)
        D_uu = 2 * (_inner(dz, dz) + _inner(z, H_uu @ Pu))
        m_u = mean(D_u)
        by_lu = mean(D_u - D * D_u) + m_l * m_u
        by_uu = mean(D_uu - D_u**2) + m_u**2
        direction = DirectionPartials(m_u / _LN2, by_lu / _LN2, by_uu / _LN2)
        return RatePartials(value, m_l / _LN2, by_ll / _LN2, direction)

    def _by_cosine(self, cosine: Real) -> tuple[Complex, Complex, Complex | None, Complex | None]:
        """Return P, H_r and the derivatives of H_r by u and uu, in the frame where P is fixed.

        H^LoS = D_r 1 1^T D_t^H with steering phases D: for rotating precoders P = D_t Q the rate is
        that of Q and D_r^H H_r D_t, of which only the scattered part depends on u.
        """
        link = self.link
        los = link.line_of_sight_at(cosine)
        if not link.follows_position:
            return self.P, link.fade(los), None, None
        sign = 1 if link.to_relay else -1
        phase = -1j * np.pi * sign * (np.arange(link.receive)[:, None] - np.arange(link.transmit))
        if not self.rotating:
            H_u = link.los_share * phase * los
            return self.P, link.fade(los), H_u, phase * H_u
        Q = los[..., 0, :, None] * self.P
        H_r = np.conj(los) * link.fade(los)
        H_u = -phase * (H_r - link.los_share)
        return Q, H_r, H_u, -phase * H_u


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
        h = _STEP

        def at(i: int, j: int) -> Real:
            return self.value(gain_log + i * h, cosine + j * h)

        middle, up, down = at(0, 0), at(1, 0), at(-1, 0)
        by_l, by_ll = (up - down) / (2 * h), (up - 2 * middle + down) / h**2
        if not self.link.follows_position:
            return RatePartials(middle, by_l, by_ll)
        right, left = at(0, 1), at(0, -1)
        by_lu = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * h**2)
        by_u, by_uu = (right - left) / (2 * h), (right - 2 * middle + left) / h**2
        return RatePartials(middle, by_l, by_ll, DirectionPartials(by_u, by_lu, by_uu))


def channel(link: Link, gain_log: Real, cosine: Real) -> Complex:
    """Return H = e^(l/2) H_r of (1) or (2), (..., n, N_r, N_t), at l and u (..., n)."""
    H_r = link.fade(link.line_of_sight_at(cosine))
    return np.asarray(np.exp(gain_log / 2)[..., None, None] * H_r)


def _inner(a: Complex, b: Complex) -> Real:
    """Return Re a^H b over the receiving antennas, (..., k) for a and b (..., N_r, k)."""
    return np.asarray(np.sum(a.real * b.real + a.imag * b.imag, axis=-2))
