"""Rates of links whose fading is known slot by slot."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import DirectionPartials, RatePartials
from faao_mav.radio.class_sum import class_sum
from faao_mav.radio.quadratic_form import coordinates
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

        With D_k = φ_k z the exponents, linear in the coordinates z of Z = P^H H^H H P / (4 σ²), and
        weights over all classes but zero that have the mean m, the covariance C and the share p of
        all classes' sum, R_0 has the slopes p m z_a / ln 2 and the second derivatives
        p (m z_ab - z_a C z_b - (1 - p) (m z_a) (m z_b)) / ln 2; z and its derivative by l are one.
        """
        link = self.link
        P, H_r, H_u, H_uu = self._by_cosine(cosine)
        scale = np.sqrt(np.exp(gain_log) / (4 * link.noise))[..., None, None]
        A = scale * (H_r @ P)
        z = coordinates(A.conj().mT @ A)
        width = z.shape[-1]
        s, mean, covariance = class_sum(link.classes).moments(z.reshape(-1, width))
        mean, covariance = mean.reshape(z.shape), covariance.reshape(*z.shape, width)
        share = np.exp(s - np.logaddexp(0.0, s)).reshape(z.shape[:-1])
        value = cutoff_rate(
            np.exp(gain_log / 2)[..., None, None] * H_r, P, link.classes, link.noise
        )

        def along(dz: Real) -> Real:
            return np.asarray(np.sum(mean * dz, axis=-1))

        def second(a: Real, b: Real, ab: Real) -> Real:
            spread = np.sum(a * (covariance @ b[..., None])[..., 0], axis=-1)
            bent = along(ab) - spread - (1 - share) * along(a) * along(b)
            return np.asarray(share * bent / _LN2)

        by_l, by_ll = share * along(z) / _LN2, second(z, z, z)
        if H_u is None or H_uu is None:
            return RatePartials(value, by_l, by_ll)
        A_u, A_uu = scale * (H_u @ P), scale * (H_uu @ P)
        z_u = 2 * coordinates(_hermitian(A.conj().mT @ A_u))
        z_uu = 2 * coordinates(_hermitian(A.conj().mT @ A_uu) + A_u.conj().mT @ A_u)
        direction = DirectionPartials(
            share * along(z_u) / _LN2, second(z, z_u, z_u), second(z_u, z_u, z_uu)
        )
        return RatePartials(value, by_l, by_ll, direction)

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


def _hermitian(X: Complex) -> Complex:
    """Return the Hermitian part of X (..., N, N)."""
    return np.asarray((X + X.conj().mT) / 2)
