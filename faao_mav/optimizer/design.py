"""The design of a plan: how precoders follow a channel, and which rate the route is optimised for.

The paper compares four: precoders that are optimal for the alphabet or of a classical scheme
(`optimizer.precoder`), with the rate of the alphabet or of Gaussian inputs (`optimizer.inputs`).
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.optimizer.problem import Link, OwnPrecoder
from faao_mav.plan import Plan
from faao_mav.radio.precoder import SCHEMES


@dataclass(frozen=True, slots=True)
class Design:
    """How precoders follow a channel, and which rate counts.

    Attributes:
        scheme: `optimizer.precoder`, faao or a name of `radio.precoder.SCHEMES`.
        gaussian: the rate that counts is that of Gaussian inputs.
        averaged: the fading is averaged over; H has a leading axis of draws.
        blind: one precoder serves all draws (statistical CSI); otherwise each draw has its own.
        own: a precoder of one's own, in place of that scheme.

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
        of the mean channel.
        """
        power, noise = link.power, link.noise
        if self.optimal:
            draws = np.moveaxis(H, 0, -3) if self.blind else H[..., None, :, :]
            return link.best(draws, start)
        H = H.mean(axis=0) if self.blind else H
        scheme = "waterfilling" if self.scheme == "faao" else self.scheme
        return (self.own or SCHEMES[scheme])(H, power, noise)

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


def gaussian_rate(H: RealOrComplex, P: RealOrComplex, noise: float) -> Real:
    """Return the rate of Gaussian inputs, log2 det(I + H P P^H H^H / sigma²), bits (...).

    `H` is (..., N_r, N_t), `P` (..., N_t, N_t) in sqrt(W), `noise` sigma² in W.

    >>> float(gaussian_rate(np.eye(1), np.eye(1), 1.0))
    1.0
    """
    A = H @ P / np.sqrt(noise)
    gram = np.eye(A.shape[-1]) + A.conj().mT @ A
    return np.asarray(np.linalg.slogdet(gram)[1] / np.log(2.0))
