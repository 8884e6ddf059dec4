"""The mutual information (5), (6) at fixed noises: a smooth function of channel and precoder.

An optimiser compares rates that differ by less than a sampled average errs. Here every channel
meets the same vectors sent and the same noises, a low-discrepancy set (Sobol) over inputs, noise
and the draws of a channel together: neighbouring values err alike, and the same arguments give the
same bytes. Only the Gram matrix of H P matters; its square root stands for the channel, so that a
rotation of what is received changes nothing.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from faao_mav.arrays import Complex, Integers, Real, RealOrComplex
from faao_mav.radio.likelihood import log_ratio
from faao_mav.radio.real_channel import RealInputs, real_inputs

_LN2 = float(np.log(2.0))

_NODES = 2048
"""Pairs of a vector sent and a noise, each used with both signs, for all draws of a channel.

The means over the 32 draws of the copter's sample err by up to 0.006 bit with QPSK and with 16-QAM,
a quarter as many by up to three times as much.
"""

_HELD = 1 << 20
"""Pairs of channel and noise held at once: 8 MB for each number that is kept of them. Chosen."""

_RAREST = 1e-9
"""Probability of the noises beyond the largest that is drawn, 6 standard deviations. Chosen."""


@dataclass(frozen=True, eq=False)
class NoiseSet:
    """What is sent, and the noise that it meets, for each of S draws of a channel.

    `sent` (S, q) counts the rows of `inputs.points`; the noises `z` (S, q, D) are N(0, I).
    """

    inputs: RealInputs
    sent: Integers
    z: Real


@dataclass(frozen=True, eq=False)
class Information:
    """The mutual information of every draw, and how far the best estimate of what is sent errs.

    Attributes:
        value: (b, S) bits; accurate is the mean over the S draws.
        errors: (b, S, N_t, N_t), E[(x - x^)(x - x^)^H] with x^ the mean of x given y.
    """

    value: Real
    errors: Complex


@lru_cache(maxsize=8)
def noise_set(modulation: str, antennas: int, draws: int) -> NoiseSet:
    """Return the fixed set for an alphabet on so many antennas, and so many draws.

    >>> noise_set("bpsk", 1, 4).z.shape
    (4, 1024, 1)
    """
    from scipy.special import ndtri
    from scipy.stats import qmc  # takes a second, which few plans need

    inputs = real_inputs(modulation, antennas)
    dimensions = inputs.points.shape[1]
    each = 2 ** max(0, round(float(np.log2(_NODES / draws))))
    power = int(np.ceil(np.log2(each * draws)))  # a whole set is better balanced than a part
    sobol = qmc.Sobol(1 + dimensions, rng=0).random_base2(power)[: each * draws]
    sobol = sobol.reshape(draws, each, -1)
    sent = inputs.sent[(sobol[..., 0] * len(inputs.sent)).astype(np.intp)]
    z = ndtri(np.clip(sobol[..., 1:], _RAREST, 1 - _RAREST))
    return NoiseSet(inputs, np.hstack([sent, sent]), np.hstack([z, -z]))


def fixed_noise_information(
    H: RealOrComplex, P: RealOrComplex, modulation: str, noise: float
) -> Real:
    """Return (5) or (6) of every draw of a channel, (..., S) bits: their mean is accurate.

    Args:
        H: (..., S, N_r, N_t), S draws of each channel.
        P: (..., S or 1, N_t, N_t), a precoder for each draw or one for all.
        modulation: the alphabet, one of ``MODULATIONS``.
        noise: σ², W.

    Raises:
        InputError: unknown modulation, or more than 65,536 input vectors.

    >>> one = np.ones((1, 1, 1))
    >>> fixed_noise_information(one, one, "bpsk", 1.0).round(3)  # exactly 0.721452
    array([0.721])
    """
    A = np.asarray(H, dtype=np.complex128) @ P
    flat = A.reshape(-1, *A.shape[-3:])
    return _averages(flat, modulation, noise, None).reshape(A.shape[:-2])


def information_and_errors(H: Complex, P: Complex, modulation: str, noise: float) -> Information:
    """Return the information and the errors at H (b, S, N_r, N_t) and P (b, S or 1, N_t, N_t)."""
    A = H @ P
    errors = np.empty((*A.shape[:2], A.shape[-1], A.shape[-1]), dtype=np.complex128)
    return Information(_averages(A, modulation, noise, errors), errors)


def _averages(A: Complex, modulation: str, noise: float, errors: Complex | None) -> Real:
    """Return the information (b, S) at A = H P (b, S, N_r, N_t), and fill `errors` if asked for."""
    b, S, _, N = A.shape
    used, real = noise_set(modulation, N, S), modulation == "bpsk"
    points, q = used.inputs.points, used.z.shape[1]
    maps = _maps(A, noise, real=real)
    value, step = np.empty((b, S)), max(1, _HELD // q)
    for s, start in product(range(S), range(0, b, step)):
        part = slice(start, start + step)
        chosen = maps[part, s]
        sent = np.broadcast_to(used.sent[s], (len(chosen), q))
        z = np.broadcast_to(used.z[s], (len(chosen), *used.z[s].shape))
        estimates = None if errors is None else np.empty(z.shape)
        value[part, s] = log_ratio(points, chosen, sent, z, estimates).mean(axis=1)
        if errors is not None and estimates is not None:
            missed = points[used.sent[s]] - estimates
            x = missed if real else missed[..., :N] + 1j * missed[..., N:]
            errors[part, s] = x.mT @ x.conj() / q
    return np.asarray(used.inputs.bits - value / _LN2)


def _maps(A: Complex, noise: float, *, real: bool) -> Real:
    """Return the maps (..., D, D) from inputs to received points, for noise N(0, I).

    They are the square roots of 2 A^H A / σ², in real coordinates.
    """
    gram = A.conj().mT @ A * (2 / noise)
    energy, V = np.linalg.eigh(gram.real if real else gram)
    root = (V * np.sqrt(np.maximum(energy, 0.0))[..., None, :]) @ V.conj().mT
    if real:
        return np.asarray(root)
    upper, lower = (root.real, -root.imag), (root.imag, root.real)
    rows = [np.concatenate(parts, axis=-1) for parts in (upper, lower)]
    return np.concatenate(rows, axis=-2).mT
