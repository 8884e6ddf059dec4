"""A link, and the design of a plan: how precoders follow a channel, and which rate counts.

The paper compares four: precoders that are optimal for the alphabet or of a classical scheme
(`optimizer.precoder`), with the rate of the alphabet or of Gaussian inputs (`optimizer.inputs`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.plan import Plan
from faao_mav.radio.best_precoder import best_precoders, has_closed_form
from faao_mav.radio.channel import line_of_sight_ula, rician
from faao_mav.radio.constellation import DifferenceClasses, difference_classes
from faao_mav.radio.gain import GainField
from faao_mav.radio.mutual_information import mutual_information
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.rate import Measure, cutoff_rate
from faao_mav.radio.rate_steps import StreamRate, one_stream

OwnPrecoder: TypeAlias = Callable[[RealOrComplex, float, float], Complex]
"""A precoder of one's own: from channels (..., N_r, N_t), the power W and the noise sigma², W, it
makes the P (..., N_t, N_t), tr(P P^H) = W, of each."""


@dataclass(frozen=True)
class Link:
    """One hop: (1) or (2) with its share of (13).

    `gains` is the path gain over the map, `power` W_B or W_U (W), `noise` sigma² (W); `receive` and
    `transmit` are the antenna counts. `nlos` is the Rayleigh part: a known draw per
    slot (N + 2, N_r, N_t), draws to be averaged over (S, 1, N_r, N_t), or None for the line of
    sight alone. `measure` is the rate that counts, `optimizer.rate`. With `steps` the rates are
    these, of one stream, whatever the alphabet.
    """

    gains: GainField
    to_relay: bool
    power: float
    noise: float
    receive: int
    transmit: int
    modulation: str
    rician_factor: float
    line_of_sight: str
    nlos: Complex | None
    measure: Measure = "cutoff"
    steps: StreamRate | None = None

    @cached_property
    def classes(self) -> DifferenceClasses:
        """The differences u_mk of this link's input vectors, merged up to a unit phase."""
        return difference_classes(self.modulation, self.transmit)

    @property
    def most(self) -> float:
        """The highest rate, bits: N log2(rho), or the highest step."""
        return float(self.classes.bits) if self.steps is None else self.steps.most

    @property
    def closed_form(self) -> bool:
        """Whether the precoder of highest rate for one channel has a closed form."""
        return self.steps is not None or has_closed_form(self.modulation, self.transmit)

    @property
    def follows_position(self) -> bool:
        """Whether H_r changes with w."""
        return self.line_of_sight == "ula"

    @property
    def averaged(self) -> bool:
        """Whether the fading is averaged over: channels then have a leading axis of draws."""
        return self.nlos is not None and self.nlos.ndim == 4

    def small_scale(self, w: Real) -> Complex:
        """Return H_r ((S,) N + 2, N_r, N_t), the bracket of (1) or (2), at w (N + 2, 2)."""
        away = self.gains.away(w.T)
        d = np.sqrt(self.gains.squared_distance(away))
        return self.fade(self.line_of_sight_at(away[0] / d))

    def line_of_sight_at(self, cosine: Real) -> Complex:
        """Return H^LoS (..., N_r, N_t) at direction cosines u = (x - x_j) / d (...)."""
        along = (1 if self.to_relay else -1) * self.follows_position  # of all ones u is 0
        return line_of_sight_ula(along * cosine, self.receive, self.transmit)

    def fade(self, los: Complex) -> Complex:
        """Return H_r for line-of-sight parts `los` (N + 2, N_r, N_t).

        Draws that are averaged over turn with the line of sight: that leaves their distribution,
        and makes their mean rate depend on the distance alone.
        """
        if self.nlos is None:
            return los
        if self.averaged:
            return los * rician(np.ones_like(self.nlos), self.nlos, self.rician_factor)
        return rician(los, self.nlos, self.rician_factor)

    def channel(self, w: Real, H_r: Complex | None = None) -> Complex:
        """Return H = sqrt(gain) H_r, (1) or (2), at w (N + 2, 2), with H_r given or there."""
        H_r = self.small_scale(w) if H_r is None else H_r
        return np.sqrt(self.gains.gain(w.T))[:, None, None] * H_r

    def mean_rates(self, H: Complex, P: Complex) -> Real:
        """Return the rates of `draw_rates`, bits (...), their mean where H has draws."""
        rates = self.draw_rates(H, P)
        return np.asarray(rates.mean(axis=0)) if self.averaged else rates

    def draw_rates(self, H: Complex, P: Complex) -> Real:
        """Return the rates of the channels H ((S,) ..., N_r, N_t), bits ((S,) ...).

        P is (..., N_t, N_t), or has the axis of the draws too. Of the mutual information the mean
        over the draws is accurate: see `radio.mutual_information`.
        """
        if self.steps is not None:
            return self.steps.value(self.snr(H, P))
        if self.measure == "cutoff":
            return cutoff_rate(H, P, self.modulation, self.noise)
        every = self.averaged and P.ndim == H.ndim
        H = np.moveaxis(H, 0, -3) if self.averaged else H[..., None, :, :]
        P = np.moveaxis(P, 0, -3) if every else P[..., None, :, :]
        rates = np.moveaxis(mutual_information(H, P, self.modulation, self.noise), -1, 0)
        return np.ascontiguousarray(rates) if self.averaged else rates[0]

    def snr(self, H: Complex, P: Complex) -> Real:
        """Return ||H P||² / sigma², the SNR of one stream, linear, for H and P of `draw_rates`."""
        A = H @ P
        return np.asarray(np.sum(A.real**2 + A.imag**2, axis=(-2, -1)) / self.noise)

    def best(self, draws: Complex, start: Complex | None = None) -> Complex:
        """Return the precoder (..., N_t, N_t) of highest mean rate over draws (..., S, N_r, N_t).

        Where it is searched, from `start` (..., N_t, N_t) if given.
        """
        if self.steps is not None:
            return one_stream(draws, self.power)
        return best_precoders(
            draws, self.power, self.modulation, self.noise, measure=self.measure, start=start
        )


@dataclass(frozen=True, slots=True)
class Design:
    """How precoders follow a channel, and which rate counts.

    `scheme` is `optimizer.precoder`, faao or a name of `radio.precoder.SCHEMES`, or in its place
    one's `own`. The rate that counts is that of Gaussian inputs if `gaussian`. With fading that is
    `averaged` over H has a leading axis of draws; one precoder serves them all if `blind`
    (statistical CSI), otherwise each has its own.

    >>> from faao_mav import read_plan
    >>> design(read_plan("missions/paper.yaml"))
    Design(scheme='faao', gaussian=False, averaged=False, blind=False, own=None)
    """

    scheme: str
    gaussian: bool
    averaged: bool
    blind: bool
    own: OwnPrecoder | None = None

    @property
    def optimal(self) -> bool:
        """Whether precoders maximise the rate that counts, `Link.measure`."""
        return self.scheme == "faao" and not self.gaussian and self.own is None

    def precoders(self, link: Link, H: Complex, start: Complex | None = None) -> Complex:
        """Return precoders (..., N_t, N_t) of power W for the channels `H` (..., N_r, N_t).

        The first axis is that of the draws if `averaged`. The search for optimal ones begins at
        `start` (..., N_t, N_t) where given. A classical scheme that does not know the draw is that
        of the mean channel. Raises `InputError` where one's own are none, or above the power.
        """
        power, noise = link.power, link.noise
        if self.optimal:
            draws = np.moveaxis(H, 0, -3) if self.blind else H[..., None, :, :]
            return link.best(draws, start)
        H = H.mean(axis=0) if self.blind else H
        scheme = "waterfilling" if self.scheme == "faao" else self.scheme
        if self.own is None:
            return SCHEMES[scheme](H, power, noise)
        P = np.asarray(self.own(H, power, noise))
        if P.shape != (*H.shape[:-2], H.shape[-1], H.shape[-1]) or not np.isfinite(P).all():
            told = f"of shape {P.shape} for channels {H.shape}"
            raise InputError(f"precoder: {told}; expected finite numbers (..., N_t, N_t)")
        check_power(P, power, "precoder")
        return P

    def rate(self, link: Link, H: Complex, P: Complex) -> Real:
        """Return the rate that the route is optimised for, bits (n,), its mean where `averaged`."""
        rate = gaussian_rate(H, P, link.noise) if self.gaussian else link.draw_rates(H, P)
        return np.asarray(rate.mean(axis=0)) if self.averaged else rate


def design(plan: Plan, own: OwnPrecoder | None = None) -> Design:
    """Return the design that `plan` asks for, with a precoder of one's `own` where given."""
    averaged = plan.radio.fading == "ergodic"
    return Design(
        scheme=plan.optimizer.precoder,
        gaussian=plan.optimizer.inputs == "gaussian",
        averaged=averaged,
        blind=averaged and plan.radio.csi == "statistical",
        own=own,
    )


def largest_power(P: Complex) -> float:
    """Return the largest power of the precoders P (..., N_t, N_t), W."""
    return float(np.sum(np.abs(P) ** 2, axis=(-2, -1)).max())


def check_power(P: Complex, power: float, source: str) -> None:
    """Raise `InputError`, which names `source`, for precoders (..., N_t, N_t) above `power`, W."""
    if (used := largest_power(P)) > power * (1 + 1e-6):
        raise InputError(f"{source}: has {used / power:.4g} times the power that it may have")


def gaussian_rate(H: RealOrComplex, P: RealOrComplex, noise: float) -> Real:
    """Return the rate of Gaussian inputs, log2 det(I + H P P^H H^H / sigma²), bits (...).

    `H` is (..., N_r, N_t), `P` (..., N_t, N_t) in sqrt(W), `noise` sigma² in W.

    >>> float(gaussian_rate(np.eye(1), np.eye(1), 1.0))
    1.0
    """
    A = H @ P / np.sqrt(noise)
    gram = np.eye(A.shape[-1]) + A.conj().mT @ A
    return np.asarray(np.linalg.slogdet(gram)[1] / np.log(2.0))
