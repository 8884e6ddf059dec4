"""Precoders that maximise the mean rate over the draws of a channel, subject to tr(P^H P) <= W.

The power limit is always active, and P_B(n) and P_U(n) of (14) separate: every slot of every link
is a problem of its own. With H = U S V^H and P = V Q the rate of one draw depends on S Q alone, so
that the best rate is a function of the singular values S. One P for many draws (statistical CSI)
has no such reduction.

For the cutoff rate, (7) or (8), the objective is F = ln mean_s δ_s with δ_s = N ln(rho) - R_0(H_s,
P) [nats] and s the draws. Unlike R_0, F has a non-zero gradient at any SNR. For the mutual
information, (5) or (6), it is F = -mean_s I(H_s, P), whose gradient -2 H^H H P E / (σ² ln 2) has
the error E of the best estimate of what is sent. Source: Palomar and Verdu, "Gradient of mutual
information in linear vector Gaussian channels", IEEE Trans. Inf. Theory 52 (2006).
"""

import numpy as np

from faao_mav.arrays import Complex, Integers, Real, RealOrComplex
from faao_mav.radio.constellation import coordinates, difference_classes, outer
from faao_mav.radio.mutual_information import NODES, mutual_information
from faao_mav.radio.precoder import bpsk_two_antennas, check_positive, with_power
from faao_mav.radio.precoder_search import (
    Objective,
    best_of,
    exchanged,
    minimise,
    neighbours,
    starting_points,
    unit,
)
from faao_mav.radio.rate import ClassSum, Measure, class_sum

_CHUNK = 4_000_000
"""Numbers in memory at once while channels are searched together: 32 MB. Chosen."""

_FAINT = 1e-4
"""Trace of the gain matrix G below which the rate is proportional to the power: the best P is then
the same at any lower power, and is searched at this one. Chosen."""

_SATURATED = 40.0
"""The smallest exponent beyond which no rate can tell precoders apart: of stronger links the search
is done at the power where it is this, since F bends more the higher the SNR. Chosen."""

_RANDOM_STARTS = 12
"""Random starts for each channel. Chosen."""

_DRAWS, _KEPT = 16, 4
"""About how many draws of a channel all starts are improved for first, and how many results, those
of the highest mean rate over all draws, are then improved for all of them. Measured on the sample,
beside 8 and 3: with 12 random starts single rates of 16-QAM rise by up to 1e-2 bit."""

_FEW_NODES = 512
"""Noises with which all starts are improved first for the mutual information, of which then so
many results are improved with all noises. Chosen."""

_COARSE, _FINE = 1e-4, 1e-7
"""Tolerances, as a relative power: that which tells starts apart, and the last. Chosen."""


def has_closed_form(modulation: str, antennas: int) -> bool:
    """Return whether the precoder of highest cutoff rate for one channel has a closed form.

    >>> has_closed_form("bpsk", 2), has_closed_form("qpsk", 2), has_closed_form("64qam", 1)
    (True, False, True)
    """
    return antennas == 1 or (antennas == 2 and modulation == "bpsk")


def best_precoders(
    H: RealOrComplex,
    power: float,
    modulation: str,
    noise: float,
    *,
    measure: Measure = "cutoff",
    start: RealOrComplex | None = None,
) -> Complex:
    """Return one precoder (..., N_t, N_t) per group of draws, max over P of mean_s R(H_s, P).

    BPSK on two antennas with one draw, and any alphabet on one antenna, have a closed form, which
    is kept for the mutual information too: no search has found a better one, at ratios of the modes
    from 0.2 to 0.95 and rates from 0.07 to 2 bit. Otherwise the best local optimum found is
    returned.

    Args:
        H: (..., S, N_r, N_t), S draws of each channel.
        power: W, W.
        modulation: the alphabet, one of ``MODULATIONS``.
        noise: σ², W.
        measure: the rate R, bit/s/Hz.
        start: (..., N_t, N_t), precoders of similar channels, of any power. The search then starts
            there only, which is far quicker, and its result is not worse than the start.

    Raises:
        InputError: W or σ² is not above 0, or the modulation is unknown.

    >>> H = np.array([[2.0, 1.0], [1.0, 1.0]]) * np.sqrt(0.5)
    >>> P = best_precoders(H[None], 2.0, "qpsk", 1.0)
    >>> P.shape, float(np.sum(np.abs(P) ** 2).round(9))
    ((2, 2), 2.0)
    """
    check_positive("transmit power", power)
    check_positive("noise power", noise)
    H = np.asarray(H, dtype=np.complex128)
    shape, (S, receive, N) = H.shape[:-3], H.shape[-3:]
    flat = H.reshape(-1, S, receive, N)
    if N == 1:
        P = np.ones((len(flat), 1, 1), dtype=np.complex128)
    elif S == 1 and has_closed_form(modulation, N) and (start is None or measure == "cutoff"):
        P = bpsk_two_antennas(flat[:, 0], power)
    else:
        P = np.empty((len(flat), N, N), dtype=np.complex128)
        given = None if start is None else np.reshape(start, (-1, N, N)).astype(np.complex128)
        numbers = (1 if start is None else 20) * (12 * N**4 + 8 * S * N**2)
        step = max(1, _CHUNK // numbers)
        for first in range(0, len(flat), step):
            part = slice(first, first + step)
            begin = None if given is None else given[part]
            P[part] = _searched(flat[part] * np.sqrt(power / noise), modulation, measure, begin)
    return with_power(P, power).reshape(*shape, N, N)


def _searched(A: Complex, modulation: str, measure: Measure, start: Complex | None) -> Complex:
    """Return P (b, N_t, N_t), of any power, for channels A (b, S, N_r, N_t) = H √W / σ."""
    b, S, receive, N = A.shape
    _, gains, Vh = np.linalg.svd(A.reshape(b, S * receive, N), full_matrices=False)
    V = Vh.conj().mT
    modes = A @ V[:, None]
    Q = None if start is None else unit(Vh @ start)
    if measure == "cutoff":
        Q = _best_cutoff(modes, gains, modulation, N, Q)[0]
    else:
        objective = _information_objective(modes, modulation, NODES)
        if Q is None:
            # The optimum changes its kind at another SNR than that of the cutoff rate: those of
            # stronger and weaker channels are starts too.
            found = _best_cutoff(modes, gains, modulation, N, None)
            starts = np.concatenate([found, found[0, neighbours(gains[:, 0])]])
            few = _information_objective(modes, modulation, _FEW_NODES)
            starts = best_of(few, objective, starts, _KEPT, _COARSE)
            Q = best_of(objective, objective, starts, 1, _COARSE)[0]
        Q, _ = minimise(objective, Q, _FINE)
    return np.where(gains[:, :1, None] > 0.0, V @ Q, np.eye(N) if start is None else start)


def _best_cutoff(
    modes: Complex, gains: Real, modulation: str, antennas: int, start: Complex | None
) -> Complex:
    """Return the optima found for the modes (b, S, N_r, q) of gains (b, q), the best first.

    They are (k, b, q, N), and one from the `start` (b, q, N) where given.
    """
    b, S = modes.shape[:2]
    sums = class_sum(difference_classes(modulation, antennas))
    G = modes.conj().mT @ modes / 4
    if start is not None:
        Q, _ = minimise(_cutoff_objective(sums, _levelled(sums, G, start[None])), start, _FINE)
        return Q[None]
    starts = starting_points(gains, antennas, _RANDOM_STARTS)
    G = _levelled(sums, G, starts)
    draws = slice(None, None, max(1, S // _DRAWS))
    objective, few = _cutoff_objective(sums, G), _cutoff_objective(sums, G[:, draws])
    starts = best_of(few, objective, starts, _KEPT, _COARSE)
    starts = best_of(objective, objective, starts, _KEPT, _COARSE)
    starts[0], _ = minimise(objective, starts[0], _FINE)
    if S == 1 and b > 1:
        starts[0] = exchanged(objective, gains[:, 0], starts[0], _FINE)
    return starts


def _levelled(sums: ClassSum, G: Complex, starts: Complex) -> Complex:
    """Return G (b, S, q, q) at the powers at which precoders are searched from `starts`."""
    largest = np.max(np.trace(G, axis1=-2, axis2=-1).real, axis=1)
    z = coordinates(starts.conj().mT[:, :, None] @ G @ starts[:, :, None])
    exponent = sums.least(z.reshape(-1, z.shape[-1])).reshape(z.shape[:-1])
    depth = np.max(np.min(exponent, axis=2), axis=0)  # of the weakest draw, at the best start
    factor = np.maximum(1.0, _FAINT / np.where(largest > 0.0, largest, 1.0))
    factor *= _SATURATED / np.maximum(depth, _SATURATED)
    return np.asarray(G * factor[:, None, None, None])


def _cutoff_objective(sums: ClassSum, G: Complex) -> Objective:
    """Return F = ln mean_s δ_s of G (b, S, q, q) = H^H H / (4 σ²) of each draw."""

    def objective(at: Integers, Q: Complex) -> tuple[Real, Complex]:
        k, S, q, N = len(at), *G.shape[1:3], Q.shape[2]
        GQ = (G[at].reshape(k, S * q, q) @ Q).reshape(k, S, q, N).transpose(0, 2, 1, 3)
        Z = (Q.conj().mT @ GQ.reshape(k, q, S * N)).reshape(k, N, S, N).swapaxes(1, 2)
        s, mean = sums.moments(coordinates(Z).reshape(k * S, N**2))
        # δ = ln(1 + e^s) has the slope 1 / (1 + e^-s).
        log_deficit = np.log(np.logaddexp(0.0, s)).reshape(k, S)
        top = log_deficit.max(axis=1, keepdims=True)
        total = np.sum(np.exp(log_deficit - top), axis=1, keepdims=True)
        weight = np.exp(-np.logaddexp(0.0, -s).reshape(k, S) - top) / total
        M = outer(weight[..., None] * mean.reshape(k, S, N**2)).reshape(k, S * N, N)
        return (top + np.log(total / S))[:, 0], -2 * (GQ.reshape(k, q, S * N) @ M)

    return objective


def _information_objective(modes: Complex, modulation: str, nodes: int) -> Objective:
    """Return F = -mean_s I, bits, of the modes (b, S, N_r, q) of channels for noise 1."""
    gram = modes.conj().mT @ modes * (-2 / np.log(2.0))

    def objective(at: Integers, Q: Complex) -> tuple[Real, Complex]:
        errors = np.zeros((*modes[at].shape[:2], *Q.shape[2:] * 2), dtype=np.complex128)
        value = mutual_information(
            modes[at], Q[:, None], modulation, 1.0, nodes=nodes, errors=errors
        )
        return -value.mean(axis=1), np.mean(gram[at] @ Q[:, None] @ errors, axis=1)

    return objective
