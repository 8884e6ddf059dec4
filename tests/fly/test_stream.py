"""Flights by setpoints: the plan is kept, and nothing is sent once somebody else flies."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited
from hypothesis import given
from hypothesis import strategies as st
from scenes import AnotherStation, Scene
from simulate import Station
from stations import FOREIGN, HOME, a_mission, peer_of, vehicle_of

from faao_mav import optimize, parse_plan
from faao_mav.autopilot import vehicle_type
from faao_mav.autopilot.px4 import px4_mode
from faao_mav.errors import InfeasibleError, InputError
from faao_mav.fly.own import OwnClock
from faao_mav.fly.readiness import Readiness
from faao_mav.fly.seen import Flight, Held
from faao_mav.fly.stream import Stream
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.prediction import Prediction, price_flight
from faao_mav.sim.faults import Faults
from faao_mav.wire.messages import CommandLong, Envelope, SetPositionTargetLocalNed, Timesync
from faao_mav.wire.parameters import Reading
from faao_mav.wire.protocol import GROUND_STATION, MavCommand
from faao_mav.wire.transfer.exchange import Peer

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
LOITER = 5
"""A pilot's mode, of ArduCopter: PX4 knows no such number, and the mock takes any."""
FENCE = {
    "margin": 2,
    "inclusion": [[-30, -30], [80, -30], [80, 80], [-30, 80]],
    "exclusion": [{"polygon": [[-5, 20], [20, 20], [20, 30], [-5, 30]]}],
}
LOW: dict[str, Any] = {
    "flight.start_velocity": "hover",
    "flight.end_velocity": "hover",
    "flight.altitude": 6,
    "flight.duration": 16,
    "vehicle.max_speed": 6,
    "vehicle.max_acceleration": 2.5,
    "mission.on_finish": "land",
}


@cache
def low() -> Solution:
    """Return the small plan solved: 16 s at up to 6 m/s, 6 m above home."""
    return solved({})


def solved(changes: dict[str, Any]) -> Solution:
    return optimize(parse_plan(edited(FLYABLE, LOW | changes)))


def under(changes: dict[str, Any]) -> Solution:
    """Return the same flight for a plan that has what does not change it otherwise."""
    return replace(low(), problem=build_problem(parse_plan(edited(FLYABLE, LOW | changes))))


def flown(scene: Scene, solution: Solution) -> Prediction:
    """Return what became of the plan, on its own clock."""
    line = scene.watch.seen.record().line(solution)
    return price_flight(solution, line.t - scene.watch.relay_start, line.w)


def setpoints(scene: Scene) -> list[SetPositionTargetLocalNed]:
    return [each for each in scene.client.sent if isinstance(each, SetPositionTargetLocalNed)]


@pytest.mark.parametrize(("kind", "loss"), [("ardupilot", 0.0), ("px4", 0.0), ("px4", 0.2)])
def test_a_plan_is_kept_in_time(kind: str, loss: float) -> None:
    solution = low()
    scene = Scene(kind, solution=solution)
    assert scene.run(Faults(loss=loss, seed=3)) == "finished"
    assert not scene.mock.armed
    found = flown(scene, solution)
    assert found.rms_position_error < (0.3 if not loss else 0.6)
    assert found.delivered_rate > 0.997 * solution.delivered_rate
    record = scene.watch.seen.record()
    begin = scene.watch.relay_start
    during = (record.t > begin) & (record.t < begin + solution.plan.flight.duration)
    np.testing.assert_allclose(record.height[during], 6, atol=0.2)
    sent = [each.time_boot_ms for each in setpoints(scene)]
    assert np.diff(sent).min() >= 80
    if not loss:
        assert np.diff(sent).max() <= 120
    assert {each.type_mask for each in setpoints(scene)} == {3072}


@pytest.mark.parametrize(("kind", "time"), [("ardupilot", 18.0), ("px4", 8.0), ("px4", 18.0)])
def test_nothing_is_sent_after_a_pilots_mode_change(kind: str, time: float) -> None:
    scene = Scene(kind, solution=low())
    guided, sent = scene.watch._guided, list[int]()
    events = [
        (time, scene.sets(LOITER)),  # on the way up, or in the relay flight
        (time + 1.5, lambda _: sent.append(len(scene.orders))),
        (time + 4.0, scene.sets(guided)),  # back: it stays the pilot's
        (time + 7.0, scene.does(MavCommand.ARM, 0)),
    ]
    assert scene.run(events=events) == "taken over"
    assert setpoints(scene)
    assert len(scene.orders) == sent[0]
    assert scene.told("nothing more is sent")


@KINDS
def test_it_stops_when_setpoints_cease(kind: str) -> None:
    scene = Scene(kind, solution=low(), parameters={"COM_OBL_RC_ACT": 3.0})
    receive = scene.mock.on
    deaf, at = [False], list[Any]()

    def hear(envelope: Any, now: float) -> Any:
        setpoint = isinstance(envelope.message, SetPositionTargetLocalNed)
        return () if deaf[0] and setpoint else receive(envelope, now)

    scene.mock.on = hear

    def cease(_: float) -> None:
        deaf[0] = True

    def look(now: float) -> None:
        at.append(scene.mock.posture(now))

    events = [(14.0, cease), (26.0, look), (27.0, look)]
    words = (
        "stops after 1 s (GUID_TIMEOUT)" if kind == "ardupilot" else "changes to Return after 1 s"
    )
    ending = scene.run(events=events, until=90.0)
    (lost,) = (each for each in scene.watch.findings if each.rule == "on-setpoints-lost")
    assert lost.message.startswith(f"setpoints lost: it {words}")
    if kind == "ardupilot":
        assert np.linalg.norm(at[1].position - at[0].position) < 0.1
    else:
        assert ending == "taken over"
        assert scene.told("its failsafe, until setpoints come again")


@pytest.mark.parametrize(
    ("action", "pilot", "ending"),
    [(5, False, "finished"), (5, True, "taken over"), (0, False, "taken over")],
)
def test_an_outage_on_px4_ends_the_setpoints_only_where_somebody_may_fly(
    action: int, pilot: bool, ending: str
) -> None:
    """COM_OBL_RC_ACT 5 is Hold, 0 Position, by sticks; the pilot, too, sets Hold meanwhile."""
    scene, sent = Scene("px4", solution=low(), parameters={"COM_OBL_RC_ACT": action}), list[int]()
    events = [
        (15.0, scene.sets(px4_mode(4, 3)) if pilot else lambda _: None),
        (20.0, lambda _: sent.append(len(scene.orders))),
        (25.0, scene.sets(px4_mode(4, 6)) if pilot else lambda _: None),
    ]
    assert scene.run(Faults(outages=((14.0, 16.5),), seed=1), events=events) == ending
    assert (len(scene.orders) > sent[0]) == (ending == "finished")
    assert scene.told("its failsafe") == (ending == "finished")


def test_without_setpoints_or_sticks_px4_sinks_in_position() -> None:
    scene = Scene("px4", solution=low())
    receive = scene.mock.on

    def hear(envelope: Any, now: float) -> Any:
        ceased = isinstance(envelope.message, SetPositionTargetLocalNed) and now > 14.0
        return () if ceased else receive(envelope, now)

    scene.mock.on = hear
    modes = list[int]()
    events = [(16.0, lambda _: modes.append(scene.mock.mode))]
    assert scene.run(events=events, until=90.0) == "taken over"
    told = "setpoints lost: it changes to Position (and sinks, unless sticks fly it) after 1 s"
    assert any(each.message.startswith(told) for each in scene.watch.findings)
    assert modes == [px4_mode(3, 0)]
    assert scene.watch.seen.height == pytest.approx(0.0, abs=0.1)


@KINDS
def test_it_is_not_started_where_it_must_not_be(kind: str) -> None:
    scene = Scene(kind, solution=low())
    assert scene.run(others=[Station(AnotherStation(), FOREIGN)]) == "contested"
    assert scene.orders == []
    scene = Scene(kind, solution=low())
    assert scene.run(events=[(0.5, scene.does(MavCommand.ARM, 1))]) == "refused"
    assert scene.orders == []
    away = under({"site.origin.latitude": HOME.latitude + 0.001})
    scene = Scene(kind, solution=away)
    assert scene.run() == "refused"
    assert scene.orders == []
    assert "111 m from the mission's home" in scene.watch.outcome.text


@KINDS
def test_a_pilot_may_have_the_mission_flown_instead(kind: str) -> None:
    scene = Scene(kind, solution=low())
    assert scene.run(events=[(18.0, scene.sets(scene.watch._modes.mission))]) == "taken over"
    record = scene.watch.seen.record()
    steps = np.linalg.norm(np.diff(record.line(low()).w, axis=0), axis=1)
    assert steps.max() < 1.5  # 10 m/s, ten times a second: it jumps nowhere
    last = scene.mock.mission().items[-2]
    path = LocalFrame(last.x, last.y).to_local(record.latitude, record.longitude)
    assert np.linalg.norm(path, axis=1).min() < 1
    assert not scene.mock.armed


@KINDS
def test_interrupted_it_holds(kind: str) -> None:
    scene, modes = Scene(kind, solution=low()), list[int]()

    def interrupt(now: float) -> None:
        for message in scene.watch.cancel(now):
            scene.client.sent.append(message)
            scene.mock.on(Envelope(GROUND_STATION, message), now)
        modes.append(scene.mock.mode)

    assert scene.run(events=[(14.0, interrupt), (17.0, interrupt)]) == "left"
    asks = [getattr(each, "command", None) == MavCommand.SET_MODE for each in scene.orders]
    last = max(n for n, asked in enumerate(asks) if asked)
    assert not any(isinstance(each, SetPositionTargetLocalNed) for each in scene.orders[last:])
    assert modes[0] == {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}[kind]


@KINDS
@pytest.mark.parametrize("time", [8.0, 14.0])
def test_without_a_terminal_it_holds_and_then_is_left(kind: str, time: float) -> None:
    scene = Scene(kind, solution=low())

    def hang_up(now: float) -> None:
        for message in scene.watch.hang_up(now):
            scene.mock.on(Envelope(GROUND_STATION, message), now)

    assert scene.run(events=[(time, hang_up)]) == "left"
    assert scene.mock.armed
    assert scene.mock.mode == {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}[kind]
    assert scene.watch.outcome.text.startswith("the terminal has gone; the vehicle is in mode ")


def test_a_lost_answer_to_the_take_off_does_not_end_it() -> None:
    scene = Scene("ardupilot", solution=low())
    receive = scene.mock.on

    def mute(envelope: Any, now: float) -> Any:
        message, answers = envelope.message, receive(envelope, now)
        takes_off = isinstance(message, CommandLong) and message.command == MavCommand.TAKEOFF
        return () if takes_off else answers

    scene.mock.on = mute
    assert scene.run(until=30.0) == ""
    assert scene.watch.phase == "flying"
    assert scene.watch.relay_start is not None


@pytest.mark.parametrize("finish", ["rtl", "hover"])
def test_it_ends_as_the_plan_says(finish: str) -> None:
    solution = under({"mission.on_finish": finish})
    scene = Scene("ardupilot", solution=solution)
    assert scene.run() == "finished"
    assert scene.mock.armed == (finish == "hover")
    record = scene.watch.seen.record()
    last = solution.w[-1] if finish == "hover" else np.zeros(2)
    assert np.linalg.norm(record.line(solution).w[-1] - last) < 1
    assert record.height[-1] == pytest.approx(6 if finish == "hover" else 0, abs=1)


def test_the_ways_out_and_home_keep_the_fence() -> None:
    solution = under({"fence": FENCE, "mission.on_finish": "rtl"})
    scene = Scene("ardupilot", solution=solution)
    assert scene.run() == "finished"
    area = solution.plan.keep_in
    assert area is not None
    record = scene.watch.seen.record()
    high = record.height > 5.9
    first = int(np.argmax(high))
    path = record.line(solution).w[first:][record.height[first:] > 1]
    assert area.inside(1.0).covers(path).all()
    velocity = solution.v.copy()
    velocity[0] = [20, 0]  # its run-in begins west of the fence
    begins_at_speed = replace(solution, v=velocity)
    with pytest.raises(InfeasibleError, match="fence"):
        Scene("ardupilot", solution=begins_at_speed)


def test_the_mock_is_late_in_a_wind_that_is_too_strong() -> None:
    scene = Scene("ardupilot", solution=low(), wind=(0.0, 9.0))  # it flies south
    assert scene.run() == "finished"
    assert flown(scene, low()).rms_position_error > 3


def test_planes_do_not_fly_by_setpoints() -> None:
    peer = peer_of("ardupilot")
    plane = Peer(peer.own, peer.address, vehicle_type("ardupilot", "plane"))
    ready = Readiness(Flight(a_mission(5)), Held({}, Reading({})), plane)
    with pytest.raises(InputError, match="only copters"):
        Stream(plane, low(), ready)


@KINDS
@given(north=st.floats(-5e3, 5e3), east=st.floats(-5e3, 5e3), latitude=st.floats(-60, 60))
def test_local_frames_go_there_and_back(
    kind: str, north: float, east: float, latitude: float
) -> None:
    vehicle = vehicle_of(kind)
    assert vehicle is not None
    frame = vehicle.family.local_frame(latitude, 179.99)
    there = np.array([east, north])
    np.testing.assert_allclose(frame.to_local(*frame.to_geodetic(there)), there, atol=1e-3)
    own = LocalFrame(latitude, 179.99)
    apart = np.linalg.norm(own.to_local(*frame.to_geodetic(there)) - there)
    assert apart <= 0.0075 * np.linalg.norm(there) + 1e-6  # each has another Earth


def test_what_others_asked_tells_nothing_of_the_link() -> None:
    clock = OwnClock()
    for now in (1.0, 2.0, 3.0):
        own = clock.ask(now).ts1
        clock.hear(Timesync(int(2e9 * now), own), now + 0.1)
        clock.hear(Timesync(int(2e9 * now), own - 500_000_000), now + 0.2)  # another station's
    assert clock.speed == pytest.approx(2.0)
    assert clock.lead == pytest.approx(0.2)
