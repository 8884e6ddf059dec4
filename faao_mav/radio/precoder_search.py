"""The search for a precoder: where it starts, and at which power it is done.

P = V Q with V the directions that the channel, or the draws of one, respond to: what of P lies
outside them is power wasted. The problem is not concave. Newton's method runs from a few starts
that between them cover what an optimum may look like (streams on separate modes, streams spread
over the modes, all streams superposed on the strongest mode), and the best is kept.
"""

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.radio.constellation import DifferenceClasses
from faao_mav.radio.precoder_newton import minimise
from faao_mav.radio.precoder_objective import ClassSum, value

# Below a gain G of this size the rate is proportional to the power and the best P stays the same.
_FAINT = 1e-4

# Where ln δ is below -_SATURATED no rate can tell; the search, whose steps get smaller as the SNR
# grows, is done at a lower power and followed upwards by factors, as far as -_DEEPEST: there P is
# within a fraction of a per cent (in power) of maximising the least distance, its limit.
_SATURATED, _DEEPEST, _FACTOR = 40.0, 1000.0, 4.0

# r of the superposition [1, r, r², ...]: moduli, in bands, and angles in degrees.
_RATIOS = np.array([[1.0, 0.85], [0.7, 0.6], [0.5, 0.4], [0.25, 0.125]])
_ANGLES = np.array([0.0, 11.25, 22.5, 45.0, 67.5, 90.0])

# Generic starts: more for draws of a channel, whose optima have less structure, and for a few
# channels, which have hardly any neighbours to learn from.
_GENERIC, _GENERIC_MORE, _FEW = 4, 8, 12

# Which others a slot looks at, in the order of gains, and what it lets them fall short by in ln δ.
_NEIGHBOURS = (-9, -5, -3, -2, -1, 1, 2, 3, 5, 9)
_MARGIN = 0.03

# The tolerance, in relative power, for telling starts apart and for where no rate can tell.
_COARSE = 1e-4


def _starts(gains: Real, antennas: int, generic: int) -> Complex:
    """Points to start from in the basis of the modes, (starts, b, q, N).

    Args:
        gains: (b, q) singular values, largest first.
        antennas: N.
        generic: how many points of no structure to add, always the same.
    """
    b, q = gains.shape
    stream = np.arange(antennas)
    separate = np.eye(q, antennas, dtype=np.complex128)
    spread = np.exp(2j * np.pi * np.outer(np.arange(q), stream) / antennas)
    turned = spread * np.exp(0.25j * np.pi * stream)
    floor = np.maximum(gains, 0.03 * gains[:, :1])
    equalised = (gains[:, :1] / np.where(floor > 0.0, floor, 1.0))[:, :, None]
    structured = (separate, spread, turned, equalised * separate, equalised * turned)
    starts = np.stack([_unit(np.broadcast_to(M, (b, q, antennas))) for M in structured])
    # Symmetric points are stationary without being optima: none is hit exactly.
    parts = np.random.default_rng(7).standard_normal((2, 1 + generic, 1, q, antennas))
    points = _unit(parts[0] + 1j * parts[1])
    others = np.broadcast_to(points[1:], (generic, b, q, antennas))
    return np.concatenate([starts + 0.05 * points[0], others])


def _superposed(rows: int, antennas: int) -> Complex:
    """All streams on the strongest mode, [1, r, r², ...]: (bands of |r|, points, q, N).

    QPSK with |r| = 1/2 makes 16-QAM of two streams, BPSK with r = j makes QPSK.
    """
    r = _RATIOS[:, :, None] * np.exp(1j * np.deg2rad(_ANGLES))
    Q = np.zeros((len(r), r[0].size, rows, antennas), dtype=np.complex128)
    Q[:, :, 0] = r.reshape(len(r), -1)[..., None] ** np.arange(antennas)
    # Not exactly: where no other mode takes part at all, none would ever be tried.
    Q[:, :, 1:] = 0.03
    return _unit(Q)


def _unit(Q: Complex) -> Complex:
    """Scale each matrix to ||Q||_F = 1; zero matrices become a scaled identity."""
    norm = np.linalg.norm(Q, axis=(-2, -1), keepdims=True)
    filled = np.where(norm > 0.0, Q, np.eye(*Q.shape[-2:]))
    return np.asarray(filled / np.linalg.norm(filled, axis=(-2, -1), keepdims=True))


def _scaled(G: Complex, factor: Real) -> Complex:
    return np.asarray(G * factor[:, None, None, None])


def _raise(G: Complex) -> Real:
    """The factor by which the power of a hopeless link may be raised without moving its optimum."""
    largest = np.max(np.trace(G, axis1=-2, axis2=-1).real, axis=1)
    return np.maximum(1.0, _FAINT / np.where(largest > 0.0, largest, 1.0))


def _best_superposed(sums: ClassSum, G: Complex) -> Complex:
    """The best point of each band of ``_superposed`` for each channel, (bands, b, q, N)."""
    Q = _superposed(G.shape[-1], sums.antennas)
    bands, points = Q.shape[:2]
    flat = Q.reshape(-1, *Q.shape[2:])
    F = np.stack([value(sums, G, np.broadcast_to(M, (len(G), *M.shape))) for M in flat])
    best = np.argmin(F.reshape(bands, points, len(G)), axis=1)
    return np.asarray(Q[np.arange(bands)[:, None], best])


def _from_starts(
    sums: ClassSum, G: Complex, starts: Complex, tolerance: float
) -> tuple[Complex, int]:
    """The best point reached from the starts, (K, b, q, N), and the evaluations it took."""
    K, b = starts.shape[:2]
    each = np.tile(np.arange(b), K)
    F = value(sums, G[each], _unit(starts.reshape(K * b, *starts.shape[2:])))
    depth = -np.min(F.reshape(K, b), axis=0)
    factor = _raise(G) * np.minimum(1.0, _SATURATED / np.maximum(depth, _SATURATED))
    starts = np.concatenate([starts, _best_superposed(sums, _scaled(G, factor))])
    K = len(starts)
    owner = np.tile(np.arange(b), K)
    flat = starts.reshape(K * b, *starts.shape[2:])
    Q, F, evaluations = minimise(sums, _scaled(G, factor)[owner], flat, _COARSE)
    winner = np.argmin(F.reshape(K, b), axis=0)
    Q = Q.reshape(starts.shape)[winner, np.arange(b)]
    Q, F, more = minimise(sums, _scaled(G, factor), Q, tolerance)
    evaluations += more

    target = np.minimum(1.0, factor * _DEEPEST / np.maximum(-F, 1.0))
    while np.any(rising := factor < target):
        factor[rising] = np.minimum(target, _FACTOR * factor)[rising]
        Q[rising], _, more = minimise(
            sums, _scaled(G[rising], factor[rising]), Q[rising], max(tolerance, _COARSE)
        )
        evaluations += more
    return Q, evaluations


def _improved(
    sums: ClassSum, G: Complex, Q: Complex, tolerance: float
) -> tuple[Complex, Real, int]:
    """Q carried on to an optimum nearby and its F, never above that of Q; the evaluations."""
    before = value(sums, G, Q)
    factor = _raise(G) * np.minimum(1.0, _DEEPEST / np.maximum(-before, _DEEPEST))
    fine = np.where(before < -_SATURATED, max(tolerance, _COARSE), tolerance)
    better, F, evaluations = minimise(sums, _scaled(G, factor), Q, fine)
    other = factor != 1.0
    F[other] = value(sums, G[other], better[other])
    kept = before < F
    better[kept], F[kept] = Q[kept], before[kept]
    return better, F, evaluations


def _exchanged(
    sums: ClassSum, G: Complex, gain: Real, Q: Complex, tolerance: float
) -> tuple[Complex, int]:
    """Let each channel try what was found for those of the most similar gain, (b,).

    In the basis of the modes equal singular values have equal optima, so that every neighbour adds
    a start; what one missed its neighbour may have found.
    """
    b, evaluations, everyone = len(Q), 0, np.arange(len(Q))
    order = np.argsort(gain, kind="stable")
    place = np.argsort(order, kind="stable")
    near = np.stack([order[np.clip(place + k, 0, b - 1)] for k in _NEIGHBOURS])
    for _ in range(2):
        F = value(sums, G, Q)
        offered = np.stack([value(sums, G, Q[other]) for other in near])
        best = np.argmin(offered, axis=0)
        # Not yet made for this slot, a better kind of optimum may look a little worse.
        tried = offered[best, everyone] < F + _MARGIN * np.maximum(1.0, -F)
        moved = Q[near[best, everyone][tried]]
        moved, reached, more = _improved(sums, G[tried], moved, tolerance)
        evaluations += more
        better = reached < F[tried]
        Q[np.flatnonzero(tried)[better]] = moved[better]
    return Q, evaluations


def search(
    A: Complex,
    classes: DifferenceClasses,
    tolerance: float,
    start: Complex | None,
    known: Complex | None = None,
) -> tuple[Complex, int]:
    """Maximise the mean rate over draws by Newton's method.

    Args:
        A: (b, S, N_r, N_t), H √W / (2 σ).
        classes: the differences of the alphabet.
        tolerance: relative power.
        start: (b, N_t, N_t), the only start if given.
        known: (k, b, N_t, N_t), none of which shall be better than the result.

    Returns:
        P, (b, N_t, N_t), of any power, and how often F was evaluated, summed over the channels.
    """
    b, S, receive, N = A.shape
    _, s, Vh = np.linalg.svd(A.reshape(b, S * receive, N), full_matrices=False)
    V = np.conj(np.swapaxes(Vh, -1, -2))
    modes = A @ V[:, None]
    G = np.conj(np.swapaxes(modes, -1, -2)) @ modes
    sums = ClassSum(classes)
    if start is not None:
        Q, _, evaluations = _improved(sums, G, _unit(Vh @ start), tolerance)
        return np.where(s[:, :1, None] > 0.0, V @ Q, start), evaluations
    starts = _starts(s, N, _GENERIC_MORE if S > 1 or b < _FEW else _GENERIC)
    Q, evaluations = _from_starts(sums, G, starts, tolerance)
    if S == 1 and b > 1:
        Q, more = _exchanged(sums, G, s[:, 0], Q, tolerance)
        evaluations += more
    F = value(sums, G, Q)
    for P in () if known is None else known:
        # What of P lies outside the modes is power wasted; it must not be counted as used.
        other = _unit(Vh @ P)
        better = value(sums, G, other) < F - 1e-12 * np.abs(F)
        if np.any(better):
            Q[better], F[better], more = _improved(sums, G[better], other[better], tolerance)
            evaluations += more
    return np.where(s[:, :1, None] > 0.0, V @ Q, np.eye(N)), evaluations
