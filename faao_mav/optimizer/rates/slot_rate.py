"""Rates of links whose fading is known slot by slot."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates.place import Partials, Turning
from faao_mav.radio.best_precoder import best_precoders
from faao_mav.radio.rate import cutoff_rate

_LN2 = float(np.log(2.0))


class BestRate:
    """The cutoff rate (7), (8) at the best precoders.

    By the envelope theorem its slope is that at fixed best precoders. Its curvature is that of
    precoders which turn with the line of sight and are fixed otherwise: never above the true one,
    a cautious model. Precoders are carried from call to call: each search starts from the last.
    """

    exact = False
    """They are found by a search."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self._last: Complex | None = None

    def precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return the best precoders (..., n, N_t, N_t) at l and u (..., n)."""
        found = best_precoders(
            channel(self.link, gain_log, cosine),
            self.link.power,
            self.link.modulation,
            self.link.noise,
            start=self._near(gain_log.shape),
        )
        self._last = found.P
        return found.P

    def start(self, gain_log: Real, cosine: Real) -> Complex:
        """Return nearly the best precoders (..., n, N_t, N_t): those of the last call."""
        near = self._near(gain_log.shape)
        return self.precoders(gain_log, cosine) if near is None else near

    def _near(self, shape: tuple[int, ...]) -> Complex | None:
        """Return the last precoders for slots of this shape; of other flights the first's."""
        if self._last is None or self._last.shape[:-2] == shape:
            return self._last
        one = self._last.reshape(-1, *self._last.shape[-3:])[0]
        return np.broadcast_to(one, (*shape, *one.shape[1:]))

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate of every slot, bits (n,)."""
        P = self.precoders(gain_log, cosine)
        H = channel(self.link, gain_log, cosine)
        return cutoff_rate(H, P, self.link.classes, self.link.noise)

    def partials(self, gain_log: Real, cosine: Real) -> Partials:
        """Return the rate and its derivatives, the precoders held but for turning."""
        P = self.precoders(gain_log, cosine)
        return FixedRate(self.link, P, turning=True).partials(gain_log, cosine)


@dataclass(frozen=True, slots=True, eq=False)
class FixedRate:
    """The cutoff rate (7), (8) at given precoders P (n, N_t, N_t).

    `turning`: derivatives are those of precoders that follow the direction of the line of sight,
    P(u) = D(u) Q with the steering phases D of the transmitting array.
    """

    link: Link
    P: Complex
    turning: bool = False

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate of every slot, bits (n,)."""
        H = channel(self.link, gain_log, cosine)
        return cutoff_rate(H, self.P, self.link.classes, self.link.noise)

    def partials(self, gain_log: Real, cosine: Real) -> Partials:
        """Return the rate and its exact derivatives.

        With D_k = e^l q_k(u) and the weights p_k = mult_k e^-D_k / sum, the zero class included,
        R_0 = const - log2 sum_k mult_k e^-D_k has the slope sum p_k D_k' / ln 2 and the second
        derivative (sum p_k (D_k'' - D_k'²) + (sum p_k D_k')²) / ln 2.
        """
        link, classes = self.link, self.link.classes
        P, H_r, slope, bend = self._by_cosine(cosine)
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
        if slope is None or bend is None:
            return Partials(value, m_l / _LN2, by_ll / _LN2)
        dz = slope @ Pu
        D_u = 2 * _inner(z, dz)
        D_uu = 2 * (_inner(dz, dz) + _inner(z, bend @ Pu))
        m_u = mean(D_u)
        by_lu = mean(D_u - D * D_u) + m_l * m_u
        by_uu = mean(D_uu - D_u**2) + m_u**2
        turning = Turning(m_u / _LN2, by_lu / _LN2, by_uu / _LN2)
        return Partials(value, m_l / _LN2, by_ll / _LN2, turning)

    def _by_cosine(self, cosine: Real) -> tuple[Complex, Complex, Complex | None, Complex | None]:
        """P, H_r and the first two derivatives of H_r by u, in the frame that P is fixed in.

        H^LoS = D_r 1 1^T D_t^H with steering phases D: for turning precoders P = D_t Q the rate is
        that of Q and D_r^H H_r D_t, in which only the scattered part turns.
        """
        link = self.link
        los = link.line_of_sight_at(cosine)
        if not link.follows_position:
            return self.P, link.fade(los), None, None
        sign = 1 if link.to_relay else -1
        phase = -1j * np.pi * sign * (np.arange(link.receive)[:, None] - np.arange(link.transmit))
        if not self.turning:
            turned = link.los_share * phase * los
            return self.P, link.fade(los), turned, phase * turned
        Q = los[..., 0, :, None] * self.P
        H_r = np.conj(los) * link.fade(los)
        turned = -phase * (H_r - link.los_share)
        return Q, H_r, turned, -phase * turned


@dataclass(frozen=True, slots=True, eq=False)
class DifferencedRate:
    """Any rate of the channel, `rate_of(H)` (n,) bits, with derivatives by central differences.

    For precoders that follow the channel by a rule of their own, where no envelope theorem helps.
    """

    link: Link
    rate_of: Callable[[Complex], Real]

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate of every slot, bits (n,)."""
        return self.rate_of(channel(self.link, gain_log, cosine))

    def partials(self, gain_log: Real, cosine: Real) -> Partials:
        """Return the rate and its derivatives by steps of 1e-3, about 1e-5 off."""
        h = 1e-3

        def at(i: int, j: int) -> Real:
            return self.value(gain_log + i * h, cosine + j * h)

        middle, up, down = at(0, 0), at(1, 0), at(-1, 0)
        by_l, by_ll = (up - down) / (2 * h), (up - 2 * middle + down) / h**2
        if not self.link.follows_position:
            return Partials(middle, by_l, by_ll)
        right, left = at(0, 1), at(0, -1)
        by_lu = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * h**2)
        by_u, by_uu = (right - left) / (2 * h), (right - 2 * middle + left) / h**2
        return Partials(middle, by_l, by_ll, Turning(by_u, by_lu, by_uu))


def channel(link: Link, gain_log: Real, cosine: Real) -> Complex:
    """Return H of (1) or (2) at l and u (n,)."""
    H_r = link.fade(link.line_of_sight_at(cosine))
    return np.asarray(np.exp(gain_log / 2)[..., None, None] * H_r)


def _inner(a: Complex, b: Complex) -> Real:
    """Re a^H b over the receiving antennas: (..., N_r, k) twice to (..., k)."""
    return np.asarray(np.sum(a.real * b.real + a.imag * b.imag, axis=-2))
