"""Watching a flight: every end has its name, and nothing is sent that was not asked for."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from mock_flights import fly
from scenes import AnotherStation, Scene
from simulate import Station
from stations import FOREIGN, HOME, VEHICLE, a_mission, rows_for

from faao_mav.mission import Mission
from faao_mav.sim import MockAutopilot
from faao_mav.sim.faults import Faults
from faao_mav.wire.messages import (
    CommandAck,
    CommandLong,
    Envelope,
    Message,
)
from faao_mav.wire.protocol import (
    GROUND_STATION,
    MavCommand,
    MissionType,
)

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
LOSSES = pytest.mark.parametrize("loss", [0.05, 0.2])
AUTO = {"ardupilot": 3, "px4": 4 << 16 | 4 << 24}
HOLD = {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}
LOITER = 5
"""A pilot's mode, of ArduCopter: PX4 knows no such number, and the mock takes any."""


@KINDS
@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2])
def test_armed_started_and_watched_to_the_end(kind: str, loss: float) -> None:
    scene = Scene(kind, arm=True)
    assert scene.run(Faults(loss=loss, seed=3)) == "finished"
    assert not scene.mock.armed
    kinds = [order.command for order in scene.orders if isinstance(order, CommandLong)]
    assert kinds == sorted(kinds, reverse=True)  # 400 arms, then 300 starts
    assert {*kinds} == {MavCommand.ARM, MavCommand.START}
    record, track = scene.watch.seen.record(), fly(a_mission(12))
    assert (np.diff(record.t) > 0).all()
    assert record.height.max() == pytest.approx(track.position[:, 2].max(), abs=0.5)
    assert record.height[-1] < 5
    if not loss:
        assert np.diff(record.t).max() == pytest.approx(0.2, abs=0.06)


@KINDS
def test_without_arm_it_only_watches(kind: str) -> None:
    scene = Scene(kind)
    assert scene.run(until=20.0) == ""
    assert not scene.mock.armed
    scene = Scene(kind)
    events = [(8.0, scene.does(MavCommand.ARM, 1)), (9.0, scene.does(MavCommand.START))]
    assert scene.run(events=events) == "finished"
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
    scene = Scene("ardupilot", arm=True)
    answer = scene.mock.on

    def heedless(envelope: Envelope, now: float) -> Any:
        """Arm, but say nothing about it: the answer is lost, and the pilot changes the mode."""
        message = envelope.message
        if isinstance(message, CommandLong) and message.command == MavCommand.ARM:
            answer(envelope, now)
            scene.sets(LOITER)(now)
            return ()
        return answer(envelope, now)

    scene.mock.on = heedless
    assert scene.run(until=30.0) == ""
    assert scene.watch.phase == "aside"
    assert {order.command for order in scene.orders if isinstance(order, CommandLong)} == {400}


@KINDS
@LOSSES
def test_interrupted_it_holds_and_interrupted_again_it_leaves(kind: str, loss: float) -> None:
    scene = Scene(kind, arm=True)
    modes: list[int] = []

    def interrupt(now: float) -> None:
        scene.client.sent += scene.watch.cancel(now)
        for message in scene.client.sent[-1:]:  # what the link would have sent
            scene.mock.on(Envelope(GROUND_STATION, message), now)

    def look(now: float) -> None:
        modes.append(scene.mock.mode)

    events = [(12.0, interrupt), (25.0, look), (26.0, interrupt)]
    assert scene.run(Faults(loss=loss, seed=2), events=events) == "left"
    assert modes == [HOLD[kind]]
    assert scene.mock.armed
    assert scene.told("it holds")


def test_a_flight_that_was_not_started_here_is_left_at_once() -> None:
    scene = Scene("ardupilot")
    events = [
        (2.0, scene.does(MavCommand.ARM, 1)),
        (3.0, scene.does(MavCommand.START)),
        (12.0, scene.watch.cancel),
    ]
    assert scene.run(events=events) == "left"
    assert scene.orders == []


@KINDS
def test_outages_are_told_and_survived(kind: str) -> None:
    scene = Scene(kind, arm=True)
    deaf: list[bool] = [False]
    tick, on = scene.mock.tick, scene.mock.on
    scene.mock.tick = lambda now: () if deaf[0] and tick(now) else tick(now)
    scene.mock.on = lambda *told: () if deaf[0] else on(*told)

    def switch(_: float) -> None:
        deaf[0] = not deaf[0]

    events = [(time, switch) for time in (10.0, 12.0, 15.0, 24.0)]
    assert scene.run(events=events) == "finished"
    assert scene.told("nothing heard for 5 s")
    assert scene.told("heard again after 9 s")
    assert sum("nothing heard" in text for text in scene.watch.seen.told) == 1


def test_a_vehicle_that_is_never_heard_again_is_lost() -> None:
    scene = Scene("ardupilot", arm=True)

    def vanish(_: float) -> None:
        scene.mock.tick = lambda *_: ()
        scene.mock.on = lambda *_: ()

    assert scene.run(events=[(12.0, vanish)]) == "lost"


@KINDS
def test_a_reboot_ends_it(kind: str) -> None:
    scene = Scene(kind, arm=True)
    assert scene.run(events=[(12.0, lambda now: scene.mock.reboot(now))]) == "rebooted"


@KINDS
def test_nothing_is_started_beside_another_ground_station(kind: str) -> None:
    for address in (FOREIGN, GROUND_STATION):  # another program of ours too
        scene = Scene(kind, arm=True)
        assert scene.run(others=[Station(AnotherStation(), address)]) == "contested"
        assert scene.orders == []
    scene = Scene(kind, arm=True)
    assert scene.run(others=[Station(AnotherStation(since=10.0), FOREIGN)]) == "finished"
    assert scene.told("another ground station is on this link: system 250, component 190")


@KINDS
def test_a_mission_that_is_changed_underneath_ends_it(kind: str) -> None:
    for started in (False, True):
        scene = Scene(kind, arm=started)
        rows = list(scene.mock.lists.items(MissionType.MISSION))
        rows[5] = rows_for(kind, 12, shift=1e-4)[5]

        def change(_: float, scene: Scene = scene, rows: Any = rows) -> None:
            scene.mock.lists.replace(MissionType.MISSION, rows)

        assert scene.run(events=[(9.0, change)]) == "changed"
        scene = Scene(kind)
        shorter = rows_for(kind, 12)[:-2]
        scene.mock.lists.replace(MissionType.MISSION, shorter)
        assert scene.run() == "changed"


def test_it_waits_for_the_checks_and_says_why_they_do_not_pass() -> None:
    scene = Scene("px4", arm=True, boot=20.0)
    assert scene.run() == "finished"
    scene = Scene("px4", arm=True, boot=1e9)
    assert scene.run() == "refused"
    assert scene.orders == []


def test_it_arms_nothing_that_does_not_know_where_it_is() -> None:
    scene = Scene("ardupilot", arm=True, place=20.0)
    armed: list[bool] = []
    assert scene.run(events=[(19.0, lambda _: armed.append(scene.mock.armed))]) == "finished"
    assert armed == [False]
    kinds = [order.command for order in scene.orders if isinstance(order, CommandLong)]
    assert kinds == [MavCommand.ARM, MavCommand.START]
    scene = Scene("ardupilot", arm=True, place=1e9)
    assert scene.run() == "refused"
    assert scene.orders == []
    assert scene.watch.outcome.text.endswith("it does not know where it is")


def test_a_vehicle_that_does_not_arm_or_start_is_left_as_it_is() -> None:
    scene = Scene("ardupilot", arm=True)
    scene.mock._why_not_armed = lambda: "Compass not healthy"
    assert scene.run() == "refused"
    orders = [each for each in scene.orders if isinstance(each, CommandLong)]
    assert [(each.command, each.param1) for each in orders] == [(400, 1.0)] * 5
    answer = "the vehicle answers ARM with FAILED (it tried, or checked, and it did not work)"
    assert scene.watch.outcome.text == f"{answer}. It says: Arm: Compass not healthy"
    scene = Scene("px4", arm=True)
    scene.mock._problem = lambda: "no valid mission"
    assert scene.run() == "refused"
    orders = [each for each in scene.orders if isinstance(each, CommandLong)]
    asked = list(dict.fromkeys((each.command, each.param1) for each in orders))
    assert asked == [(400, 1.0), (300, 0.0), (400, 0.0)]
    denied = "answers START with DENIED (not as it was asked, or in the state that it is in)"
    assert scene.watch.outcome.text == f"the vehicle {denied}; it is disarmed"


def test_a_vehicle_that_arms_without_a_word_is_asked_to_disarm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene, on = Scene("ardupilot", arm=True), MockAutopilot.on

    def mute(mock: MockAutopilot, envelope: Envelope, now: float) -> list[Message]:
        answers = on(mock, envelope, now)
        return [each for each in answers if not isinstance(each, CommandAck)]

    monkeypatch.setattr(MockAutopilot, "on", mute)
    assert scene.run() == "refused"
    orders = [each for each in scene.orders if isinstance(each, CommandLong)]
    assert [(each.command, each.param1) for each in orders] == [(400, 1.0)] * 5 + [(400, 0.0)]


def refuses_to_start(scene: Scene, deaf: Callable[[float], bool] = lambda _: False) -> None:
    """Have the mock deny the start, and hear no order to disarm while it is `deaf`."""
    on = scene.mock.on

    def deny(envelope: Envelope, now: float) -> Any:
        match envelope.message:
            case CommandLong(command=MavCommand.START):
                return [CommandAck(GROUND_STATION, MavCommand.START, 4)]
            case CommandLong(command=MavCommand.ARM, param1=0.0) if deaf(now):
                return ()
        return on(envelope, now)

    scene.mock.on = deny


def disarmings(scene: Scene) -> int:
    orders = (each for each in scene.orders if isinstance(each, CommandLong))
    return sum((each.command, each.param1) == (MavCommand.ARM, 0.0) for each in orders)


@KINDS
@pytest.mark.parametrize("loss", [0.0, 0.5])
@pytest.mark.parametrize("until", [0.0, 40.0])
def test_what_does_not_start_is_disarmed_whatever_is_lost(
    kind: str, loss: float, until: float
) -> None:
    scene = Scene(kind, arm=True)
    refuses_to_start(scene, lambda now: now < until)
    assert scene.run(Faults(loss=loss, seed=5)) == "refused"
    assert not scene.mock.armed
    told = scene.watch.outcome.text
    denied = "the vehicle answers START with FAILED (it tried, or checked, and it did not work)"
    mute = ["the vehicle does not answer; it is disarmed"] if loss else []
    assert told in (f"{denied}; it is disarmed", *mute)
    if not loss:
        assert disarmings(scene) == pytest.approx(max(until - 2, 0) / 1.5 + 1, abs=1)


def test_a_late_answer_to_arming_is_none_to_disarming() -> None:
    scene = Scene("ardupilot", arm=True)
    refuses_to_start(scene, lambda now: now < 10.0)

    def answer(now: float) -> None:
        ack = CommandAck(GROUND_STATION, MavCommand.ARM, 0)
        scene.client.on(Envelope(VEHICLE, ack), now)

    assert scene.run(events=[(3.0, answer), (3.1, answer)]) == "refused"
    assert not scene.mock.armed


@KINDS
def test_what_does_not_start_is_left_to_a_pilot_who_takes_it(kind: str) -> None:
    scene = Scene(kind, arm=True)
    refuses_to_start(scene, lambda _: True)
    assert scene.run(events=[(6.0, scene.sets(LOITER))]) == "refused"
    assert "it may still be armed: the pilot or a failsafe has it" in scene.watch.outcome.text
    assert disarmings(scene) == 3


def test_what_keeps_refusing_to_disarm_or_falls_silent_is_told() -> None:
    scene = Scene("ardupilot", arm=True)
    refuses_to_start(scene)
    arm = scene.mock._arm
    scene.mock._arm = lambda wanted, now: arm(True, now) if wanted else 4
    assert scene.run() == "refused"
    assert scene.watch.outcome.text.endswith(
        "still be armed: it answers ARM with FAILED (it tried, or checked, and it did not work)"
    )
    assert disarmings(scene) == 5
    scene = Scene("ardupilot", arm=True)
    refuses_to_start(scene, lambda _: True)

    def vanish(_: float) -> None:
        scene.mock.tick = lambda *_: ()
        scene.mock.on = lambda *_: ()

    assert scene.run(events=[(4.0, vanish)]) == "refused"
    assert scene.watch.outcome.text.endswith("may still be armed: nothing was heard for 60 s")


@pytest.mark.parametrize("again", [False, True])
def test_interrupted_while_it_arms_it_is_disarmed(again: bool) -> None:
    scene, on = Scene("px4", arm=True), MockAutopilot.on

    def quiet(envelope: Envelope, now: float) -> Sequence[Message]:
        message = envelope.message
        if again and isinstance(message, CommandLong) and message.param1 == 0.0:
            return ()
        arms = isinstance(message, CommandLong) and message.command == MavCommand.ARM
        answers = on(scene.mock, envelope, now)
        return () if arms else answers

    def interrupt(now: float) -> None:
        for message in scene.watch.cancel(now):
            scene.mock.on(Envelope(GROUND_STATION, message), now)

    scene.mock.on = quiet
    events = [(3.0, interrupt), *([(9.0, interrupt)] if again else [])]
    assert scene.run(events=events) == "left"
    assert scene.mock.armed == again
    told = "interrupted before the start; it " + (
        "may still be armed: interrupted again" if again else "is disarmed"
    )
    assert scene.watch.outcome.text == told


def test_a_mission_that_changes_while_it_is_started_is_disarmed() -> None:
    scene = Scene("px4", arm=True)
    refuses_to_start(scene)
    rows, on = scene.mock.lists.items(MissionType.MISSION), scene.mock.on

    def change(envelope: Envelope, now: float) -> Any:
        """Hold another mission as soon as it is armed, and say nothing to the start."""
        message = envelope.message
        if isinstance(message, CommandLong) and message.command == MavCommand.START:
            scene.mock.lists.replace(MissionType.MISSION, rows[:-1])
            return ()
        return on(envelope, now)

    scene.mock.on = change
    assert scene.run() == "changed"
    assert not scene.mock.armed


@KINDS
def test_a_mission_outlives_the_terminal(kind: str) -> None:
    """Nothing is sent: the flight is the autopilot's."""
    scene, modes = Scene(kind, arm=True), list[int]()

    def hang_up(now: float) -> None:
        sent = len(scene.client.sent)
        assert scene.client.hang_up(now) == ()
        assert len(scene.client.sent) == sent

    assert scene.run(events=[(20.0, hang_up)]) == "left"
    assert "the terminal has gone; the vehicle goes on in mode" in scene.watch.outcome.text
    mock, now = scene.mock, 20.0
    while mock.armed and now < 300:
        now += 0.1
        mock.tick(now)
        modes.append(mock.mode)
    assert not mock.armed
    assert {AUTO[kind]} <= set(modes) <= {AUTO[kind], 4 << 16 | 5 << 24}  # PX4's return
    assert scene.watch.seen.record().height.max() > 20


@KINDS
def test_a_terminal_that_goes_before_the_start_takes_the_start_along(kind: str) -> None:
    scene = Scene(kind, arm=True, boot=20.0)
    assert scene.run(events=[(5.0, scene.watch.hang_up)]) == "left"
    assert scene.orders == []
    scene = Scene(kind, arm=True)
    refuses_to_start(scene)
    on = scene.mock.on

    def quiet(envelope: Envelope, now: float) -> Sequence[Message]:
        message, answers = envelope.message, on(envelope, now)
        arms = isinstance(message, CommandLong) and message.command == MavCommand.ARM
        return () if arms else answers

    def hang_up(now: float) -> None:
        for message in scene.watch.hang_up(now):
            scene.mock.on(Envelope(GROUND_STATION, message), now)

    scene.mock.on = quiet
    assert scene.run(events=[(3.0, hang_up)]) == "left"
    assert not scene.mock.armed


def test_a_hold_that_was_asked_for_is_waited_for_without_a_terminal() -> None:
    scene = Scene("ardupilot", arm=True)

    def interrupt(now: float) -> None:
        scene.watch.cancel(now)  # whose order is lost

    events = [(12.0, interrupt), (12.1, scene.watch.hang_up)]
    assert scene.run(events=events) == "left"
    assert scene.mock.mode == HOLD["ardupilot"]
    assert scene.watch.outcome.text == "the terminal has gone; the vehicle is in mode BRAKE"


def test_what_is_armed_already_is_not_started() -> None:
    scene = Scene("ardupilot", arm=True)
    assert scene.run(events=[(0.5, scene.does(MavCommand.ARM, 1))]) == "refused"
    assert scene.orders == []


def test_a_mission_that_would_go_on_in_the_middle_is_not_started() -> None:
    scene = Scene("ardupilot", arm=True)
    assert scene.run(events=[(0.5, scene.does(MavCommand.SET_CURRENT, 5))]) == "refused"
    assert scene.orders == []


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


def test_a_crash_is_no_end_of_the_mission() -> None:
    scene = Scene("ardupilot", arm=True)
    assert scene.run(events=[(12.0, scene.does(MavCommand.ARM, 0))]) == "taken over"
