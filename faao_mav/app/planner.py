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


class Order:
    """Which answers are shown: rough ones of any newer question, finished ones of the newest.

    >>> order = Order()
    >>> first, second = order.ask(), order.ask()
    >>> order.take(first, finished=False), order.take(first, finished=True)
    (True, False)
    >>> order.take(second, finished=True), order.take(second, finished=False)
    (True, False)
    """

    def __init__(self) -> None:
        self.asked = 0
        self._shown = (0, False)  # number of the question, and whether its answer is finished

    def ask(self) -> int:
        """Return the number of a new question."""
        self.asked += 1
        return self.asked

    def take(self, question: int, *, finished: bool) -> bool:
        """Return whether an answer to `question` is shown, and from now on no older one."""
        stale = (finished and question != self.asked) or (question, finished) <= self._shown
        if not stale:
            self._shown = (question, finished)
        return not stale


class Planner:
    """The answers to the plan of one window.

    Setup, once: `Planner(workers, show)`; per change of the plan: `ask`; at the end: `close`.
    `show` is called with a rough answer as often as one is ready, then with the finished one.
    """

    def __init__(self, workers: Workers, show: Callable[[Answer], None]) -> None:
        self._workers, self._show = workers, show
        self._order = Order()
        self._plan = ("", "")
        self._near: Real | None = None
        self._rough: asyncio.Task[None] | None = None
        self._finished: asyncio.Task[None] | None = None

    def ask(self, text: str, source: str, *, soon: bool = True) -> None:
        """Ask for the answers to the plan `text`; not `soon`: without the rough ones."""
        question, self._plan = self._order.ask(), (text, source)
        if soon and (self._rough is None or self._rough.done()):
            self._rough = asyncio.create_task(self._answer_roughly())
        if self._finished is not None:
            self._finished.cancel()
        self._finished = asyncio.create_task(self._finish(question, _REST if soon else 0.0))

    def close(self) -> None:
        """Ask for nothing any more."""
        for task in (self._rough, self._finished):
            if task is not None:
                task.cancel()

    async def _answer_roughly(self) -> None:
        question = 0
        while question < self._order.asked:
            question = self._order.asked
            job = self._workers.short(answers.rough, *self._plan, self._near)
            answer = await _told(job)
            if not answer.failed:  # the finished answer says whether there is a flight
                self._take(question, answer, finished=False)

    async def _finish(self, question: int, rest: float) -> None:
        await asyncio.sleep(rest)
        answer = await _told(self._workers.long(answers.finished, *self._plan))
        self._take(question, answer, finished=True)

    def _take(self, question: int, answer: Answer, *, finished: bool) -> None:
        if self._order.take(question, finished=finished):
            if answer.velocities is not None:
                self._near = answer.velocities
            self._show(answer)


async def _told(job: Awaitable[Answer]) -> Answer:
    """Return the answer of `job`, or the error in its stead."""
    try:
        return await job
    except FaaoError as error:
        return Answer(failed=str(error))
    except Exception as error:  # a page that waits for ever says nothing
        return Answer(failed=mistake(error))


def mistake(error: Exception) -> str:
    """Return what is said of an `error` that should not be."""
    return f"a mistake of faao-mav, please report it: {error!r}"
