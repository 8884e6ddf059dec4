"""LAPACK as scipy brings it, without the rest of `scipy.linalg`.

`scipy.linalg` imports most of scipy and numpy.f2py: 0.34 s of processor time where this takes 0.13,
on two busy cores.
"""

from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from typing import Any

import scipy


def _loaded() -> Any:
    """Return the extension module with the routines; where it has moved, `scipy.linalg.lapack`."""
    spec = PathFinder.find_spec("_flapack", [str(Path(scipy.__file__).with_name("linalg"))])
    if spec is None or spec.loader is None:
        from scipy.linalg import lapack as public

        return public
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


lapack = _loaded()
