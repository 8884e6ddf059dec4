"""What is designed for: how precoders follow a channel, and which rate counts.

The paper's question in four lines: precoders made for the alphabet or by a classical scheme, and
inputs taken for what they are or for Gaussian.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.problem import Link
from faao_mav.plan import Plan
from faao_mav.radio.best_precoder import best_mean_precoders, best_precoders
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.rate import cutoff_rate

Draws: TypeAlias = Complex
"""Channels of (1) or (2), (..., N_r, N_t); with unknown fading the first axis runs over draws."""


@dataclass(frozen=True, slots=True)
class Design:
    """The scheme of `optimizer.precoder` and the inputs of `optimizer.inputs`.

    `averaged`: H has a leading axis of draws. `blind`: one precoder then serves all draws
    (statistical CSI); otherwise each draw has its own.
    """

    scheme: str
    gaussian: bool
    averaged: bool
    blind: bool

    @property
    def optimal(self) -> bool:
        """Whether precoders maximise the cutoff rate that is counted."""
        return self.scheme == "faao" and not self.gaussian

    def precoders(self, link: Link, H: Draws, start: Complex | None = None) -> Complex:
        """Return precoders (..., N_t, N_t) for the channels `H`.

        The optimal ones search from `start` where given. A scheme without knowledge of the draw
        is made for the mean channel.
        """
        power, noise = link.power, link.noise
        if self.optimal:
            if self.blind:
                found = best_mean_precoders(
                    np.moveaxis(H, 0, -3), power, link.modulation, noise, start=start
                )
            else:
                found = best_precoders(H, power, link.modulation, noise, start=start)
            return found.P
        known = H.mean(axis=0) if self.blind else H
        scheme = "waterfilling" if self.scheme == "faao" else self.scheme
        return SCHEMES[scheme](known, power, noise)

    def rate(self, link: Link, H: Draws, P: Complex) -> Real:
        """Return the rate that the route is optimised for, bits (n,): the mean over draws."""
        if self.gaussian:
            rate = gaussian_rate(H, P, link.noise)
        else:
            rate = cutoff_rate(H, P, link.classes, link.noise)
        return np.asarray(rate.mean(axis=0)) if self.averaged else rate


def design(plan: Plan) -> Design:
    """Return what `plan` asks for."""
    averaged = plan.radio.fading == "ergodic"
    return Design(
        scheme=plan.optimizer.precoder,
        gaussian=plan.optimizer.inputs == "gaussian",
        averaged=averaged,
        blind=averaged and plan.radio.csi == "statistical",
    )


def gaussian_rate(H: Complex, P: Complex, noise: float) -> Real:
    """Return log2 det(I + H P P^H H^H / sigma²) (...), what Gaussian inputs would carry, bits."""
    A = H @ P / np.sqrt(noise)
    gram = np.eye(A.shape[-1]) + np.conj(np.swapaxes(A, -1, -2)) @ A
    return np.asarray(np.linalg.slogdet(gram)[1] / np.log(2.0))
