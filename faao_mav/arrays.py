"""Names for the array types that signatures use, and packed symmetric matrices of two by two."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Real: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Integers: TypeAlias = NDArray[np.int_]
Flags: TypeAlias = NDArray[np.bool_]
RealOrComplex: TypeAlias = Real | Complex


CACHE = 1 << 17
"""How many numbers are worked on at once, a megabyte: they stay in a processor's cache. Chosen."""

PACKED = np.array([[0, 1], [1, 2]])
"""Which of the entries xx, xy, yy stand where in the matrix."""


def products(a: Real, b: Real) -> Real:
    """Return the symmetric part of a b^T as its entries xx, xy, yy (3, ...), for a, b (2, ...)."""
    return np.stack([a[0] * b[0], (a[0] * b[1] + a[1] * b[0]) / 2, a[1] * b[1]])
