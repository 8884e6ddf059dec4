"""The questions of one window to the worker processes: the last one wins."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from os import cpu_count
from typing import Any, TypeVar

from faao_mav.app import answers
from faao_mav.app.answers import Answer
from faao_mav.arrays import Real
from faao_mav.errors import FaaoError

T = TypeVar("T")

_REST = 0.3
"""Seconds without a change after which the finished answer is asked for. Chosen: shorter than the
pause in which a hand looks, longer than between two moves of a drag."""


class Workers:
    """The processes of a server: one for rough answers, so that none waits for a finished one."""

    def __init__(self) -> None:
        self._pools: dict[str, ProcessPoolExecutor] = {}

    def start(self) -> None:
        """Start the processes and let them load what they need."""
        for kind in ("rough", "finished"):
            self._pool(kind).submit(answers.warmed)

    async def run(self, kind: str, work: Callable[..., T], *arguments: Any) -> T:
        """Return what `work` returns of a process of this `kind`; a dead process is replaced."""
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._pool(kind), work, *arguments)
        except BrokenProcessPool:
            self._pools.pop(kind).shutdown(wait=False, cancel_futures=True)
            raise FaaoError("the process that computes has ended; change the plan again") from None

    def stop(self) -> None:
        """End the processes."""
        for pool in self._pools.values():
            pool.shutdown(wait=False, cancel_futures=True)
        self._pools.clear()

    def _pool(self, kind: str) -> ProcessPoolExecutor:
        if kind not in self._pools:
            count = 1 if kind == "rough" else max(1, (cpu_count() or 2) - 1)
            # a fork of a server with threads may deadlock
            self._pools[kind] = ProcessPoolExecutor(count, mp_context=get_context("spawn"))
        return self._pools[kind]


class Planner:
    """The answers to the plan of one window, in the order of the questions, the newest only.

    Setup, once: `Planner(workers, show)`; per change of the plan: `ask`. `show` is called with a
    rough answer as often as one is ready, then with the finished one.
    """

    def __init__(self, workers: Workers, show: Callable[[Answer], None]) -> None:
        self._workers, self._show = workers, show
        self._asked = 0
        self._plan = ("", "")
        self._near: Real | None = None
        self._tasks: dict[str, asyncio.Task[None]] = {}

    def ask(self, text: str, source: str, *, soon: bool = True) -> None:
        """Ask for the answers to the plan `text`; not `soon`: without the rough ones."""
        self._asked += 1
        self._plan = (text, source)
        if soon and ("rough" not in self._tasks or self._tasks["rough"].done()):
            self._tasks["rough"] = asyncio.create_task(self._answer_roughly())
        if "finished" in self._tasks:
            self._tasks["finished"].cancel()  # what waits in the queue of the processes is dropped
        self._tasks["finished"] = asyncio.create_task(self._finish(_REST if soon else 0.0))

    def close(self) -> None:
        """Ask for nothing any more."""
        for task in self._tasks.values():
            task.cancel()

    async def _answer_roughly(self) -> None:
        answered = 0
        while answered < self._asked:
            answered = self._asked
            answer = await self._answer("rough", answers.rough, *self._plan, self._near)
            finished = self._tasks.get("finished")
            if finished is not None and finished.done():
                return  # the finished answer to the newest question was quicker
            self._take(answer)

    async def _finish(self, rest: float) -> None:
        await asyncio.sleep(rest)
        asked = self._asked
        answer = await self._answer("finished", answers.finished, *self._plan)
        if asked == self._asked:
            self._take(answer)

    async def _answer(self, kind: str, work: Callable[..., Answer], *arguments: Any) -> Answer:
        try:
            return await self._workers.run(kind, work, *arguments)
        except FaaoError as error:
            return Answer(failed=str(error))

    def _take(self, answer: Answer) -> None:
        if answer.velocities is not None:
            self._near = answer.velocities
        self._show(answer)
