"""Solving the rest of a flight in a process of its own, so that setpoints go out meanwhile."""

import signal
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool

from joblib.externals.loky import ProcessPoolExecutor

from faao_mav.errors import FaaoError
from faao_mav.optimizer.rest import Rest, solve_rest
from faao_mav.optimizer.solution import Solution


class ProcessSolver:
    """A `Solver` whose answers come from one other process; to be used in a `with` statement.

    The process is started at once: the first question needs no more than its answer takes.
    """

    def __init__(self) -> None:
        # not forked, it holds none of the link's sockets; it does not import the program that runs
        self._pool = ProcessPoolExecutor(1, initializer=_prepare)
        self._answer: Future[Solution] | None = None
        self._pool.submit(_prepare)

    def __enter__(self) -> "ProcessSolver":
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(wait=False, kill_workers=True)

    def ask(self, rest: Rest) -> None:
        """Begin to solve `rest`, when what was asked before is solved."""
        if self._answer is not None:
            self._answer.cancel()
        try:
            self._answer = self._pool.submit(solve_rest, rest)
        except BrokenProcessPool as error:
            self._answer = Future()
            self._answer.set_exception(error)

    def answer(self) -> Solution | str | None:
        """Return the flight, or why there is none; None: not yet."""
        if self._answer is None or not self._answer.done():
            return None
        try:
            return self._answer.result()
        except FaaoError as error:
            return str(error)
        except BrokenProcessPool:
            return "the process that solves it has ended"


def _prepare() -> None:
    """Leave interrupts from the keyboard to the process that flies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
