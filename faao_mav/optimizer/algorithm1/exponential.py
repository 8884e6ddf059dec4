"""The exponential terms of (27) and (35) in a form that a solver survives.

An exponent of 10^4 at the point of expansion makes a cone that no solver scales. Its term is
worth e^-10000 there and may be replaced by anything that lies above it and is negligible too:
an exponent t that is worth more than `CAP` is shrunk to t CAP / c, c its value at that point.
For t >= 0 that raises the term, for t < 0 the term stays above 1, and the term that it bounds
never exceeds 1: the surrogate remains an upper bound, and is off by less than e^-CAP.
"""

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real

CAP = 40.0


def shrink(c: Real) -> Real:
    """Return the factor for exponents worth `c` at the point of expansion."""
    return np.minimum(1.0, CAP / np.maximum(c, CAP))


def merge_equal(c: Real, multiplicity: Real) -> tuple[NDArray[np.intp], Real, Real]:
    """Merge terms of one slot whose exponents agree to 1e-12.

    `c` (n, k), `multiplicity` (k,). Returns flat arrays over the remaining terms, slot by slot:
    slot index, exponent, multiplicity.
    """
    order = np.argsort(c, axis=1)
    c = np.take_along_axis(c, order, axis=1)
    weight = multiplicity[order]
    new = np.ones(c.shape, dtype=bool)
    new[:, 1:] = np.diff(c, axis=1) > 1e-12 * (1 + c[:, 1:])
    term = np.cumsum(new.ravel()) - 1
    merged = np.bincount(term, weights=weight.ravel()).astype(np.float64)
    slots = np.repeat(np.arange(len(c)), c.shape[1]).reshape(c.shape)
    return slots[new], c[new], merged
