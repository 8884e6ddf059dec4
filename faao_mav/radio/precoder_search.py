"""The search for precoders of highest rate, over many channels at once.

P = V Q with V the directions that the channel, or its draws, respond to: whatever P sends outside
them is lost power. The objective F falls as the rate rises and has ||Q||_F = 1; it is not convex.
The BFGS method runs from several starts, channels of similar gain exchange their results, and the
best is kept.

The constants below were chosen; unless one says so, what a change costs is not measured.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Complex, Integers, Real

Objective: TypeAlias = Callable[[Integers, Complex], tuple[Real, Complex]]
"""F (k,) and its gradient ∂F/∂Re Q + j ∂F/∂Im Q (k, q, N), of the channels with the given indices
(k,) at the points Q (k, q, N), ||Q||_F = 1."""

_NEIGHBOURS = (-9, -5, -3, -2, -1, 1, 2, 3, 5, 9)
_MARGIN = 0.03
"""The channels, counted in the order of gains, whose optima a channel tries as well, and the part
of F by which such an optimum may be worse before it is improved."""

_STEPS = 120  # steps at most
_FIRST, _LONGEST = 0.2, 0.7  # the first and the longest step, radians on the sphere ||Q||_F = 1
_SURE = 1e-4  # part of the predicted fall of F with which a step is taken
_LEAST_REACH = 1e-6  # part of a step below which a refusal is due to rounding


def starting_points(gains: Real, antennas: int, random: int) -> Complex:
    """Return points to start from in the basis of the modes, (starts, b, q, N).

    `gains` (b, q) are singular values, largest first: streams on separate modes, streams spread
    over the modes, and `random` points, the same for every call.
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
    parts = np.random.default_rng(7).standard_normal((2, 1 + random, 1, q, antennas))
    points = unit(parts[0] + 1j * parts[1])
    others = np.broadcast_to(points[1:], (random, b, q, antennas))
    return unit(np.concatenate([starts + 0.05 * points[0], others]))


def unit(Q: Complex) -> Complex:
    """Return each matrix scaled to ||Q||_F = 1; zero matrices become a scaled identity."""
    norm = np.linalg.norm(Q, axis=(-2, -1), keepdims=True)
    filled = np.where(norm > 0.0, Q, np.eye(*Q.shape[-2:]))
    return np.asarray(filled / np.linalg.norm(filled, axis=(-2, -1), keepdims=True))


def exchanged(objective: Objective, gain: Real, Q: Complex, tolerance: float) -> Complex:
    """Return Q (b, q, N) after each channel has tried the optima of those of similar gain (b,).

    In the basis of the modes, channels of equal singular values have equal optima, so that the
    optimum of every neighbour is a further start.
    """
    near, everyone = neighbours(gain), np.arange(len(Q))
    for _ in range(2):
        F, _ = objective(everyone, Q)
        offered = np.stack([objective(everyone, Q[other])[0] for other in near])
        best = np.argmin(offered, axis=0)
        # An optimum of a better kind may be a little worse here until it is improved for this one.
        tried = np.flatnonzero(offered[best, everyone] < F + _MARGIN * np.maximum(1.0, -F))
        if not tried.size:
            break
        moved, reached = minimise(_of(objective, tried), Q[near[best, everyone][tried]], tolerance)
        better = reached < F[tried]
        Q[tried[better]] = moved[better]
    return Q


def neighbours(gain: Real) -> Integers:
    """Return the channels (k, b) next to each of b in the order of their gains (b,)."""
    order = np.argsort(gain, kind="stable")
    rank = np.argsort(order, kind="stable")
    return np.stack([order[np.clip(rank + k, 0, len(gain) - 1)] for k in _NEIGHBOURS])


def _of(objective: Objective, channels: Integers) -> Objective:
    """Return the `objective` of the given `channels`, counted anew."""
    return lambda at, Q: objective(channels[at], Q)


def best_of(
    objective: Objective, score: Objective, starts: Complex, kept: int, tolerance: float
) -> Complex:
    """Return the results (kept, b, q, N) of least `score` that `starts` (k, b, q, N) lead to."""
    channel = np.tile(np.arange(starts.shape[1]), len(starts))
    found, _ = minimise(_of(objective, channel), starts.reshape(-1, *starts.shape[2:]), tolerance)
    F, _ = score(channel, found)
    best = np.argsort(F.reshape(len(starts), -1), axis=0)[:kept]
    return found.reshape(starts.shape)[best, np.arange(starts.shape[1])]


def minimise(objective: Objective, Q: Complex, tolerance: float) -> tuple[Complex, Real]:
    """Return Q (b, q, N) and F (b,) where BFGS steps over ||Q||_F = 1 lead; F never rises.

    A point is done once the fall of F that the next step predicts is below that of raising the
    transmit power by the part `tolerance`: a measure that means the same at any SNR.

    >>> G = np.diag([1.0, 4.0])
    >>> def objective(at, Q):  # -||diag(1, 2) Q||²
    ...     return -np.sum((Q.conj() * (G @ Q)).real, axis=(1, 2)), -2 * G @ Q
    >>> Q, F = minimise(objective, np.ones((1, 2, 1)) + 0j, 1e-9)
    >>> np.abs(Q[0]).round(3).ravel().tolist(), F.round(6).tolist()
    ([0.0, 1.0], [-4.0])
    """
    Q = unit(Q)
    going = np.arange(len(Q))
    F, slope = objective(going, Q)
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
        trial = unit(_matrices(x[going] + reach[going, None] * step, Q.shape[1:]))
        reached, slope = objective(going, trial)
        new = _along(trial, slope)
        _update(inverse, going, new[0] - x[going], new[1] - gradient[going], scale=number == 0)
        better = reached < F[going] - _SURE * reach[going] * predicted
        reach[going] = np.where(better, np.minimum(1.0, 4 * reach[going]), 0.25 * reach[going])
        at = going[better]
        x[at], gradient[at], radial[at], F[at] = (part[better] for part in (*new, reached))
    return _matrices(x, Q.shape[1:]), F


def _along(Q: Complex, slope: Complex) -> tuple[Real, Real, Real]:
    """Return [Re Q, Im Q] (b, m), the gradient along the sphere (b, m), and that outwards (b,)."""
    x, gradient = (np.concatenate([M.real, M.imag], axis=1).reshape(len(M), -1) for M in (Q, slope))
    radial = np.sum(x * gradient, axis=1)
    return x, gradient - radial[:, None] * x, radial


def _matrices(x: Real, shape: tuple[int, ...]) -> Complex:
    half = x.shape[1] // 2
    return (x[:, :half] + 1j * x[:, half:]).reshape(-1, *shape)


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
