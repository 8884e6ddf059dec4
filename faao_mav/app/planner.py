"""The questions of one window and the answers to them: the last question wins."""

import asyncio
from collections.abc import Awaitable, Callable

from faao_mav.app import answers
from faao_mav.app.answers import Answer
from faao_mav.app.workers import Workers
from faao_mav.arrays import Real
from faao_mav.errors import FaaoError

_REST = 0.3
"""Seconds without a change after which the finished answer is asked for. Chosen: shorter than the
pause in which a hand looks, longer than between two moves of a drag."""


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
        self._rough: asyncio.Task[None] | None = None
        self._finished: asyncio.Task[None] | None = None

    def ask(self, text: str, source: str, *, soon: bool = True) -> None:
        """Ask for the answers to the plan `text`; not `soon`: without the rough ones."""
        self._asked, self._plan = self._asked + 1, (text, source)
        if soon and (self._rough is None or self._rough.done()):
            self._rough = asyncio.create_task(self._answer_roughly())
        if self._finished is not None:
            self._finished.cancel()
        self._finished = asyncio.create_task(self._finish(_REST if soon else 0.0))

    def close(self) -> None:
        """Ask for nothing any more."""
        for task in (self._rough, self._finished):
            if task is not None:
                task.cancel()

    async def _answer_roughly(self) -> None:
        question = 0
        while question < self._asked:
            question = self._asked
            answer = await _told(self._workers.short(answers.rough, *self._plan, self._near))
            # the finished answer says whether there is a flight
            if not answer.failed and question > self._answered:
                self._take(answer)

    async def _finish(self, rest: float) -> None:
        await asyncio.sleep(rest)
        answer = await _told(self._workers.long(answers.finished, *self._plan))
        self._answered = self._asked
        self._take(answer)

    def _take(self, answer: Answer) -> None:
        if answer.velocities is not None:
            self._near = answer.velocities
        self._show(answer)


async def _told(job: Awaitable[Answer]) -> Answer:
    """Return the answer of `job`, or the error in its stead."""
    try:
        return await job
    except Exception as error:  # a page that waits for ever says nothing
        return Answer(failed=said(error))


def said(error: Exception) -> str:
    """Return what is said of an `error`, of one that should not be too."""
    if isinstance(error, FaaoError | OSError):
        return str(error)
    return f"a mistake of faao-mav, please report it: {error!r}"
