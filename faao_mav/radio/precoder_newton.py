"""Newton's method for precoders of highest mean cutoff rate, over many channels at once."""

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.radio.precoder_objective import ClassSum, Objective, evaluate, to_complex, to_real

_STEPS = 60

# Rejections in a row come from rounding once the damping exceeds the curvature this many times.
_MOST_DAMPED = 1e7

# The longest step, in radians on the sphere ||Q||_F = 1.
_LONGEST = 0.7


def _step(x: Real, at: Objective, damping: Real) -> tuple[Real, Real, Real]:
    """Step along the sphere, the decrease of F it promises, and -dF / d ln(power)."""
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
    # Negative curvature is followed downhill (|h|), flat directions (free phases) are left alone.
    divisor = np.abs(curvature) + (damping[:, None] + 1e-9) * largest
    move = -component / np.where(divisor > 0.0, divisor, 1.0)
    move /= np.maximum(1.0, np.linalg.norm(move, axis=1, keepdims=True) / _LONGEST)
    promised = -np.sum(move * (component + 0.5 * curvature * move), axis=1)
    return (directions @ move[:, :, None])[:, :, 0], promised, -0.5 * radial


def minimise(
    sums: ClassSum, G: Complex, Q: Complex, tolerance: float | Real
) -> tuple[Complex, Real, int]:
    """Minimise F over ||Q||_F = 1 from the given points, each by itself.

    A point is left alone once the next step promises less than ``tolerance`` does as a relative
    increase of the transmit power: a measure that means the same at any SNR.

    Args:
        sums: the classes of the alphabet.
        G: (b, S, q, q), the power absorbed.
        Q: (b, q, N), ||Q||_F = 1.
        tolerance: relative power, (b,) or one for all.

    Returns:
        Q (b, q, N), F (b,), never above that of the start, and the evaluations of F per point,
        summed over the points.
    """
    x = to_real(Q)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    at = evaluate(sums, G, to_complex(x, sums.antennas))
    F, best, evaluations = at.value.copy(), x.copy(), len(x)
    index, damping = np.arange(len(x)), np.zeros(len(x))
    tolerance = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), len(x))
    for _ in range(_STEPS):
        move, promised, slope = _step(x, at, damping)
        going = (promised > tolerance[index] * slope) & (damping < _MOST_DAMPED)
        if not going.all():
            index, x, damping = index[going], x[going], damping[going]
            move, promised, G = move[going], promised[going], G[going]
            at = Objective(at.value[going], at.gradient[going], at.hessian[going])
        if not len(index):
            break
        trial = x + move
        trial /= np.linalg.norm(trial, axis=1, keepdims=True)
        new = evaluate(sums, G, to_complex(trial, sums.antennas))
        evaluations += len(index)
        gained = at.value - new.value
        better = gained > 1e-3 * promised
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
            np.where(gained > 0.5 * promised, 0.1 * damping, damping),
            np.maximum(4.0 * damping, 0.03),
        )
        damping[damping < 1e-3] = 0.0
    return to_complex(best, sums.antennas), F, evaluations
