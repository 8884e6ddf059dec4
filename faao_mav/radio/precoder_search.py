"""The search for the precoder of highest mean cutoff rate, over many channels at once.

P = V Q with V the directions that the channel, or its draws, respond to: whatever P sends outside
them is lost power. The problem is not concave in Q. Newton's method on the sphere ||Q||_F = 1 runs
from a few starts (streams on separate modes, streams spread over the modes, random ones), and the
best result is kept.

The constants below were chosen; unless one says so, what a change costs is not measured.
"""

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.radio.class_sum import ClassSum, class_sum
from faao_mav.radio.constellation import DifferenceClasses
from faao_mav.radio.precoder_objective import (
    Objective,
    evaluate,
    to_complex,
    to_real,
    value,
)

_FAINT = 1e-4
"""Trace of the gain matrix G below which the rate is proportional to the power: the best P is then
the same at any lower power, and is searched at this one."""

_SATURATED = 40.0
"""-ln δ beyond which no rate can tell precoders apart: of stronger links the search is done at the
power where it is this, since the region in which Newton's method converges shrinks with the SNR."""

_RANDOM_STARTS, _MORE_RANDOM_STARTS, _FEW_CHANNELS = 4, 8, 12
"""Random starts per channel; the larger number for draws of a channel, whose optima have less
structure, and for fewer than so many channels, which have few neighbours to take over from."""

_NEIGHBOURS = (-9, -5, -3, -2, -1, 1, 2, 3, 5, 9)
_MARGIN = 0.03
"""The channels, counted in the order of gains, whose optima a channel tries as well, and the share
of ln δ by which such an optimum may be worse before it is improved."""

_DRAWS, _KEPT = 8, 3
"""About how many draws of a channel all starts are improved for first, and how many results, those
of the highest mean rate over all draws, are then improved for all of them. Measured on the sample,
beside all draws at once: 16-QAM on three antennas in a quarter of the time; the delivered rate of
QPSK on four 1.5e-4 bit/s/Hz lower, of 8-PSK on three 5e-5 higher, on two the same to 1e-6."""

_COARSE = 1e-4  # tolerance, as a relative power, that tells starts apart, and in saturation
_STEPS = 60  # Newton steps at most
_MOST_DAMPED = 1e7  # damping, in the largest curvature, beyond which a refusal is due to rounding
_LONGEST = 0.7  # longest step, radians on the sphere ||Q||_F = 1


def _starts(gains: Real, antennas: int, random: int) -> Complex:
    """Return points to start from in the basis of the modes, (starts, b, q, N).

    `gains` (b, q) are singular values, largest first; `random` points, the same for every call, are
    added.
    """
    b, q = gains.shape
    stream = np.arange(antennas)
    separate = np.eye(q, antennas, dtype=np.complex128)
    spread = np.exp(2j * np.pi * np.outer(np.arange(q), stream) / antennas)
    rotated = spread * np.exp(0.25j * np.pi * stream)
    floor = np.maximum(gains, 0.03 * gains[:, :1])
    equalised = (gains[:, :1] / np.where(floor > 0.0, floor, 1.0))[:, :, None]
    structured = (separate, spread, rotated, equalised * separate, equalised * rotated)
    starts = np.stack([_unit(np.broadcast_to(M, (b, q, antennas))) for M in structured])
    # Symmetric points are stationary without being optima: none is hit exactly.
    parts = np.random.default_rng(7).standard_normal((2, 1 + random, 1, q, antennas))
    points = _unit(parts[0] + 1j * parts[1])
    others = np.broadcast_to(points[1:], (random, b, q, antennas))
    return np.concatenate([starts + 0.05 * points[0], others])


def _unit(Q: Complex) -> Complex:
    """Return each matrix scaled to ||Q||_F = 1; zero matrices become a scaled identity."""
    norm = np.linalg.norm(Q, axis=(-2, -1), keepdims=True)
    filled = np.where(norm > 0.0, Q, np.eye(*Q.shape[-2:]))
    return np.asarray(filled / np.linalg.norm(filled, axis=(-2, -1), keepdims=True))


def _scaled(G: Complex, factor: Real) -> Complex:
    return np.asarray(G * factor[:, None, None, None])


def _raised(G: Complex) -> Real:
    """Return the factor of the power, at least 1, up to which a faint link keeps its optimum."""
    largest = np.max(np.trace(G, axis1=-2, axis2=-1).real, axis=1)
    return np.maximum(1.0, _FAINT / np.where(largest > 0.0, largest, 1.0))


def _from_starts(sums: ClassSum, G: Complex, starts: Complex, tolerance: float) -> Complex:
    """Return the best point (b, q, N) that is reached from the starts (K, b, q, N)."""
    K, b = starts.shape[:2]
    draws = slice(None, None, max(1, G.shape[1] // _DRAWS))
    owner = np.tile(np.arange(b), K)
    F = value(sums, G[owner, draws], _unit(starts.reshape(K * b, *starts.shape[2:])))
    depth = -np.min(F.reshape(K, b), axis=0)
    scaled = _scaled(G, _raised(G) * _SATURATED / np.maximum(depth, _SATURATED))
    few = scaled[:, draws]
    Q, F = minimise(sums, few[owner], starts.reshape(K * b, *starts.shape[2:]), _COARSE)
    if few.shape != G.shape:
        F = value(sums, scaled[owner], Q)
        kept = np.argsort(F.reshape(K, b), axis=0)[:_KEPT]
        flat = Q.reshape(starts.shape)[kept, np.arange(b)].reshape(-1, *Q.shape[1:])
        K = len(kept)
        Q, F = minimise(sums, np.concatenate([scaled] * K), flat, _COARSE)
    winner = np.argmin(F.reshape(K, b), axis=0)
    Q = Q.reshape(K, b, *Q.shape[1:])[winner, np.arange(b)]
    return minimise(sums, scaled, Q, tolerance)[0]


def _improved(sums: ClassSum, G: Complex, Q: Complex, tolerance: float) -> tuple[Complex, Real]:
    """Return the local optimum that Newton's method reaches from Q, and its F; never worse."""
    before = value(sums, G, Q)
    factor = _raised(G) * _SATURATED / np.maximum(-before, _SATURATED)
    fine = np.where(before < -_SATURATED, max(tolerance, _COARSE), tolerance)
    better, F = minimise(sums, _scaled(G, factor), Q, fine)
    other = factor != 1.0
    F[other] = value(sums, G[other], better[other])
    kept = before < F
    better[kept], F[kept] = Q[kept], before[kept]
    return better, F


def _exchanged(sums: ClassSum, G: Complex, gain: Real, Q: Complex, tolerance: float) -> Complex:
    """Return Q (b, q, N) after each channel has tried the optima of those of similar gain (b,).

    In the basis of the modes, channels of equal singular values have equal optima, so that the
    optimum of every neighbour is a further start.
    """
    b, everyone = len(Q), np.arange(len(Q))
    order = np.argsort(gain, kind="stable")
    rank = np.argsort(order, kind="stable")
    near = np.stack([order[np.clip(rank + k, 0, b - 1)] for k in _NEIGHBOURS])
    for _ in range(2):
        F = value(sums, G, Q)
        offered = np.stack([value(sums, G, Q[other]) for other in near])
        best = np.argmin(offered, axis=0)
        # An optimum of a better kind may be a little worse here until it is improved for this slot.
        tried = offered[best, everyone] < F + _MARGIN * np.maximum(1.0, -F)
        moved = Q[near[best, everyone][tried]]
        moved, reached = _improved(sums, G[tried], moved, tolerance)
        better = reached < F[tried]
        Q[np.flatnonzero(tried)[better]] = moved[better]
    return Q


def search(
    A: Complex,
    classes: DifferenceClasses,
    tolerance: float,
    start: Complex | None,
) -> Complex:
    """Return P (b, N_t, N_t), of any power, that maximises the mean cutoff rate over the draws.

    `A` (b, S, N_r, N_t) is H √W / (2 σ), `classes` are the differences of the alphabet, `tolerance`
    is that of ``minimise``. `start` (b, N_t, N_t) is the only start if given.

    >>> from faao_mav.radio.constellation import difference_classes
    >>> H = np.diag([1.0, 2.0])[None, None] + 0j
    >>> P = search(H, difference_classes("bpsk", 2), 1e-9, None)
    >>> (np.linalg.norm(P, axis=2) / np.linalg.norm(P)).round(4)
    array([[0., 1.]])
    """
    b, S, receive, N = A.shape
    _, s, Vh = np.linalg.svd(A.reshape(b, S * receive, N), full_matrices=False)
    V = Vh.conj().mT
    modes = A @ V[:, None]
    G = modes.conj().mT @ modes
    sums = class_sum(classes)
    if start is not None:
        Q, _ = _improved(sums, G, _unit(Vh @ start), tolerance)
        return np.where(s[:, :1, None] > 0.0, V @ Q, start)
    starts = _starts(s, N, _MORE_RANDOM_STARTS if S > 1 or b < _FEW_CHANNELS else _RANDOM_STARTS)
    Q = _from_starts(sums, G, starts, tolerance)
    if S == 1 and b > 1:
        Q = _exchanged(sums, G, s[:, 0], Q, tolerance)
    return np.where(s[:, :1, None] > 0.0, V @ Q, np.eye(N))


def _step(x: Real, at: Objective, damping: Real) -> tuple[Real, Real, Real]:
    """Return the Newton step along the sphere, the predicted fall of F, and -dF / d ln(power)."""
    radial = np.sum(x * at.gradient, axis=1)
    gradient = at.gradient - radial[:, None] * x
    # Projected on the tangent plane; along x, where the gradient is zero, any curvature will do.
    across = (at.hessian @ x[:, :, None])[:, :, 0]
    along = np.sum(x * across, axis=1)
    hessian = at.hessian - across[:, :, None] * x[:, None, :] - x[:, :, None] * across[:, None, :]
    hessian += along[:, None, None] * (x[:, :, None] * x[:, None, :])
    diagonal = np.arange(x.shape[1])
    hessian[:, diagonal, diagonal] -= radial[:, None]
    curvature, directions = np.linalg.eigh(hessian)
    component = (gradient[:, None] @ directions)[:, 0]
    largest = np.max(np.abs(curvature), axis=1, keepdims=True)
    # |h| in place of h makes every step descend; free phases, of curvature 0, are left unchanged.
    divisor = np.abs(curvature) + (damping[:, None] + 1e-9) * largest
    move = -component / np.where(divisor > 0.0, divisor, 1.0)
    move /= np.maximum(1.0, np.linalg.norm(move, axis=1, keepdims=True) / _LONGEST)
    predicted = -np.sum(move * (component + 0.5 * curvature * move), axis=1)
    return (directions @ move[:, :, None])[:, :, 0], predicted, -0.5 * radial


def minimise(
    sums: ClassSum, G: Complex, Q: Complex, tolerance: float | Real
) -> tuple[Complex, Real]:
    """Return Q (b, q, N) and F (b,) where damped Newton steps over ||Q||_F = 1 lead; F never rises.

    A point is done once the fall of F that the next step predicts is below that of raising the
    transmit power by the share `tolerance`, (b,) or one for all: a measure that means the same at
    any SNR. `sums` are the classes of the alphabet, `G` (b, S, q, q), Hermitian, is H^H H / (4 σ²)
    of each draw, `Q` (b, q, N) the start.

    >>> from faao_mav.radio.constellation import difference_classes
    >>> G = np.diag([1.0, 4.0])[None, None] + 0j
    >>> Q, F = minimise(ClassSum(difference_classes("bpsk", 1)), G, np.ones((1, 2, 1)) + 0j, 1e-9)
    >>> np.abs(Q[0]).round(3).ravel().tolist()
    [0.0, 1.0]
    """
    x = to_real(Q)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    at = evaluate(sums, G, to_complex(x, sums.antennas))
    F, best = at.value.copy(), x.copy()
    index, damping = np.arange(len(x)), np.zeros(len(x))
    tolerance = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), len(x))
    for _ in range(_STEPS):
        step, predicted, slope = _step(x, at, damping)
        going = (predicted > tolerance[index] * slope) & (damping < _MOST_DAMPED)
        if not going.all():
            index, x, damping = index[going], x[going], damping[going]
            step, predicted, G = step[going], predicted[going], G[going]
            at = Objective(at.value[going], at.gradient[going], at.hessian[going])
        if not len(index):
            break
        trial = x + step
        trial /= np.linalg.norm(trial, axis=1, keepdims=True)
        new = evaluate(sums, G, to_complex(trial, sums.antennas))
        gained = at.value - new.value
        better = gained > 1e-3 * predicted
        x[better] = trial[better]
        for old, fresh in (
            (at.value, new.value),
            (at.gradient, new.gradient),
            (at.hessian, new.hessian),
        ):
            old[better] = fresh[better]
        F[index], best[index] = at.value, x
        damping = np.where(
            better,
            np.where(gained > 0.5 * predicted, 0.1 * damping, damping),
            np.maximum(4.0 * damping, 0.03),
        )
        damping[damping < 1e-3] = 0.0
    return to_complex(best, sums.antennas), F
