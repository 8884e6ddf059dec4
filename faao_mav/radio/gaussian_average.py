"""Averages over Gaussian noise: a grid for one or two dimensions, lattice points for more."""

import numpy as np

from faao_mav.arrays import Real

# Beyond this many standard deviations lies less than 1e-9 of the mass.
_REACH = 6.5

# A Korobov rule is the powers of one number; this one was picked among 300 drawn at random for the
# smallest P_2 figures over 2^5..2^10 points in 3 to 9 dimensions.
_KOROBOV = 826727


def normal_grid(dimensions: int, spacing: float) -> tuple[Real, Real]:
    """Return nodes and weights of the trapezoidal rule for the mean under N(0, I).

    On the whole line the trapezoidal rule converges exponentially for functions analytic in a
    strip, as the logarithm of a sum of exponentials is, and needs no more nodes than
    Gauss-Hermite: Trefethen and Weideman, "The exponentially convergent trapezoidal rule",
    SIAM Review 56 (2014).

    Args:
        dimensions: 1 or more; nodes lie in a ball of 6.5 standard deviations.
        spacing: distance of neighbouring nodes, in standard deviations.

    Returns:
        Nodes (g, dimensions) and weights (g,) that sum to 1.

    >>> z, weight = normal_grid(1, 0.5)
    >>> abs(float(weight @ z[:, 0] ** 2) - 1.0) < 1e-8
    True
    """
    steps = int(_REACH / spacing)
    line = spacing * np.arange(-steps, steps + 1)
    index = np.indices((len(line),) * dimensions).reshape(dimensions, -1)
    nodes = line[index].T
    squared = np.sum(nodes**2, axis=1)
    inside = squared <= _REACH**2
    weights = np.exp(-0.5 * squared[inside])
    return np.ascontiguousarray(nodes[inside]), weights / np.sum(weights)


def lattice(points: int, dimensions: int, *, refine: bool = False) -> Real:
    """Return a rank-1 lattice in the unit cube, (points, dimensions).

    Args:
        points: how many, a power of two up to 2^19.
        dimensions: how many coordinates; the first alone is evenly spaced in order.
        refine: return the points that, together with ``lattice(points, dimensions)``, make up
            ``lattice(2 * points, dimensions)``.

    >>> lattice(4, 1).ravel().tolist(), lattice(2, 1, refine=True).ravel().tolist()
    ([0.0, 0.25, 0.5, 0.75], [0.25, 0.75])
    """
    total = 2 * points if refine else points
    steps = np.arange(1, total, 2) if refine else np.arange(total)
    generator = np.array([pow(_KOROBOV, j, total) for j in range(dimensions)], dtype=np.int64)
    return (steps[:, None] * generator % total) / total


def normal_from_uniform(uniform: Real) -> Real:
    """Map pairs of uniform coordinates to pairs of normal ones (Box and Muller).

    Args:
        uniform: (..., 2 k) in [0, 1).

    Returns:
        (..., 2 k), the first k from cosines, the others from sines.

    >>> normal_from_uniform(np.array([0.5, 0.25])).round(6)
    array([0.     , 1.17741])
    """
    half = uniform.shape[-1] // 2
    radius = np.sqrt(-2.0 * np.log1p(-uniform[..., :half]))
    angle = 2.0 * np.pi * uniform[..., half:]
    return np.concatenate([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
