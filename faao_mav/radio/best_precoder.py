"""Precoders that maximise the mean rate over the draws of a channel, subject to tr(P^H P) <= W.

The power limit is always active, and P_B(n) and P_U(n) of (14) separate: every slot of every link
is a problem of its own. With H = U S V^H and P = V Q the rate of one draw depends on S Q alone, so
that the best rate is a function of the singular values S. One P for many draws (statistical CSI)
has no such reduction; what P sends outside the directions V that they respond to is lost power.

For the cutoff rate, (7) or (8), the objective is F = ln mean_s δ_s with δ_s = N ln(rho) - R_0(H_s,
P) [nats] and s the draws. Unlike R_0, F has a non-zero gradient at any SNR. For the mutual
information, (5) or (6), it is F = -mean_s I(H_s, P), whose gradient -2 H^H H P E / (σ² ln 2) has
the error E of the best estimate of what is sent. Source: Palomar and Verdu, "Gradient of mutual
information in linear vector Gaussian channels", IEEE Trans. Inf. Theory 52 (2006).

Neither is convex in Q. BFGS steps over ||Q||_F = 1 lead from several starts to optima of which the
best are kept: first for the cutoff rate; then for the mutual information, and where draws are
known, from these results and those of channels of similar gain.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import CACHE, Complex, Integers, Real, RealOrComplex
from faao_mav.radio.constellation import coordinates, difference_classes, outer
from faao_mav.radio.mutual_information import NODES, mutual_information
from faao_mav.radio.precoder import bpsk_two_antennas, check_positive, with_power
from faao_mav.radio.rate import ClassSum, Measure, class_sum

_FAINT, _STRONG = 1e-4, 1e9
"""Traces of the gain matrix G between which precoders are searched, the largest for differences of
length 1. Below, the rate is proportional to the power, and the best P is the same at any lower one.
Beyond, rounding would show in the exponents. Chosen: at 1e6 two draws that are 60 dB apart lose
0.7 bit, for the weaker one counts too."""

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

_NEIGHBOURS = (-9, -5, -3, -2, -1, 1, 2, 3, 5, 9)
"""The channels, counted in the order of gains, whose optima a channel tries as well. Chosen."""

_STEPS = 120  # steps at most
_FIRST, _LONGEST = 0.2, 0.7  # the first and the longest step, radians on the sphere ||Q||_F = 1
_SURE = 1e-4  # part of the predicted fall of F with which a step is taken
_LEAST_REACH = 1e-6  # part of a step below which a refusal is due to rounding

Objective: TypeAlias = Callable[[Integers, Complex], tuple[Real, Complex]]
"""F (k,) and its gradient ∂F/∂Re Q + j ∂F/∂Im Q (k, q, N), of the channels with the given indices
(k,) at the points Q (k, q, N), ||Q||_F = 1."""


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
        step = max(1, 32 * CACHE // numbers)
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
    classes = difference_classes(modulation, N)
    starts = starting_points(gains, N) if start is None else unit(Vh @ start)[None]
    G = modes.conj().mT @ modes / 4
    size = np.max(np.trace(G, axis1=-2, axis2=-1).real, axis=1)[:, None, None, None]
    strong = _STRONG / np.sum(np.abs(classes.vectors[0]) ** 2)
    G *= np.clip(size, _FAINT, strong) / np.where(size > 0.0, size, 1.0)
    sums = class_sum(classes)
    cutoff = last = _cutoff_objective(sums, G)
    rounds = [(cutoff, cutoff)] if S == 1 < b else []
    if measure == "mutual_information":
        last = _information_objective(modes, modulation, NODES)
        rounds.append((_information_objective(modes, modulation, _FEW_NODES), last))
    if start is None:
        starts = _kept(_cutoff_objective(sums, G[:, :: max(1, S // _DRAWS)]), cutoff, starts)
        # In the basis of the modes channels of equal singular values have equal optima, and those
        # of the mutual information change their kind at other SNRs than those of the cutoff rate.
        order = np.argsort(gains[:, 0], kind="stable")
        rank = np.argsort(order, kind="stable")
        near = [order[np.clip(rank + k, 0, b - 1)] for k in _NEIGHBOURS]
        for few, objective in rounds:
            starts = _kept(few, objective, np.concatenate([starts, starts[0, near]]))
    Q, _ = minimise(last, starts[0], _FINE)
    return np.where(gains[:, :1, None] > 0.0, V @ Q, np.eye(N) if start is None else start)


def _kept(few: Objective, objective: Objective, starts: Complex) -> Complex:
    """Return the best that `starts` (k, b, q, N) lead to, first by an objective of few terms."""
    for now in (few, objective):
        found, _ = minimise(now, starts, _COARSE)
        k, b = found.shape[:2]
        F, _ = objective(np.tile(np.arange(b), k), found.reshape(k * b, *found.shape[2:]))
        best = np.argsort(F.reshape(k, b), axis=0)[:_KEPT]
        starts = found[best, np.arange(b)]
    return starts


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


def starting_points(gains: Real, antennas: int) -> Complex:
    """Return points to start from in the basis of the modes, (starts, b, q, N).

    `gains` (b, q) are singular values, largest first: streams on separate modes, streams spread
    over the modes, and random points, the same for every call.
    """
    b, q = gains.shape
    stream = np.arange(antennas)
    separate = np.eye(q, antennas, dtype=np.complex128)
    spread = np.exp(2j * np.pi * np.outer(np.arange(q), stream) / antennas + 0.25j * np.pi * stream)
    floor = np.maximum(gains, 0.03 * gains[:, :1])
    equalised = (gains[:, :1] / np.where(floor > 0.0, floor, 1.0))[:, :, None]
    structured = (separate, spread, equalised * spread)
    starts = np.stack([unit(np.broadcast_to(M, (b, q, antennas))) for M in structured])
    # Symmetric points are stationary without being optima: none is hit exactly.
    parts = np.random.default_rng(7).standard_normal((2, 1 + _RANDOM_STARTS, 1, q, antennas))
    points = unit(parts[0] + 1j * parts[1])
    others = np.broadcast_to(points[1:], (_RANDOM_STARTS, b, q, antennas))
    return unit(np.concatenate([starts + 0.05 * points[0], others]))


def unit(Q: Complex) -> Complex:
    """Return each matrix scaled to ||Q||_F = 1; zero matrices become a scaled identity."""
    norm = np.linalg.norm(Q, axis=(-2, -1), keepdims=True)
    filled = np.where(norm > 0.0, Q, np.eye(*Q.shape[-2:]))
    return np.asarray(filled / np.linalg.norm(filled, axis=(-2, -1), keepdims=True))


def minimise(objective: Objective, Q: Complex, tolerance: float) -> tuple[Complex, Real]:
    """Return Q (..., b, q, N) and F (..., b) where BFGS steps lead on ||Q||_F = 1; F never rises.

    A point is done once the fall of F that the next step predicts is below that of raising the
    transmit power by the part `tolerance`: a measure that means the same at any SNR.

    >>> G = np.diag([1.0, 4.0])
    >>> def objective(at, Q):  # -||diag(1, 2) Q||²
    ...     return -np.sum((Q.conj() * (G @ Q)).real, axis=(1, 2)), -2 * G @ Q
    >>> Q, F = minimise(objective, np.ones((1, 2, 1)) + 0j, 1e-9)
    >>> np.abs(Q[0]).round(3).ravel().tolist(), F.round(6).tolist()
    ([0.0, 1.0], [-4.0])
    """
    *most, b, q, N = Q.shape
    Q = unit(Q).reshape(-1, q, N)
    going = np.arange(len(Q))
    F, slope = objective(going % b, Q)
    x, gradient, radial = _along(Q, slope)
    length = np.linalg.norm(gradient, axis=1)
    first = _FIRST / np.where(length > 0, length, 1.0)
    inverse = np.eye(x.shape[1]) * first[:, None, None]
    reach = np.ones(len(Q))
    for number in range(_STEPS):
        step = -(inverse[going] @ gradient[going, :, None])[:, :, 0]
        predicted = -0.5 * np.sum(step * gradient[going], axis=1)
        gains = predicted > -0.5 * tolerance * radial[going]
        gains &= reach[going] > _LEAST_REACH
        going, step, predicted = going[gains], step[gains], predicted[gains]
        if not len(going):
            break
        step *= np.minimum(1.0, _LONGEST / np.linalg.norm(step, axis=1))[:, None]
        moved = x[going] + reach[going, None] * step
        trial = unit(moved.view(np.complex128).reshape(-1, q, N))
        reached, slope = objective(going % b, trial)
        new = _along(trial, slope)
        _update(inverse, going, new[0] - x[going], new[1] - gradient[going], scale=number == 0)
        better = reached < F[going] - _SURE * reach[going] * predicted
        reach[going] = np.where(better, np.minimum(1.0, 4 * reach[going]), 0.25 * reach[going])
        at = going[better]
        x[at], gradient[at], radial[at], F[at] = (part[better] for part in (*new, reached))
    return x.view(np.complex128).reshape(*most, b, q, N), F.reshape(*most, b)


def _along(Q: Complex, slope: Complex) -> tuple[Real, Real, Real]:
    """Return Q as real numbers (b, m), the gradient along the sphere (b, m), and outwards (b,)."""
    x, gradient = (np.ascontiguousarray(M).reshape(len(M), -1).view(float) for M in (Q, slope))
    radial = np.sum(x * gradient, axis=1)
    return x, gradient - radial[:, None] * x, radial


def _update(inverse: Real, at: Integers, s: Real, y: Real, *, scale: bool) -> None:
    """Correct the inverse Hessians of the points `at` by what steps s changed the gradients, y.

    Those of the first step are begun with the size that it shows (`scale`). Where the gradient
    falls along the step, nothing is learnt.
    """
    curvature, size = np.sum(s * y, axis=1), np.sum(y * y, axis=1)
    bent = curvature > 1e-10 * np.sqrt(np.sum(s * s, axis=1) * size)
    at, s, y, curvature, size = at[bent], s[bent], y[bent], curvature[bent], size[bent]
    if scale:
        inverse[at] = np.eye(s.shape[1]) * (curvature / size)[:, None, None]
    By = (inverse[at] @ y[:, :, None])[:, :, 0]
    both = (1 + np.sum(y * By, axis=1) / curvature)[:, None]
    turn = s[:, :, None] * (0.5 * both * s - By)[:, None, :] / curvature[:, None, None]
    inverse[at] += turn + turn.swapaxes(1, 2)
