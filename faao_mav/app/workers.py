"""What computes and talks for the page, so that nothing blocks it and what is stale ends.

Of the questions of one window the last wins.
"""

import asyncio
import multiprocessing
import os
import signal
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from faao_mav.app.answers import Answer, answer
from faao_mav.arrays import Real
from faao_mav.errors import FaaoError
from faao_mav.optimizer.direct import rough_flight
from faao_mav.workflow import plan_mission

T = TypeVar("T")

_PRELOADED = ("faao_mav.app.answers", "scipy.interpolate", "shapely", "pyproj")
"""What a job would else import again: modules that `plan_mission` and the report page use."""

_NICE = 10  # by how much long jobs give way to the page and to short ones. Chosen

_GRACE = 2.0
"""Seconds that a talk has to end by itself, as an upload that tells the vehicle that it is
cancelled. A job looks once a second."""

_REST = 0.3
"""Seconds without a change after which the finished answer is asked for. Chosen: shorter than the
pause in which a hand looks, longer than between two moves of a drag."""

_ENDED = "the process that computes has ended; change the plan again"


class Workers:
    """One process that stays, for short jobs that share tables, and one for each long job.

    Setup, once: `Workers()`, which begins to load what jobs need; per job: `short` or `long`; at
    the end: `stop`. A long job that is cancelled is killed.
    """

    def __init__(self) -> None:
        # a fork of a server with threads may deadlock; Windows has no server to fork from
        forks = "forkserver" in multiprocessing.get_all_start_methods()
        self._context: Any = multiprocessing.get_context("forkserver" if forks else "spawn")
        if forks:
            from multiprocessing.forkserver import ensure_running

            self._context.set_forkserver_preload(["__main__", *_PRELOADED])
            ensure_running()
        self._pool: ProcessPoolExecutor | None = None
        self._free = asyncio.Semaphore(max(1, (os.cpu_count() or 2) - 1))

    async def short(self, work: Callable[..., T], *arguments: Any) -> T:
        """Return what `work` returns of the process that stays; where that died, of a new one."""
        pool = self._pool = self._pool or ProcessPoolExecutor(
            1, mp_context=self._context, initializer=_prepare
        )
        try:
            return await asyncio.get_running_loop().run_in_executor(pool, work, *arguments)
        except BrokenProcessPool:
            if self._pool is pool:
                self._pool = None
            raise FaaoError(_ENDED) from None

    async def long(self, work: Callable[..., T], *arguments: Any) -> T:
        """Return what `work` returns, or raise what it raises, of a process of its own."""
        async with self._free:
            here, there = self._context.Pipe(duplex=False)
            process = self._context.Process(target=_job, args=(there, work, arguments), daemon=True)
            process.start()
            there.close()
            try:
                # a process that is killed closes its end: the thread that waits ends too
                value, error = await asyncio.to_thread(here.recv)
            except EOFError:
                raise FaaoError(_ENDED) from None
            finally:
                process.kill()
        if error is not None:
            raise error
        returned: T = value
        return returned

    def stop(self) -> None:
        """End all processes, whatever they do; those of others, as of joblib, go on."""
        for process in multiprocessing.active_children():
            if isinstance(process, self._context.Process):
                process.kill()
        if self._pool is not None:  # its thread too, which would else end with the interpreter
            self._pool.shutdown(cancel_futures=True)


async def talk(
    work: Callable[..., T],
    hear: Callable[[Any], object],
    interrupt: threading.Event,
    *arguments: Any,
) -> T:
    """Return what `work` returns, or raise what it raises, of a thread of its own.

    The first arguments of `work` are two functions: what the one is given is given to `hear`, the
    other raises KeyboardInterrupt once `interrupt` was set. Cancelled, it is interrupted.
    """
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[T] = loop.create_future()

    def call(act: Callable[[Any], object], value: object) -> None:
        with suppress(RuntimeError):  # the server has ended meanwhile
            loop.call_soon_threadsafe(lambda: None if ended.done() else act(value))

    def look() -> None:
        if interrupt.is_set():
            interrupt.clear()
            raise KeyboardInterrupt

    def run() -> None:
        try:
            call(ended.set_result, work(lambda said: call(hear, said), look, *arguments))
        except Exception as error:  # told to whom has asked
            call(ended.set_exception, error)

    interrupt.clear()
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        return await ended
    except asyncio.CancelledError:
        interrupt.set()
        await asyncio.to_thread(thread.join, _GRACE)
        raise


def _prepare() -> None:
    """Leave Ctrl-C to the page, which ends its jobs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _job(end: Connection, work: Callable[..., object], arguments: tuple[object, ...]) -> None:
    _prepare()
    if hasattr(os, "nice"):
        os.nice(_NICE)
    try:
        end.send((work(*arguments), None))
    except Exception as error:  # told to whom has asked
        end.send((None, error))


class Planner:
    """The answers to the plan of one window.

    Setup, once: `Planner(workers, show)`; per change of the plan: `ask`; at the end: `close`.
    `show` is called with a rough answer as often as one is ready, then with the finished one.
    """

    def __init__(self, workers: Workers, show: Callable[[Answer], None]) -> None:
        self._workers, self._show = workers, show
        self._asked, self._answered = 0, 0  # numbers of questions, and of the last finished answer
        self._plan = ("", "")
        self._near: Real | None = None
        self._tasks: dict[str, asyncio.Task[None]] = {}  # "rough" and "finished"

    def ask(self, text: str, source: str, *, soon: bool = True) -> None:
        """Ask for the answers to the plan `text`; not `soon`: without the rough ones."""
        self._asked, self._plan = self._asked + 1, (text, source)
        tasks = self._tasks
        if soon and ("rough" not in tasks or tasks["rough"].done()):
            tasks["rough"] = asyncio.create_task(self._answer_roughly())
        if "finished" in tasks:
            tasks["finished"].cancel()
        tasks["finished"] = asyncio.create_task(self._finish(_REST if soon else 0.0))

    def close(self) -> None:
        """Ask for nothing any more."""
        for task in self._tasks.values():
            task.cancel()

    async def _answer_roughly(self) -> None:
        question = 0
        while question < self._asked:
            question, solve = self._asked, partial(rough_flight, near=self._near)
            found = await _told(self._workers.short(answer, *self._plan, solve))
            # the finished answer says whether there is a flight
            if not found.failed and question > self._answered:
                self._take(found)

    async def _finish(self, rest: float) -> None:
        await asyncio.sleep(rest)
        found = await _told(self._workers.long(answer, *self._plan, plan_mission))
        self._answered = self._asked
        self._take(found)

    def _take(self, found: Answer) -> None:
        if found.velocities is not None:
            self._near = found.velocities
        self._show(found)


async def _told(job: Awaitable[Answer]) -> Answer:
    try:
        return await job
    except Exception as error:  # a page that waits for ever says nothing
        return Answer(failed=said(error))


def said(error: Exception) -> str:
    """Return what is said of an `error`, of one that should not be too."""
    if isinstance(error, FaaoError | OSError):
        return str(error)
    return f"a mistake of faao-mav, please report it: {error!r}"
