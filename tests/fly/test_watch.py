"""Watching a flight: every end has its name, and nothing is sent that was not asked for."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from flight_logs import heights
from mock_flights import fly
from scenes import AnotherStation, Scene, arms, starts
from simulate import Station
from stations import FOREIGN, HOME, VEHICLE, a_mission, rows_for

from faao_mav.mission import Mission
from faao_mav.sim.faults import Faults
from faao_mav.wire.messages import CommandAck, Envelope
from faao_mav.wire.protocol import GROUND_STATION, MavCommand, MissionType

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
LOSSES = pytest.mark.parametrize("loss", [0.05, 0.2])
AUTO = {"ardupilot": 3, "px4": 4 << 16 | 4 << 24}
HOLD = {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}
LOITER = 5
"""A pilot's mode, of ArduCopter: PX4 knows no such number, and the mock takes any."""
ARM, DISARM, START = (MavCommand.ARM, 1.0), (MavCommand.ARM, 0.0), (MavCommand.START, 0.0)


@KINDS
@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2])
def test_armed_started_and_watched_to_the_end(kind: str, loss: float) -> None:
    scene = Scene(kind, arm=True)
    assert scene.run(Faults(loss=loss, seed=3)) == "finished"
    assert not scene.mock.armed
    assert list(dict.fromkeys(scene.commands)) == [ARM, START]
    record, track = scene.watch.seen.record(), fly(a_mission(12))
    assert (np.diff(record.t) > 0).all()
    assert heights(record).max() == pytest.approx(track.position[:, 2].max(), abs=0.5)
    assert heights(record)[-1] < 5
    if not loss:
        assert np.diff(record.t).max() == pytest.approx(0.2, abs=0.06)


@KINDS
def test_without_arm_it_only_watches(kind: str) -> None:
    for begin in (8.0, 1e9):
        scene = Scene(kind)
        events = [(begin, scene.does(MavCommand.ARM, 1)), (begin + 1, scene.does(MavCommand.START))]
        assert scene.run(events=events) == ("finished" if begin < 300 else "")
        assert scene.orders == []
    scene = Scene(kind)
    events = [(2.0, scene.does(MavCommand.ARM, 1)), (3.0, scene.does(MavCommand.START))]
    assert scene.run(events=[*events, (12.0, scene.watch.cancel)]) == "left"
    assert scene.orders == []


@KINDS
@LOSSES
def test_a_pilot_has_the_aircraft_for_good(kind: str, loss: float) -> None:
    scene = Scene(kind, arm=True)
    sent: list[int] = []
    events = [
        (12.0, scene.sets(LOITER)),
        (14.0, lambda _: sent.append(len(scene.orders))),
        (20.0, scene.sets(AUTO[kind])),  # back to the mission: it stays the pilot's flight
        (30.0, scene.sets(HOLD[kind])),
        (40.0, scene.does(MavCommand.ARM, 0)),
    ]
    assert scene.run(Faults(loss=loss, seed=1), events=events) == "taken over"
    assert len(scene.orders) == sent[0]
    assert scene.told("the pilot or a failsafe has the aircraft; nothing more is sent")
    assert scene.watch.seen.fixes[-1].t > 35


def test_a_pilot_who_is_quicker_than_the_start() -> None:
    """The answer to arming is lost, and the pilot changes the mode."""
    scene = Scene("ardupilot", arm=True)
    scene.loses(lambda message, now: arms(message) and [scene.sets(LOITER)(now)], heard=True)
    assert scene.run(until=30.0) == ""
    assert scene.watch.phase == "aside"
    assert {*scene.commands} == {ARM}


@KINDS
@LOSSES
def test_interrupted_it_holds_and_interrupted_again_it_leaves(kind: str, loss: float) -> None:
    scene, modes = Scene(kind, arm=True), list[int]()
    events = [
        (12.0, scene.interrupt),
        (25.0, lambda _: modes.append(scene.mock.mode)),
        (26.0, scene.interrupt),
    ]
    assert scene.run(Faults(loss=loss, seed=2), events=events) == "left"
    assert modes == [HOLD[kind]]
    assert scene.mock.armed
    assert scene.told("it holds")


@KINDS
def test_outages_are_told_and_survived(kind: str) -> None:
    scene = Scene(kind, arm=True)
    faults = Faults(outages=((10.0, 12.0), (15.0, 24.0)))
    assert scene.run(faults) == "finished"
    assert scene.told("heard again after 9 s")
    assert sum("nothing heard for 5 s" in text for text in scene.watch.seen.told) == 1
    assert Scene(kind, arm=True).run(Faults(outages=((12.0, 1e9),))) == "lost"


@KINDS
def test_what_becomes_another_flight_ends_it(kind: str) -> None:
    scene = Scene(kind, arm=True)
    assert scene.run(events=[(12.0, lambda now: scene.mock.reboot(now))]) == "rebooted"
    for arm in (False, True):  # an item of its mission is changed underneath
        scene = Scene(kind, arm=arm)
        rows = list(scene.mock.lists.items(MissionType.MISSION))
        rows[5] = rows_for(kind, 12, shift=1e-4)[5]

        def change(_: float, scene: Scene = scene, rows: Any = rows) -> None:
            scene.mock.lists.replace(MissionType.MISSION, rows)

        assert scene.run(events=[(9.0, change)]) == "changed"
    scene = Scene(kind)
    scene.mock.lists.replace(MissionType.MISSION, rows_for(kind, 12)[:-2])
    assert scene.run() == "changed"
    scene = Scene("ardupilot", arm=True)  # a crash is no end of the mission
    assert scene.run(events=[(12.0, scene.does(MavCommand.ARM, 0))]) == "taken over"


@KINDS
def test_nothing_is_started_beside_another_ground_station(kind: str) -> None:
    for address in (FOREIGN, GROUND_STATION):  # another program of ours too
        scene = Scene(kind, arm=True)
        assert scene.run(others=[Station(AnotherStation(), address)]) == "contested"
        assert scene.orders == []
    scene = Scene(kind, arm=True)
    assert scene.run(others=[Station(AnotherStation(since=10.0), FOREIGN)]) == "finished"
    assert scene.told("another ground station is on this link: system 250, component 190")


def test_it_waits_for_what_the_start_needs_and_says_what_is_missing() -> None:
    for options in ({"kind": "px4", "boot": 20.0}, {"kind": "ardupilot", "place": 20.0}):
        settings, armed = dict[str, Any](options), list[bool]()
        scene = Scene(arm=True, **settings)

        def look(_: float, scene: Scene = scene, armed: list[bool] = armed) -> None:
            armed.append(scene.mock.armed)

        assert scene.run(events=[(19.0, look)]) == "finished"
        assert armed == [False]
        assert scene.commands == [ARM, START]
    for kind, missing in (("px4", "boot"), ("ardupilot", "place")):
        settings = {missing: 1e9}
        scene = Scene(kind, arm=True, **settings)
        assert scene.run() == "refused"
        assert scene.orders == []
    assert scene.watch.outcome.text.endswith("it does not know where it is")
    for command in ((MavCommand.ARM, 1), (MavCommand.SET_CURRENT, 5)):  # it would go on at item 5
        scene = Scene("ardupilot", arm=True)
        assert scene.run(events=[(0.5, scene.does(*command))]) == "refused"
        assert scene.orders == []


def test_a_vehicle_that_does_not_arm_or_start_is_left_as_it_is() -> None:
    scene = Scene("ardupilot", arm=True)
    scene.mock._why_not_armed = lambda: "Compass not healthy"
    assert scene.run() == "refused"
    assert scene.commands == [ARM]
    answer = "the vehicle answers ARM with FAILED (it tried, or checked, and it did not work)"
    assert scene.watch.outcome.text == f"{answer}. It says: Arm: Compass not healthy"
    scene = Scene("px4", arm=True)
    scene.mock._problem = lambda: "no valid mission"
    assert scene.run() == "refused"
    assert list(dict.fromkeys(scene.commands)) == [ARM, START, DISARM]
    denied = "answers START with DENIED (not as it was asked, or in the state that it is in)"
    assert scene.watch.outcome.text == f"the vehicle {denied}; it is disarmed"
    scene = Scene("ardupilot", arm=True)  # it arms without a word
    scene.tells(lambda message, _: () if isinstance(message, CommandAck) else [message])
    assert scene.run() == "refused"
    assert scene.commands == [*[ARM] * 5, DISARM]


def refusing(kind: str, deaf: Callable[[float], bool] = lambda _: False) -> Scene:
    """Return a scene whose vehicle denies the start, and hears no order to disarm while `deaf`."""
    scene = Scene(kind, arm=True)
    scene.loses(lambda message, now: arms(message, 0.0) and deaf(now))
    on, denial = scene.mock.on, CommandAck(GROUND_STATION, MavCommand.START, 4)
    scene.mock.on = lambda envelope, now: (
        [denial] if starts(envelope.message) else on(envelope, now)
    )
    return scene


@KINDS
@pytest.mark.parametrize("loss", [0.0, 0.5])
@pytest.mark.parametrize("until", [0.0, 40.0])
def test_what_does_not_start_is_disarmed_whatever_is_lost(
    kind: str, loss: float, until: float
) -> None:
    scene = refusing(kind, lambda now: now < until)
    assert scene.run(Faults(loss=loss, seed=5)) == "refused"
    assert not scene.mock.armed
    denied = "the vehicle answers START with FAILED (it tried, or checked, and it did not work)"
    mute = ["the vehicle does not answer; it is disarmed"] if loss else []
    assert scene.watch.outcome.text in (f"{denied}; it is disarmed", *mute)
    if not loss:
        asked = scene.commands.count(DISARM)
        assert asked == pytest.approx(max(until - 2, 0) / 1.5 + 1, abs=1)


def test_a_late_answer_to_arming_is_none_to_disarming() -> None:
    scene = refusing("ardupilot", lambda now: now < 10.0)

    def answer(now: float) -> None:
        ack = CommandAck(GROUND_STATION, MavCommand.ARM, 0)
        scene.client.on(Envelope(VEHICLE, ack), now)

    assert scene.run(events=[(3.0, answer), (3.1, answer)]) == "refused"
    assert not scene.mock.armed


@KINDS
def test_what_stays_armed_is_left_to_a_pilot_or_told(kind: str) -> None:
    scene = refusing(kind, lambda _: True)
    assert scene.run(events=[(6.0, scene.sets(LOITER))]) == "refused"
    assert "it may still be armed: the pilot or a failsafe has it" in scene.watch.outcome.text
    assert scene.commands.count(DISARM) == 3
    scene = refusing(kind)  # it keeps refusing
    arm = scene.mock._arm
    scene.mock._arm = lambda wanted, now: arm(True, now) if wanted else 4
    assert scene.run() == "refused"
    assert "it may still be armed: it answers ARM with FAILED" in scene.watch.outcome.text
    assert scene.commands.count(DISARM) == 5
    scene = refusing(kind, lambda _: True)
    assert scene.run(Faults(outages=((4.0, 1e9),))) == "refused"
    assert scene.watch.outcome.text.endswith("may still be armed: nothing was heard for 60 s")


@pytest.mark.parametrize("again", [False, True])
def test_interrupted_while_it_arms_it_is_disarmed(again: bool) -> None:
    scene = Scene("px4", arm=True)
    scene.loses(lambda message, _: arms(message, 1.0), heard=True)
    scene.loses(lambda message, _: again and arms(message, 0.0))
    events = [(3.0, scene.interrupt), *([(9.0, scene.interrupt)] if again else [])]
    assert scene.run(events=events) == "left"
    assert scene.mock.armed == again
    told = "may still be armed: interrupted again" if again else "is disarmed"
    assert scene.watch.outcome.text == f"interrupted before the start; it {told}"


def test_a_mission_that_changes_while_it_is_started_is_disarmed() -> None:
    scene = Scene("px4", arm=True)
    rows = scene.mock.lists.items(MissionType.MISSION)

    def changes(message: object, _: float) -> bool:
        """Hold another mission as soon as it is armed, and say nothing to the start."""
        if starts(message):
            scene.mock.lists.replace(MissionType.MISSION, rows[:-1])
        return starts(message)

    scene.loses(changes)
    assert scene.run() == "changed"
    assert not scene.mock.armed


@KINDS
def test_a_mission_outlives_the_terminal(kind: str) -> None:
    """Nothing is sent: the flight is the autopilot's."""
    scene, modes = Scene(kind, arm=True), list[int]()
    assert scene.run(events=[(20.0, scene.hang_up)]) == "left"
    assert {*scene.commands} == {ARM, START}
    assert "the terminal has gone; the vehicle goes on in mode" in scene.watch.outcome.text
    mock, now = scene.mock, 20.0
    while mock.armed and now < 300:
        now += 0.1
        mock.tick(now)
        modes.append(mock.mode)
    assert not mock.armed
    assert {AUTO[kind]} <= set(modes) <= {AUTO[kind], 4 << 16 | 5 << 24}  # PX4's return
    assert heights(scene.watch.seen.record()).max() > 20


@KINDS
def test_a_terminal_that_goes_before_the_start_takes_the_start_along(kind: str) -> None:
    scene = Scene(kind, arm=True, boot=20.0)
    assert scene.run(events=[(5.0, scene.hang_up)]) == "left"
    assert scene.orders == []
    scene = refusing(kind)
    scene.loses(lambda message, _: arms(message, 1.0), heard=True)
    assert scene.run(events=[(3.0, scene.hang_up)]) == "left"
    assert not scene.mock.armed
    scene = Scene(kind, arm=True)  # a hold that was asked for is waited for
    assert scene.run(events=[(12.0, scene.interrupt), (12.1, scene.hang_up)]) == "left"
    assert scene.mock.mode == HOLD[kind]
    assert scene.watch.outcome.text.startswith("the terminal has gone; the vehicle is in mode ")


@KINDS
def test_a_mission_that_ends_in_the_air_is_over_when_it_is_complete(kind: str) -> None:
    hovering = Mission(a_mission(12).items[:-1], HOME)
    scene = Scene(kind, hovering, arm=True, lands=False)
    assert scene.run() == "finished"
    assert scene.mock.armed


@LOSSES
def test_a_return_has_a_mode_of_its_own_and_is_the_missions(loss: float) -> None:
    scene = Scene("px4", arm=True)
    modes: set[int] = set()
    events: list[tuple[float, Any]] = [(115.0, lambda _: modes.add(scene.mock.mode))]
    assert scene.run(Faults(loss=loss, seed=4), events=events) == "finished"
    assert modes == {4 << 16 | 5 << 24}
    scene = Scene("px4", arm=True)
    events = [(12.0, scene.sets(4 << 16 | 5 << 24)), (30.0, scene.does(MavCommand.ARM, 0))]
    assert scene.run(Faults(loss=loss, seed=4), events=events) == "taken over"
