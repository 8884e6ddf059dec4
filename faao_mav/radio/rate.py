"""The rate that counts: the cutoff rate (7), (8) in closed form, or the mutual information.

The cutoff rate is what is known of every code, a lower bound on the mutual information (5), (6);
that is what the best codes come near to.
"""

import math
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.arrays import Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio.class_sum import class_sum
from faao_mav.radio.constellation import DifferenceClasses, difference_classes
from faao_mav.radio.mutual_information import mutual_information
from faao_mav.radio.quadratic_form import coordinates, features

Measure: TypeAlias = Literal["cutoff", "mutual_information"]
"""The name of the rate that counts."""

_PAIRS = 1 << 17
"""Channels with their precoders taken together, which bounds the memory. Chosen."""


def draw_rates(
    measure: Measure, H: RealOrComplex, P: RealOrComplex, modulation: str, noise: float
) -> Real:
    """Return the rate of every draw of a channel, (..., S) bit/s/Hz.

    Of the mutual information the mean over the S draws is accurate. Arguments and errors are those
    of ``mutual_information``.

    >>> one = np.ones((1, 1, 1))
    >>> for measure in ("cutoff", "mutual_information"):
    ...     print(draw_rates(measure, one, one, "bpsk", 1.0).round(3))
    [0.548]
    [0.721]
    """
    if measure == "mutual_information":
        return mutual_information(H, P, modulation, noise)
    return cutoff_rate(H, P, difference_classes(modulation, np.shape(P)[-1]), noise)


def _coordinates(H: RealOrComplex, P: RealOrComplex, noise: float) -> Real:
    """Return z of Z = P^H H^H H P / (4 σ²), (..., N_t²)."""
    if not noise > 0.0:
        raise InputError(f"the noise power must be above 0, got {noise}")
    A = np.asarray(H) @ np.asarray(P) / (2.0 * np.sqrt(noise))
    return coordinates(np.asarray(A.conj().mT @ A, dtype=np.complex128))


def exponents(H: RealOrComplex, P: RealOrComplex, u: RealOrComplex, noise: float) -> Real:
    """Return the exponents D = ||H P u||² / (4 σ²) of (7) and (8), (..., k), never negative.

    `H` (..., N_r, N_t) are channels and `P` (..., N_t, N_t) precoders, whose leading axes
    broadcast; `u` (k, N_t) are differences of input vectors, ``DifferenceClasses.vectors``; `noise`
    is σ², W. Raises `InputError` for a noise not above 0.

    >>> exponents(np.eye(1), np.eye(1), np.array([[2.0 + 0j]]), 0.5)
    array([2.])
    """
    D: Real = _coordinates(H, P, noise) @ features(np.asarray(u, dtype=np.complex128)).T
    return np.maximum(D, 0.0, out=D)


def cutoff_rate(
    H: RealOrComplex, P: RealOrComplex, classes: DifferenceClasses, noise: float
) -> Real:
    """Return the cutoff rate of a link, (7) or (8), in bit/s/Hz, (...) from 0 to ``classes.bits``.

    R_0 = 2 N log2(rho) - log2 Σ_m Σ_k exp(-||H P u_mk||² / (4 σ²)), the double sum taken over the
    classes: N log2(rho) - log2(1 + Σ multiplicity e^-D / rho^N).

    `H` (..., N_r, N_t) are channels and `P` (..., N_t, N_t) precoders, whose leading axes
    broadcast; `classes` are the differences of the alphabet on N_t antennas; `noise` is σ², W.
    Raises `InputError` for a noise not above 0.

    >>> from faao_mav.radio.constellation import difference_classes
    >>> float(cutoff_rate(np.eye(1), np.eye(1), difference_classes("bpsk", 1), 1.0).round(6))
    0.548059
    """
    shape = np.broadcast_shapes(np.shape(H)[:-2], np.shape(P)[:-2])
    channels, precoders = (
        np.broadcast_to(np.asarray(M, dtype=np.complex128), (*(shape or (1,)), *np.shape(M)[-2:]))
        for M in (H, P)
    )
    s = np.empty(math.prod(shape))
    for first in range(0, len(s), _PAIRS):
        part = np.arange(first, min(first + _PAIRS, len(s)))
        at = np.unravel_index(part, shape or (1,))
        s[part] = class_sum(classes).value(_coordinates(channels[at], precoders[at], noise))
    rate: Real = classes.bits - np.logaddexp(0.0, s) / np.log(2.0)
    return np.maximum(rate, 0.0).reshape(shape)
