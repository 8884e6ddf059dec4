"""Names for the array types that signatures use; shapes stand in the docstrings."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Real: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Integers: TypeAlias = NDArray[np.int_]
Flags: TypeAlias = NDArray[np.bool_]
RealOrComplex: TypeAlias = Real | Complex
