"""Python processes that this one starts."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

_SAFE_PATH = "PYTHONSAFEPATH"


@contextmanager
def apart_from_the_current_directory() -> Iterator[None]:
    """Let no Python that is started within this look for modules in the current directory.

    joblib and multiprocessing start theirs by `python -m` and `python -c`, which look there first:
    a `joblib.py` beside a plan would run.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before
