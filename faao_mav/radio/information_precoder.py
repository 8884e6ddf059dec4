"""Precoders of highest mutual information, (5) or (6), subject to tr(P^H P) <= W.

The precoders of highest cutoff rate are polished: conjugate gradients on the sphere tr(P^H P) = W
by the gradient of the mutual information, 2 H^H H P E / (σ² ln 2) with E the error of the best
estimate of what is sent. Source: Palomar and Verdu, "Gradient of mutual information in linear
vector Gaussian channels", IEEE Trans. Inf. Theory 52 (2006).

The optimum changes its kind (all streams on one mode, or on several) at another SNR than that of
the cutoff rate, so that those of stronger and weaker channels are starts too. Where the cutoff
rate's optimum has a closed form it is kept: no search has found a better one, for BPSK on two
antennas at ratios of the modes from 0.2 to 0.95 and rates from 0.07 to 2 bit.
"""

import numpy as np

from faao_mav.arrays import Complex, Integers, Real, RealOrComplex
from faao_mav.radio.best_precoder import best_mean_precoders
from faao_mav.radio.mutual_information import information_and_errors
from faao_mav.radio.precoder import with_power

_STEPS = 15
"""Steps of the conjugate gradients, and as many again for the best of several starts.

On the copter's sample 15 steps find all but 0.005 bit of the up to 0.13 bit that 60 steps gain.
"""

_NEIGHBOURS = (0, -1, 1, -2, 2, -4, 4)
"""The channels, counted in the order of gains, from whose optima a search starts. Chosen."""

_FIRST_ANGLE, _LARGEST_ANGLE = 0.3, 0.7
"""The first and the largest step, radians on the sphere. Chosen."""

_SETTLED = 1e-6
"""Gain of a further step, bits to first order, below which a search ends. Chosen."""


def best_information_precoders(
    H_draws: RealOrComplex,
    power: float,
    modulation: str,
    noise: float,
    *,
    start: RealOrComplex | None = None,
) -> Complex:
    """Return one precoder (..., N_t, N_t) per group of draws: max over P of mean_s I(H_s, P).

    `H_draws` (..., S, N_r, N_t) are S draws of each channel. `start` (..., N_t, N_t), precoders of
    similar channels, is the only start where given, and the result is not worse. The other
    arguments and the errors are those of ``best_precoders``; more than 65,536 input vectors are an
    error too.

    >>> H = np.diag([2.0, 1.0])[None] * 0.5
    >>> P = best_information_precoders(H, 2.0, "qpsk", 1.0)
    >>> float(np.sum(np.abs(P) ** 2).round(6))
    2.0
    """
    H = np.asarray(H_draws, dtype=np.complex128)
    shape, (S, receive, N) = H.shape[:-3], H.shape[-3:]
    flat = H.reshape(-1, S, receive, N)
    if start is not None:
        P = np.asarray(start, dtype=np.complex128).reshape(-1, N, N)
        return _ascended(flat, P, power, modulation, noise)[0].reshape(*shape, N, N)
    best = best_mean_precoders(flat, power, modulation, noise)
    if best.exact:
        return best.P.reshape(*shape, N, N)
    b = len(flat)
    # in the basis of the modes channels of equal singular values have equal optima
    _, gains, Vh = np.linalg.svd(flat.reshape(b, S * receive, N), full_matrices=True)
    Q = Vh @ best.P
    order = np.argsort(gains[:, 0], kind="stable")
    rank = np.argsort(order, kind="stable")
    near = np.stack([order[np.clip(rank + k, 0, b - 1)] for k in _NEIGHBOURS])
    starts = Vh.conj().mT @ Q[near]  # (starts, b, N, N)
    P, value = _ascended(
        np.tile(flat, (len(near), 1, 1, 1)), starts.reshape(-1, N, N), power, modulation, noise
    )
    first = np.argmax(value.reshape(-1, b), axis=0)
    P = P.reshape(starts.shape)[first, np.arange(b)]
    return _ascended(flat, P, power, modulation, noise)[0].reshape(*shape, N, N)


def _ascended(
    H: Complex, start: Complex, power: float, modulation: str, noise: float
) -> tuple[Complex, Real]:
    """Return P (b, N, N) and its mean information (b,) after steps from `start`, never worse."""
    P = with_power(start, 1.0)
    gram = (H.conj().mT @ H) * (2 * power / noise / np.log(2.0))

    def at(index: Integers, P: Complex) -> tuple[Real, Complex]:
        """Return the mean information (k,), and its gradient along the sphere (k, N, N)."""
        found = information_and_errors(H[index], np.sqrt(power) * P[:, None], modulation, noise)
        gradient = np.mean(gram[index] @ P[:, None] @ found.errors, axis=1)
        return found.value.mean(axis=1), gradient - P * _inner(P, gradient)

    going = np.arange(len(P))
    value, gradient = at(going, P)
    ahead, angle = gradient.copy(), np.full((len(P), 1, 1), _FIRST_ANGLE)
    for _ in range(_STEPS):
        size = np.sqrt(_inner(ahead, ahead))
        slope = _inner(gradient, ahead) / np.where(size > 0, size, 1.0)
        going = np.flatnonzero((angle * slope)[:, 0, 0] > _SETTLED)
        if not len(going):
            break
        old, step = gradient[going], angle[going]
        way = ahead[going] / size[going]
        trial = P[going] * np.cos(step) + way * np.sin(step)
        reached, new = at(going, trial)
        better = (reached > value[going])[:, None, None]
        # the secant through both slopes tells how far the optimum along this way is
        fall = slope[going] - _inner(new, way)
        secant = step * slope[going] / np.where(fall > 0, fall, 1e-300)
        shorter, longer = np.where(better, 0.2, 0.1) * step, np.where(better, 3.0, 0.5) * step
        angle[going] = np.minimum(np.clip(secant, shorter, longer), _LARGEST_ANGLE)
        # Polak and Ribiere, begun anew where that does not ascend
        share = np.maximum(0.0, _inner(new, new - old) / np.maximum(_inner(old, old), 1e-300))
        turned = new + share * (ahead[going] - trial * _inner(trial, ahead[going]))
        turned = np.where(_inner(turned, new) > 0, turned, new)
        P[going] = np.where(better, trial, P[going])
        gradient[going] = np.where(better, new, old)
        ahead[going] = np.where(better, turned, old)
        value[going] = np.where(better[:, 0, 0], reached, value[going])
    return with_power(P, power), value


def _inner(a: Complex, b: Complex) -> Real:
    """Return Re tr(a^H b), (b, 1, 1)."""
    return np.asarray(np.sum((a.conj() * b).real, axis=(-2, -1), keepdims=True))
