"""The processes that compute for the page, so that nothing blocks it and what is stale ends."""

import asyncio
import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from faao_mav.errors import FaaoError

T = TypeVar("T")

_PRELOADED = ("faao_mav.app.answers", "faao_mav.report", "scipy.interpolate", "shapely", "pyproj")
"""What a job would else import again: modules that `plan_mission` and the report page use."""

_NICE = 10
"""By how much long jobs give way to the page and to short ones. Chosen."""

_GRACE = 2.0
"""Seconds that a talk has to end by itself, as an upload that tells the vehicle that it is
cancelled. A job looks once a second."""

_ENDED = "the process that computes has ended; change the plan again"


class Interrupt:
    """What ends a talk early: once `set`, its job finds itself interrupted, as by Ctrl-C."""

    def __init__(self) -> None:
        self._end: Connection | None = None

    def begin(self, end: Connection) -> None:
        """Belong to the talk at the other `end`."""
        self._end = end

    def set(self) -> None:
        """Interrupt the talk, if one goes on."""
        if self._end is not None:
            with suppress(OSError):
                self._end.send(None)


class Workers:
    """One process that stays, for short jobs that share tables, and one for each other job.

    Setup, once: `Workers()`, which begins to load what jobs need; per job: `short`, `long` or
    `talk`; at the end: `stop`. A job of a process of its own ends with its wait: cancelled, the
    process is killed, that of a talk after `_GRACE` seconds in which it is interrupted.
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
            return await self._run(work, arguments)

    async def talk(
        self,
        work: Callable[..., T],
        hear: Callable[[Any], object],
        interrupt: Interrupt,
        *arguments: Any,
    ) -> T:
        """Do the same, but at once and giving way to nothing: what cannot wait for its turn.

        The first arguments of `work` are two functions: what the one is given is given to `hear`,
        the other returns whether `interrupt` was set since it was last asked.
        """
        return await self._run(work, arguments, hear, interrupt)

    async def _run(
        self,
        work: Callable[..., T],
        arguments: tuple[object, ...],
        hear: Callable[[Any], object] | None = None,
        interrupt: Interrupt | None = None,
    ) -> T:
        here, there = self._context.Pipe()
        told = (there, work, arguments, interrupt is not None)
        process = self._context.Process(target=_job, args=told)
        process.daemon = True
        process.start()
        there.close()
        if interrupt is not None:
            interrupt.begin(here)
        try:
            # a process that is killed closes its end: the thread that waits ends too
            while (message := await asyncio.to_thread(here.recv))[0] == "tells":
                if hear is not None:
                    hear(message[1])
        except EOFError:
            raise FaaoError(_ENDED) from None
        except asyncio.CancelledError:
            if interrupt is not None:
                interrupt.set()
                await _ended(process)
            raise
        finally:
            process.kill()
        if message[0] == "fails":
            raise message[1]
        value: T = message[1]
        return value

    def stop(self) -> None:
        """End all processes, whatever they do; those of others, as of joblib, go on."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            if isinstance(process, self._context.Process):
                process.kill()


async def _ended(process: Any) -> None:
    """Wait for the end of `process`, `_GRACE` seconds at most."""
    last = time.monotonic() + _GRACE
    while process.is_alive() and time.monotonic() < last:
        await asyncio.sleep(0.05)


def _prepare() -> None:
    """Leave Ctrl-C to the page, which ends its jobs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _job(
    end: Connection, work: Callable[..., object], arguments: tuple[object, ...], talks: bool
) -> None:
    _prepare()
    if talks:
        arguments = (lambda told: end.send(("tells", told)), lambda: _interrupted(end), *arguments)
    elif hasattr(os, "nice"):
        os.nice(_NICE)
    try:
        outcome: tuple[str, object] = "returns", work(*arguments)
    except Exception as error:  # told to whom has asked
        outcome = "fails", error
    end.send(outcome)


def _interrupted(end: Connection) -> bool:
    """Return whether the page has asked to end, or has itself ended."""
    if not end.poll():
        return False
    with suppress(EOFError):
        end.recv()
    return True
