"""Watching a flight: every end has its name, and nothing is sent that was not asked for."""

from typing import Any

import pytest
from scenes import Scene, arms, staged, starts
from stations import FOREIGN, VEHICLE

from faao_mav.wire.messages import (
    CommandAck,
    CommandLong,
    Envelope,
    MissionAck,
    MissionRequestList,
)
from faao_mav.wire.protocol import GROUND_STATION, MavCommand, MavResult, MissionType

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
ARM, DISARM, START = (MavCommand.ARM, 1.0), (MavCommand.ARM, 0.0), (MavCommand.START, 0.0)


def test_a_vehicle_that_does_not_arm_or_start_is_left_as_it_is() -> None:
    scene = Scene("ardupilot", arm=True)
    scene.mock._why_not_armed = lambda: "Compass not healthy"
    assert scene.run() == "refused"
    assert scene.commands == [ARM]
    answer = "the vehicle answers ARM with FAILED (it tried, or checked, and it did not work)"
    assert scene.watch.outcome.text == f"{answer}. It says: Arm: Compass not healthy"
    scene = Scene("px4", arm=True)
    scene.mock._flyable = lambda: None
    assert scene.run() == "refused"
    assert list(dict.fromkeys(scene.commands)) == [ARM, START, DISARM]
    denied = "answers START with DENIED (not as it was asked, or in the state that it is in)"
    assert scene.watch.outcome.text == f"the vehicle {denied}; it is disarmed"
    scene = Scene("ardupilot", arm=True)  # it arms without a word
    scene.tells(lambda message, _: () if isinstance(message, CommandAck) else [message])
    assert scene.run() == "refused"
    assert scene.commands == [*[ARM] * 5, DISARM]


def test_a_late_answer_to_arming_is_none_to_disarming() -> None:
    scene = staged("mission", "ardupilot", {"refuses": ""}, "0-10 loses disarm")

    def answer(now: float) -> None:
        ack = CommandAck(GROUND_STATION, MavCommand.ARM, 0)
        scene.client.on(Envelope(VEHICLE, ack), now)

    assert scene.run([(3.0, answer), (3.1, answer)]) == "refused"
    assert not scene.mock.armed


@KINDS
def test_what_refuses_to_disarm_is_told_as_armed(kind: str) -> None:
    scene = staged("mission", kind, {"refuses": ""})
    arm = scene.mock._arm
    scene.mock._arm = lambda wanted: arm(True) if wanted else 4
    assert scene.run() == "refused"
    assert "it may still be armed: it answers ARM with FAILED" in scene.watch.outcome.text
    assert scene.commands.count(DISARM) == 5


def test_a_mission_that_changes_while_it_is_started_is_disarmed() -> None:
    scene = Scene("px4", arm=True)
    rows = scene.mock.lists.items(MissionType.MISSION)

    def changes(message: object) -> bool:
        """Hold another mission as soon as it is armed, and say nothing to the start."""
        if starts(message):
            scene.mock.lists.replace(MissionType.MISSION, rows[:-1])
        return starts(message)

    scene.loses(changes)
    assert scene.run() == "changed"
    assert not scene.mock.armed


def test_an_interrupt_while_an_order_is_given_takes_it_back() -> None:
    """Ctrl-C comes anywhere: here between the order to arm, or to start, and its sending."""
    for ordered, then in ((arms, [DISARM]), (starts, [(MavCommand.SET_MODE, 1.0)])):
        scene = Scene("ardupilot", arm=True)
        said = scene.watch._said

        def interrupted(watch: Any = scene.watch, ordered: Any = ordered, said: Any = said) -> Any:
            if any(ordered(message) for message in watch._out):
                watch._said = said
                raise KeyboardInterrupt
            return said()

        scene.watch._said = interrupted
        with pytest.raises(KeyboardInterrupt):
            scene.run()
        orders = [each for each in scene.watch.cancel(100.0) if isinstance(each, CommandLong)]
        assert [(each.command, each.param1) for each in orders] == then


def test_what_is_answered_to_another_station_is_no_answer() -> None:
    scene = staged("mission", "px4", {"until": "12"}, "0-5 loses arm")

    def answer(now: float) -> None:
        scene.client.on(Envelope(VEHICLE, CommandAck(FOREIGN, MavCommand.ARM, 4)), now)

    assert scene.run([(4.0, answer)]) == "-"
    assert scene.mock.armed


def test_an_interrupt_while_it_is_read_again_ends_the_transfer() -> None:
    scene = Scene("px4", arm=True)
    scene.events = [(5.0, scene.client.interrupt)]
    scene.loses(lambda message: isinstance(message, MissionRequestList))
    assert scene.run() == "left"
    assert scene.client.sent[-1] == MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED)
    assert scene.orders == []
