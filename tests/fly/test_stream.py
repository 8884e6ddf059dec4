"""Flights by setpoints: the plan is kept, and nothing is sent once somebody else flies."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited
from flight_logs import heights
from hypothesis import given
from hypothesis import strategies as st
from scenes import AnotherStation, Scene, starts
from simulate import Station
from stations import FOREIGN, HOME, a_mission, peer_of, vehicle_of

from faao_mav import optimize, parse_plan
from faao_mav.autopilot import vehicle_type
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
from faao_mav.wire.messages import SetPositionTargetLocalNed, Timesync
from faao_mav.wire.parameters import Reading
from faao_mav.wire.protocol import MavCommand
from faao_mav.wire.transfer.exchange import Peer

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
LOITER = 5
"""A pilot's mode, of ArduCopter: PX4 knows no such number, and the mock takes any."""
LAND = 4 << 16 | 6 << 24
"""PX4's."""
HOLD = {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}
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
    return optimize(parse_plan(edited(FLYABLE, LOW)))


def under(changes: dict[str, Any]) -> Solution:
    """Return the same flight for a plan that has what does not change it otherwise."""
    return replace(low(), problem=build_problem(parse_plan(edited(FLYABLE, LOW | changes))))


def flown(scene: Scene, solution: Solution) -> Prediction:
    """Return what became of the plan, on its own clock."""
    line = scene.watch.seen.record().line(solution)
    return price_flight(solution, line.t - scene.watch.relay_start, line.w)


def is_setpoint(message: object) -> bool:
    return isinstance(message, SetPositionTargetLocalNed)


def setpoints(scene: Scene) -> list[SetPositionTargetLocalNed]:
    return [each for each in scene.client.sent if isinstance(each, SetPositionTargetLocalNed)]


@pytest.mark.parametrize(("kind", "loss"), [("ardupilot", 0.0), ("px4", 0.0), ("px4", 0.2)])
def test_a_plan_is_kept_in_time(kind: str, loss: float) -> None:
    solution, scene = low(), Scene(kind, solution=low())
    assert scene.run(Faults(loss=loss, seed=3)) == "finished"
    assert not scene.mock.armed
    found = flown(scene, solution)
    assert found.rms_position_error < (0.3 if not loss else 0.6)
    assert found.delivered_rate > 0.997 * solution.delivered_rate
    record, begin = scene.watch.seen.record(), scene.watch.relay_start
    during = (record.t > begin) & (record.t < begin + solution.plan.flight.duration)
    np.testing.assert_allclose(heights(record)[during], 6, atol=0.2)
    steps = np.diff([each.time_boot_ms for each in setpoints(scene)])
    assert steps.min() >= 80
    assert loss or steps.max() <= 120
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


@pytest.mark.parametrize(
    ("kind", "action", "told"),
    [
        ("ardupilot", 0, "it stops after 1 s (GUID_TIMEOUT)"),
        ("px4", 3, "it changes to Return after 1 s"),
        ("px4", 0, "it changes to Position (and sinks, unless sticks fly it) after 1 s"),
    ],
)
def test_what_it_does_when_setpoints_cease_is_told_before(
    kind: str, action: int, told: str
) -> None:
    scene = Scene(kind, solution=low(), parameters={"COM_OBL_RC_ACT": action})
    scene.loses(lambda message, now: is_setpoint(message) and now > 16.0)
    assert scene.run(events=[(60.0, scene.does(MavCommand.ARM, 0))]) == "taken over"
    (lost,) = (each for each in scene.watch.findings if each.rule == "on-setpoints-lost")
    assert lost.message.startswith(f"setpoints lost: {told}")
    assert scene.told("its failsafe, until setpoints come again") == (action == 3)
    record = scene.watch.seen.record()
    if kind == "ardupilot":
        late = record.line(low()).w[(record.t > 20.0) & (record.t < 59.0)]
        assert np.ptp(late, axis=0).max() < 0.1
    else:
        assert heights(record)[-1] == pytest.approx(0.0, abs=0.1)


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
        (17.0, scene.sets(HOLD["px4"]) if pilot else lambda _: None),
        (22.0, lambda _: sent.append(len(scene.orders))),
        (27.0, scene.sets(LAND) if pilot else lambda _: None),
    ]
    assert scene.run(Faults(outages=((16.0, 18.5),), seed=1), events=events) == ending
    assert (len(scene.orders) > sent[0]) == (ending == "finished")
    assert scene.told("its failsafe") == (ending == "finished")


@KINDS
def test_it_is_not_started_where_it_must_not_be(kind: str) -> None:
    away = under({"site.origin.latitude": HOME.latitude + 0.001})
    others = [Station(AnotherStation(), FOREIGN)]
    for solution, ending, beside in ((low(), "contested", others), (away, "refused", [])):
        scene = Scene(kind, solution=solution)
        assert scene.run(others=beside) == ending
        assert scene.orders == []
    assert "111 m from the mission's home" in scene.watch.outcome.text
    peer = peer_of("ardupilot")
    plane = Peer(peer.own, peer.address, vehicle_type("ardupilot", "plane"))
    ready = Readiness(Flight(a_mission(5)), Held({}, Reading({})), plane)
    with pytest.raises(InputError, match="only copters"):
        Stream(plane, low(), ready)


@KINDS
def test_a_pilot_may_have_the_mission_flown_instead(kind: str) -> None:
    scene = Scene(kind, solution=low())
    assert scene.run(events=[(18.0, scene.sets(scene.watch._modes.mission))]) == "taken over"
    record = scene.watch.seen.record()
    last = scene.mock.mission().items[-2]
    path = LocalFrame(last.x, last.y).to_local(record.latitude, record.longitude)
    assert np.linalg.norm(path, axis=1).min() < 1
    assert not scene.mock.armed


@KINDS
def test_interrupted_it_holds(kind: str) -> None:
    returns = {"COM_OBL_RC_ACT": 3}
    scene, modes = Scene(kind, solution=low(), parameters=returns), list[int]()
    events = [
        (16.0, scene.interrupt),
        (20.0, lambda _: modes.append(scene.mock.mode)),
        (21.0, scene.interrupt),
    ]
    assert scene.run(events=events) == "left"
    asks = [getattr(each, "command", None) == MavCommand.SET_MODE for each in scene.orders]
    last = max(n for n, asked in enumerate(asks) if asked)
    assert not any(map(is_setpoint, scene.orders[last:]))
    assert modes == [HOLD[kind]]
    for time in (8.0, 14.0):  # without a terminal too
        scene = Scene(kind, solution=low(), parameters=returns)
        assert scene.run(events=[(time, scene.hang_up)]) == "left"
        assert scene.mock.armed
        assert scene.mock.mode == HOLD[kind]
        assert scene.watch.outcome.text.startswith("the terminal has gone; the vehicle is in mode ")


def test_a_lost_answer_to_the_take_off_does_not_end_it() -> None:
    scene = Scene("ardupilot", solution=low())
    scene.loses(lambda message, _: starts(message), heard=True)
    assert scene.run(until=30.0) == ""
    assert scene.watch.phase == "flying"
    assert scene.watch.relay_start is not None


@pytest.mark.parametrize("finish", ["rtl", "hover"])
def test_it_ends_as_the_plan_says_inside_its_fence(finish: str) -> None:
    solution = under({"mission.on_finish": finish, "fence": FENCE})
    scene = Scene("ardupilot", solution=solution)
    assert scene.run() == "finished"
    assert scene.mock.armed == (finish == "hover")
    record, area = scene.watch.seen.record(), solution.plan.keep_in
    assert area is not None
    path = record.line(solution).w
    assert np.linalg.norm(path[-1] - (solution.w[-1] if finish == "hover" else 0)) < 1
    assert heights(record)[-1] == pytest.approx(6 if finish == "hover" else 0, abs=1)
    first = int(np.argmax(heights(record) > 5.9))
    assert area.inside(1.0).covers(path[first:][heights(record)[first:] > 1]).all()
    velocity = solution.v.copy()
    velocity[0] = [20, 0]  # its run-in begins west of the fence
    with pytest.raises(InfeasibleError, match="fence"):
        Scene("ardupilot", solution=replace(solution, v=velocity))


def test_the_mock_is_late_in_a_wind_that_is_too_strong() -> None:
    scene = Scene("ardupilot", solution=low(), wind=(0.0, 9.0))  # it flies south
    assert scene.run() == "finished"
    assert flown(scene, low()).rms_position_error > 3


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
