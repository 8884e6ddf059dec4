"""What the page does with a vehicle, without the page: a flight that is held and left; refusals."""

import re
from dataclasses import replace
from threading import Event
from typing import Any

import pytest
from conftest import FLYABLE, free_port
from served import running

from faao_mav import plan_mission
from faao_mav.app.vehicle import uploaded, watched
from faao_mav.errors import PlanError
from faao_mav.mavlink.mock import MockAutopilot, behaviour_of
from faao_mav.mavlink.mock.serve import predicted
from faao_mav.mission.item import Home
from faao_mav.plan import parse_plan
from faao_mav.workflow import Result

HOME = Home(-35.363262, 149.165237, 584.0)


@pytest.fixture(scope="module")
def result() -> Result:
    text = FLYABLE.replace("  causal: false\n", "").replace("duration: 10", "duration: 14")
    return plan_mission(parse_plan(text, "plan.yaml"))


def test_a_flight_that_the_page_has_started_is_held_then_left(result: Result) -> None:
    port, interrupt, told = free_port(), Event(), list[dict[str, Any]]()
    connection = f"udpout:127.0.0.1:{port}"

    def tell(each: dict[str, Any]) -> None:
        told.append(each)
        if each.get("phase") == "flying" or "it holds" in each.get("note", ""):
            interrupt.set()

    assert result.conversion is not None
    mock = MockAutopilot(
        behaviour_of("ardupilot"),
        home=HOME,
        fly=predicted(),
        parameters=result.conversion.parameters,
        beat=0.1,
        speedup=8.0,
    )
    with running(mock, f"udpin:127.0.0.1:{port}"):
        assert watched(tell, interrupt, result, connection, arm=True).startswith("different")
        assert told == []
        assert not mock.armed
        assert "verified" in uploaded(result, connection)
        said = watched(tell, interrupt, result, connection, arm=True)
        assert mock.armed
    left = r"left         no longer watched: it is armed, in mode BRAKE, \d+ m above home"
    assert re.search(rf"{left}$", said)
    assert any("asking the vehicle to hold" in each.get("note", "") for each in told)


def test_what_does_not_pass_validation_is_neither_uploaded_nor_watched(result: Result) -> None:
    useless = replace(result, conversion=None)
    assert "does not pass validation" in uploaded(useless, "udpout:127.0.0.1:1")
    with pytest.raises(PlanError, match="does not pass validation"):
        watched(print, Event(), useless, "udpout:127.0.0.1:1", arm=True)
