"""What the page does with a vehicle, without the page: it starts nothing, and leaves in peace."""

import asyncio
import shlex
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import FLYABLE
from hypothesis import given
from hypothesis import strategies as st
from served import vehicle

from faao_mav import plan_mission
from faao_mav.app.vehicle import fly_command, uploaded, watched
from faao_mav.app.workers import talk
from faao_mav.errors import FaaoError, PlanError
from faao_mav.fly.fly import fly_mission
from faao_mav.fly.preflight import Flight
from faao_mav.plan import parse_plan
from faao_mav.sim import MockAutopilot
from faao_mav.sim.faults import Faults
from faao_mav.workflow import Result


@pytest.fixture(scope="module")
def result() -> Result:
    text = FLYABLE.replace("  causal: false\n", "").replace("duration: 10", "duration: 14")
    return plan_mission(parse_plan(text, "plan.yaml"))


def test_a_flight_goes_on_when_who_watches_it_is_closed(result: Result) -> None:
    assert result.conversion is not None
    flight = Flight.planned(result.conversion, result.solution)
    phases, seen = list[str](), asyncio.Event()

    def hear(told: dict[str, Any]) -> None:
        phases.append(told.get("phase", ""))
        if phases[-1] == "flying":
            seen.set()

    async def run(connection: str, mock: MockAutopilot) -> str:
        asked = (hear, threading.Event(), result, connection)
        assert (await talk(watched, *asked)).startswith("different")
        assert "verified" in await talk(uploaded, *asked)
        watch = asyncio.create_task(talk(watched, *asked))
        while "waiting" not in phases:
            await asyncio.sleep(0.05)
        assert not mock.armed
        flown = asyncio.create_task(asyncio.to_thread(fly_mission, flight, connection, arm=True))
        await seen.wait()
        watch.cancel()
        with pytest.raises(asyncio.CancelledError):
            await watch
        report = await flown
        assert report.ending is not None
        return report.ending.kind

    with vehicle(speedup=16.0, parameters=result.conversion.parameters) as (connection, mock):
        assert asyncio.run(run(connection, mock)) == "finished"


def test_an_upload_that_is_left_is_cancelled_on_the_vehicle(result: Result) -> None:
    async def run(connection: str) -> None:
        interrupt = threading.Event()
        asyncio.get_running_loop().call_later(3, interrupt.set)
        await talk(uploaded, print, interrupt, result, connection)

    slow = Faults(loss=0.2, rate=300)
    with (
        vehicle(faults=slow) as (connection, _),
        pytest.raises(FaaoError, match=r"interrupted .*cancelled"),
    ):
        asyncio.run(run(connection))


def test_what_does_not_pass_validation_is_neither_uploaded_nor_watched(result: Result) -> None:
    useless = replace(result, conversion=None)
    for act in (uploaded, watched):
        with pytest.raises(PlanError, match="does not pass validation"):
            act(print, lambda: None, useless, "udpout:127.0.0.1:1")


@given(st.text(), st.text(min_size=1).filter(lambda name: "\0" not in name and "/" not in name))
def test_the_command_is_quoted_for_a_shell(connection: str, name: str) -> None:
    line = fly_command(connection, Path("/tmp") / name)
    if not connection.strip() or not connection.isprintable():
        assert line == ""
        return
    assert line.isprintable()
    words = shlex.split(line)
    file = ["--plan", str((Path("/tmp") / name).resolve())] if name.isprintable() else []
    assert words == ["faao-mission", "fly", "mission.plan", "--to", connection, *file, "--arm"]
