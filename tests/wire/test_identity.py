"""Who is meant and who speaks: one autopilot at one address, and a station of its own number."""

import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common
from stations import HOME, VEHICLE, Air, Desk, a_mission, hurry, rows_for
from test_client import logged

from faao_mav.errors import LinkError
from faao_mav.fly.fly import fly_mission
from faao_mav.fly.preflight import Flight
from faao_mav.sim import MockAutopilot, behaviour_of
from faao_mav.wire import download, upload
from faao_mav.wire.client import holdings
from faao_mav.wire.codec import Codec, message_id, sender_of
from faao_mav.wire.discover import Heard, choose, discover
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import CommandLong, Envelope, Heartbeat, Message, Statustext
from faao_mav.wire.protocol import (
    AIRFRAMES,
    GROUND_STATION,
    HOME_POSITION,
    POSITION,
    Address,
    MavCommand,
    MissionType,
)

COPTER, ARDUPILOT, ARMED = 2, 3, 128
BEAT = Heartbeat(COPTER, ARDUPILOT, 0, 0, 3)
COMPANION = Address(1, 191)
HERE, ELSEWHERE = "192.0.2.1:14550", "192.0.2.7:14550"


TO = "udpin:0.0.0.0:1"
"""Where the tests' air is, not sockets."""


def a_mock(make: type[MockAutopilot] = MockAutopilot, **options: Any) -> MockAutopilot:
    return make(behaviour_of("ardupilot"), home=HOME, beat=0.1, **options)


# ---- which component is the autopilot


Beat = tuple[float, Address, Heartbeat]


def heard(*beats: Beat, **options: Any) -> tuple[Heard, float]:
    """Return what is found by what is heard at which times, and when."""
    desk = Desk(Script(discover(**{"patience": 10.0, **options})))
    desk.start()
    for when, sender, beat in sorted(beats, key=lambda each: each[0]):
        desk.wait(when - desk.now)
        desk.tell(beat, sender)
    while desk.machine.outcome is None:
        desk.wait(desk.machine.deadline - desk.now)
    return desk.machine.outcome, desk.now


def found(*beats: Beat, **options: Any) -> list[tuple[Address, bool]]:
    """Return who is found, and whether it is armed."""
    return [(each.address, each.armed) for each in heard(*beats, **options)[0].vehicles]


def test_what_does_not_fly_is_no_autopilot_and_its_flag_arms_nothing() -> None:
    """It says so all the time, in the vehicle's own name even."""
    for component in (1, 154):
        for kind in set(range(60)) - AIRFRAMES:
            beside = Heartbeat(kind, (0, 3, 8, 12)[kind % 4], ARMED, 0, 4)
            beats = [(step / 2, Address(1, component), beside) for step in range(8)]
            assert found(*beats, (1.0, VEHICLE, BEAT)) == [(VEHICLE, False)]
            assert found(*beats, system=1, component=component) == []
    armed = Heartbeat(COPTER, ARDUPILOT, ARMED, 0, 4)
    assert found((0.1, VEHICLE, armed), (0.5, VEHICLE, BEAT)) == [(VEHICLE, True)]


@given(
    st.lists(st.tuples(st.floats(0, 9), st.integers(2, 255), st.sampled_from(sorted(AIRFRAMES)))),
    st.floats(0, 9),
    st.sampled_from([None, 1]),
)
def test_component_1_is_it_whoever_else_says_so_and_whenever(
    others: list[tuple[float, int, int]], when: float, system: int | None
) -> None:
    """Another component is it only where it is given."""
    beats = [(t, Address(1, number), Heartbeat(kind, 0, ARMED, 0, 4)) for t, number, kind in others]
    beats.append((when, VEHICLE, BEAT))
    assert found(*beats, system=system) == [(VEHICLE, False)]
    assert heard(*beats, system=system)[1] <= when + 1.5
    asked: dict[str, Any] = {"system": 1, "component": 191}
    assert found((0.5, COMPANION, BEAT), **asked) == [(COMPANION, False)]
    assert heard((0.5, COMPANION, BEAT), **asked)[1] == 0.5


def test_who_cannot_be_meant_is_said_in_a_line() -> None:
    crowd = [(0.5, Address(system, 1), BEAT) for system in range(255)]
    meant = [(0.1, Address(9, 154), Heartbeat(26, 8, 0, 0, 4)), (0.2, VEHICLE, BEAT)]
    cases: list[tuple[int | None, list[Beat], str]] = [
        (None, crowd, "several .*; and 250 more"),
        (9, meant, r"9 within 1 s; there is only MAV_TYPE 26 .system 9, component 154.; ArduPilot"),
        (9, [], r"no heartbeat of the autopilot of system 9 within 1 s; is it switched on"),
    ]
    for number, autopilot, name in ((10, 3, "ArduPilot"), (22, 12, "PX4"), (0, 12, "PX4")):
        beat = (0.5, VEHICLE, Heartbeat(number, autopilot, 0, 0, 3))
        cases.append((1, [beat], f"{name} vehicle of MAV_TYPE {number} .* not supported"))
    for system, beats, told in cases:
        outcome, _ = heard(*beats, patience=1.0, system=system)
        with pytest.raises(LinkError, match=told) as caught:
            choose(outcome, "udpin:0.0.0.0:14550", system, None, 1.0)
        assert len(str(caught.value)) < 500


# ---- two vehicles of one number


def in_the_air(
    monkeypatch: pytest.MonkeyPatch, vehicles: dict[str, MockAutopilot], *, echo: bool = False
) -> Air:
    """Have links lead to `vehicles`, by where they are: each says a heartbeat and its answer.

    With an `echo` what is sent comes back, as from a router. Time passes while nothing is said.
    """
    clock = [time.monotonic()]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    monkeypatch.setattr("time.sleep", lambda seconds: clock.append(clock.pop() + seconds))
    station, codecs = Codec(GROUND_STATION), defaultdict[str, Codec](lambda: Codec(VEHICLE))

    def says(data: bytes | None) -> list[tuple[bytes, str]]:
        heard = [each.envelope for each in station.parse(data or b"") if each.envelope]
        told = [(data, "127.0.0.1:9")] if echo and data else []
        for origin, mock in vehicles.items():
            answers = [*mock.tick(now := time.monotonic())]
            for envelope in heard:
                answers += mock._heartbeat(), *mock.on(envelope, now)
            told += [(codecs[origin].pack(each), origin) for each in answers]
        return told

    air = Air(says)
    monkeypatch.setattr("faao_mav.wire.link.open_transport", lambda _: air)
    return air


def test_two_vehicles_of_one_number_are_not_one(monkeypatch: pytest.MonkeyPatch) -> None:
    vehicles = {HERE: a_mock(), ELSEWHERE: a_mock()}
    in_the_air(monkeypatch, vehicles)
    told = f"system 1, component 1 is heard from {HERE} and {ELSEWHERE}: more than"
    for job in (
        lambda: upload(a_mission(5), TO),
        lambda: fly_mission(Flight(a_mission(5)), TO, arm=True, system=1),
        lambda: download(TO),
    ):
        with pytest.raises(LinkError, match=told):
            job()
    assert [(mock.armed, mock.mission().items) for mock in vehicles.values()] == [(False, ())] * 2


def test_nothing_is_started_that_has_a_namesake(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another of its number comes on the air once its mission has been read."""
    mock, other = a_mock(), a_mock()
    mock.lists.replace(MissionType.MISSION, rows_for("ardupilot", 5))
    vehicles = {HERE: mock}
    in_the_air(monkeypatch, vehicles)

    def comes(_: object) -> None:
        vehicles[ELSEWHERE] = other

    flight = Flight(a_mission(5))
    report = fly_mission(flight, TO, arm=True, watching=comes, note=lambda _: None)
    assert report.ending is not None
    assert report.ending.kind == "refused"
    assert f"its number is used by another vehicle too, at {ELSEWHERE}" in report.ending.text
    assert not mock.armed


def test_what_comes_later_from_elsewhere_does_not_count(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A vehicle that is chosen, and then another that answers everything in its name, first."""
    mock, notes = a_mock(rate=0.0), list[str]()
    vehicles = {HERE: mock}
    air = in_the_air(monkeypatch, vehicles)

    def observe(what: str, *_: int) -> None:
        if not what.startswith("listening") and len(vehicles) == 1:
            del vehicles[HERE]
            vehicles.update({ELSEWHERE: a_mock(rate=0.0), HERE: mock})

    log = tmp_path / "x.tlog"
    report = upload(a_mission(5), TO, observe=observe, note=notes.append, log=log)
    assert report.verified
    told = [each.get_srcSystem() for each in logged(log) if each.get_type() == "MISSION_COUNT"]
    assert told.count(1) == 1  # of what it was asked to give, by one vehicle
    assert len(mock.mission().items) == 5
    assert {to for data, to in air.sent if message_id(data) != 111} == {HERE}  # not TIMESYNC
    (note,) = notes
    assert f"packets of system 1, component 1 come from {ELSEWHERE} too, not only from" in note
    assert "If the vehicle's address has changed, begin again" in note


def test_an_address_is_never_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A vehicle whose address changes in the middle is one that says nothing more.

    A real ArduCopter whose power went during a transfer came back at another port.
    """
    vehicles, notes = {HERE: a_mock(rate=0.0)}, list[str]()
    in_the_air(monkeypatch, vehicles)

    def observe(what: str, done: int, _: int) -> None:
        if what.startswith("uploading") and done >= 2 and HERE in vehicles:
            vehicles[ELSEWHERE] = vehicles.pop(HERE)

    hurry(monkeypatch)
    monkeypatch.setattr("faao_mav.wire.jobs.ATTEMPTS", 2)
    report = upload(a_mission(60), TO, observe=observe, note=notes.append)
    assert [part.verdict for part in report.parts] == ["silent"]
    assert f"come from {ELSEWHERE} too, not only from" in notes[0]
    told = f"in its name come from {ELSEWHERE}: begin again if it is there now"
    assert told in report.problems[0]


# ---- who speaks


def test_only_who_flies_is_a_ground_station(monkeypatch: pytest.MonkeyPatch) -> None:
    """A failsafe for the loss of the ground station is neither hidden nor set off by looking on."""
    mission, mock = a_mission(5), a_mock(speedup=10.0)
    air = in_the_air(monkeypatch, {HERE: mock}, echo=True)
    mock.start(time.monotonic())

    def stop(_: object) -> None:
        raise KeyboardInterrupt

    def beats() -> list[bytes]:
        return [packet for packet, _ in air.sent if message_id(packet) == 0]

    assert upload(mission, TO, system=1).verified
    assert download(TO, system=1).home == HOME
    watched = fly_mission(Flight(mission), TO, watching=stop, system=1)
    assert watched.ending is not None
    assert watched.ending.kind == "left"
    assert beats() == []
    flown = fly_mission(Flight(mission), TO, arm=True, system=1)
    assert flown.ending is not None
    assert flown.ending.kind == "finished"  # our own heartbeats come back: they are no other's
    assert {sender_of(packet) for packet, _ in air.sent} == {GROUND_STATION}
    heard = [each.envelope for data in beats() for each in Codec(VEHICLE).parse(data)]
    assert {each.message.type for each in heard if each is not None} == {6}  # type: ignore[attr-defined]
    assert GROUND_STATION.system not in range(250, 256)


def test_a_vehicle_in_flight_is_not_asked_for_its_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not judged, nor kept waiting."""
    mock: Any = MockAutopilot(behaviour_of("px4"), home=HOME, beat=0.1)
    mock.lists.replace(MissionType.MISSION, rows_for("px4", 5))
    mock.flight.armed, mock.flight.aircraft.landed = True, lambda _: False
    air = in_the_air(monkeypatch, {HERE: mock})

    def stop(_: object) -> None:
        raise KeyboardInterrupt

    assert fly_mission(Flight(a_mission(5)), TO, watching=stop).ending is not None
    sent = [each.envelope for data, _ in air.sent for each in Codec(VEHICLE).parse(data)]
    orders = [each.message for each in sent if each and isinstance(each.message, CommandLong)]
    asked = {(each.command, each.param1) for each in orders}
    assert (MavCommand.SET_INTERVAL, POSITION) in asked
    assert (MavCommand.REQUEST_MESSAGE, HOME_POSITION) not in asked


def test_a_vehicle_that_takes_orders_of_one_number_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """ArduPilot with SYSID_ENFORCE, or that bit of MAV_OPTIONS."""

    class Strict(MockAutopilot):
        def _receive(self, envelope: Envelope, now: float) -> Any:
            return super()._receive(envelope, now) if envelope.sender.system == 255 else ()

    air = in_the_air(monkeypatch, {HERE: a_mock(Strict)})
    with monkeypatch.context() as patch:
        hurry(patch)
        report = upload(a_mission(5), TO, system=1)
    assert "orders of only MAV_GCS_SYSID" in report.problems[0]
    assert "--own-system" in report.problems[0]
    assert upload(a_mission(5), TO, system=1, own_system=255).verified
    senders = {sender_of(packet).system for packet, _ in air.sent}
    assert senders == {GROUND_STATION.system, 255}


def test_a_serial_port_that_waits_for_a_heartbeat_is_sent_one() -> None:
    """PX4 1.13 and 1.14 on USB; it is that of no ground station, and only into a silence."""

    for first_word, knocks in ((9.0, [2.0, 3.0, 4.0, 5.0]), (3.5, [2.0, 3.0]), (0.5, [])):
        desk, sent = Desk(Script(discover(patience=6.0, knocks=True))), list[tuple[float, int]]()
        desk.start()
        while desk.machine.outcome is None:
            beats = (each for each in desk.wait(0.5) if isinstance(each, Heartbeat))
            sent += [(desk.now, beat.type) for beat in beats]
            if desk.now == first_word:
                desk.tell(Statustext(6, "booting"))
        assert sent == [(when, 18) for when in knocks]


# ---- MAVLink 1


def test_a_vehicle_of_mavlink_1_is_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says that it is there to whoever sends, and takes no notice of what."""
    beat = common.MAVLink_heartbeat_message(COPTER, ARDUPILOT, 0, 0, 3, 3)
    packet = beat.pack(common.MAVLink(None, 1, 1), force_mavlink1=True)
    air = Air(lambda data: [] if data is None else [(packet, HERE)])
    monkeypatch.setattr("faao_mav.wire.link.open_transport", lambda _: air)
    hurry(monkeypatch)
    (problem,) = upload(a_mission(5), TO, system=1).problems
    assert "it speaks MAVLink 1 only: set its port to MAVLink 2: SERIALn_PROTOCOL 2" in problem


def test_who_writes_mavlink_1_and_reads_2_is_served(monkeypatch: pytest.MonkeyPatch) -> None:
    """ArduPilot with SERIALn_PROTOCOL 1 or PX4 with MAV_PROTO_VER 1."""
    pack = Codec.pack

    def old(codec: Codec, message: Message) -> bytes:
        packet = pack(codec, message)
        if codec.address != VEHICLE:
            return packet
        decoded = common.MAVLink(None).decode(bytearray(packet))
        if hasattr(decoded, "mission_type"):
            decoded.mission_type = 0  # MAVLink 1 has no such field
        return bytes(decoded.pack(common.MAVLink(None, 1, 1), force_mavlink1=True))

    monkeypatch.setattr(Codec, "pack", old)
    in_the_air(monkeypatch, {HERE: a_mock(rate=0.0)})
    assert upload(a_mission(5), TO, system=1).verified
    hurry(monkeypatch)
    held = holdings(TO, system=1)
    assert len(held.mission.items) == 5
    assert held.mission.unread == ("fence", "rally points")  # it cannot say what it answers about
