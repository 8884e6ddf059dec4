"""Which answers are shown, in whatever order they come, and what becomes of stale questions."""

import asyncio
import os
import time
from functools import partial, partialmethod
from typing import Any

import pytest
from conftest import FLYABLE, edited

from faao_mav import plan_mission
from faao_mav.app import workers
from faao_mav.app.answers import Answer, answer
from faao_mav.app.workers import Planner, Workers
from faao_mav.errors import FaaoError
from faao_mav.optimizer.direct import rough_flight


class Held:
    """Workers whose jobs are answered when the test says so."""

    def __init__(self) -> None:
        self.jobs: dict[str, asyncio.Future[Answer]] = {}

    async def short(self, *asked: Any, kind: str = "rough") -> Answer:
        _, text, *_ = asked
        job = f"{kind} {text}"
        self.jobs[job] = asyncio.get_running_loop().create_future()
        return await self.jobs[job]

    long = partialmethod(short, kind="finished")

    async def answer(self, job: str, answer: Answer | Exception | None = None) -> None:
        await asyncio.sleep(0.001)
        failed = isinstance(answer, Exception)
        tell: Any = self.jobs[job].set_exception if failed else self.jobs[job].set_result
        tell(answer or Answer(refused=job))
        await asyncio.sleep(0.001)


def test_the_last_question_wins_and_what_goes_wrong_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "_REST", 0.0)
    held, shown = Held(), list[str]()

    async def script() -> None:
        asked = Planner(held, lambda a: shown.append(a.refused or a.failed))  # type: ignore[arg-type]
        asked.ask("a", "p")
        await held.answer("finished a")
        await held.answer("rough a")  # after the finished one: not shown
        asked.ask("b", "p")
        await asyncio.sleep(0.001)
        asked.ask("c", "p")
        asked.ask("d", "p")  # a drag
        await held.answer("rough b")  # of an older question, and the next is of the newest
        await held.answer("finished d")
        await held.answer("rough d")
        assert all(job.done() for job in held.jobs.values())
        asked.ask("e", "p")
        await held.answer("rough e", ValueError("bug"))
        await held.answer("finished e", ValueError("bug"))
        asked.ask("f", "p")
        await held.answer("rough f", Answer(failed="no flight, roughly"))
        await held.answer("finished f", FaaoError("no flight"))
        asked.close()

    asyncio.run(script())
    *answers, wrong, right = shown
    assert answers == ["finished a", "rough b", "finished d"]
    assert "ValueError('bug')" in wrong
    assert right == "no flight"


def test_a_long_job_ends_with_its_wait_and_its_death_is_told() -> None:
    async def run() -> None:
        own = Workers()
        try:
            own._free = asyncio.Semaphore(1)
            stale = asyncio.create_task(own.long(time.sleep, 3600))
            await asyncio.sleep(0)
            stale.cancel()
            assert await own.long(os.path.join, "a", "b") == "a/b"
            with pytest.raises(FaaoError, match="has ended"):
                await own.long(os._exit, 3)
            with pytest.raises(ZeroDivisionError):
                await own.long(divmod, 1, 0)
            with pytest.raises(FaaoError, match="has ended"):
                await own.short(os._exit, 3)
            assert await own.short(partial(max, 1), 2) == 2
        finally:
            own.stop()

    asyncio.run(run())


def test_with_a_spread_the_finished_chart_of_what_is_delivered_tells_what_arrives() -> None:
    text = edited(FLYABLE, {"radio.causal": True, "radio.gain.spread_db": 6.0})
    found = answer(text, "p", plan_mission)
    assert found.result is not None
    assert found.result.shadowed is not None
    curves = [curve for chart in found.charts for curve in chart["series"]]
    ends = {curve["name"]: curve["data"][-1][1] for curve in curves}
    quantiles = found.result.shadowed.quantiles
    for name, rate in (("more in 9 of 10", quantiles[0.1]), ("more in 1 of 10", quantiles[0.9])):
        assert ends[name] == pytest.approx(10 * rate, abs=1e-3)
    rough = [curve for chart in answer(text, "p", rough_flight).charts for curve in chart["series"]]
    assert [curve["name"] for curve in rough] == [name for name in ends if "of 10" not in name]
