"""Sums of Gaussians over evenly spaced levels: those of a square alphabet or of its differences."""

import numpy as np

from faao_mav.arrays import Real

_WITHOUT_OVERFLOW = 600.0
"""E m² up to which exp(E m²), and its inverse times what is left, are doubles: those end at 709."""


def level_sum(t: Real, levels: Real, counts: Real, energy: Real) -> Real:
    """Return Σ_l count_l exp(-E (t - l)²), of the shape of `t`.

    The `levels` (L,) rise evenly spaced from -m to m, `counts` (L,) are those of -l and l alike.
    `energy`, E >= 0, is broadcast to `t`. With δ the spacing, the sum is exp(-E (|t| - m)²) times
    the polynomial Σ_k count_k exp(E (m² - l_k²)) h^k in h = exp(-2 E δ |t|): two exponentials for
    each t in place of L. No term is negative, so that the result is exact but for rounding.

    >>> level_sum(np.array([0.0, 1.0]), np.array([-1.0, 1.0]), np.ones(2), np.ones(1)).round(4)
    array([0.7358, 1.0183])
    """
    highest, spacing = levels[-1], levels[1] - levels[0]
    if np.max(energy, initial=0.0) * highest**2 > _WITHOUT_OVERFLOW:
        total = np.zeros_like(t)
        for level, count in zip(levels, counts, strict=True):
            total += count * np.exp(-energy * (t - level) ** 2)
        return total
    size = np.abs(t)
    h = (-2.0 * spacing * energy) * size
    np.exp(h, out=h)
    total = np.full_like(t, counts[0])
    for level, count in zip(levels[1:], counts[1:], strict=True):
        total *= h
        total += count * np.exp(energy * (highest**2 - level**2))
    size -= highest
    size *= size
    size *= -energy
    total *= np.exp(size, out=size)
    return total
