"""Flights by setpoints: the plan is kept, and what no scene can say of streams in trouble."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flight_logs import heights
from hypothesis import given
from hypothesis import strategies as st
from scenes import Scene, is_setpoint, planned, staged, under
from stations import a_mission, peer_of, vehicle_of

from faao_mav.autopilot import vehicle_type
from faao_mav.errors import InfeasibleError, InputError
from faao_mav.fly.preflight import Clearance, Flight
from faao_mav.fly.setpoints import OwnClock
from faao_mav.fly.stream import Stream
from faao_mav.fly.telemetry import Held
from faao_mav.geodesy import LocalFrame
from faao_mav.wire import messages
from faao_mav.wire.parameters import Reading
from faao_mav.wire.transfer import Peer

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
FENCE = {
    "margin": 2,
    "inclusion": [[-30, -30], [80, -30], [80, 80], [-30, 80]],
    "exclusion": [{"polygon": [[-5, 20], [20, 20], [20, 30], [-5, 30]]}],
}


@pytest.mark.parametrize(("kind", "loss"), [("ardupilot", 0.0), ("px4", 0.2)])
def test_a_plan_is_kept_in_time(kind: str, loss: float) -> None:
    solution, scene = planned("low"), staged("low", kind, {"loss": f"{loss}", "seed": "3"})
    assert scene.run() == "finished"
    assert not scene.mock.armed
    record, begin = scene.watch.seen.record(), scene.watch.relay_start
    found = record.line(solution, begin).priced(solution)
    assert found.rms_position_error < (0.3 if not loss else 0.8)
    assert found.delivered_rate > 0.997 * solution.delivered_rate
    during = (record.t > begin) & (record.t < begin + solution.plan.flight.duration)
    np.testing.assert_allclose(heights(record)[during], 6, atol=0.2)
    sent: list[Any] = [*filter(is_setpoint, scene.client.sent)]
    steps = np.diff([each.time_boot_ms for each in sent])
    assert steps.min() >= 80
    assert loss or steps.max() <= 120
    assert {each.type_mask for each in sent} == {3072}
    assert scene.client.wrong == []


def test_only_copters_are_flown_by_setpoints() -> None:
    peer = peer_of("ardupilot")
    plane = Peer(peer.own, peer.address, vehicle_type("ardupilot", "plane"))
    with pytest.raises(InputError, match="only copters"):
        Stream(
            Clearance(Flight(a_mission(5), solution=planned("low")), plane, Held({}, Reading({})))
        )


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
    assert apart <= 0.0075 * np.linalg.norm(there) + 1e-4  # each has another Earth


def test_what_others_asked_tells_nothing_of_the_link() -> None:
    clock = OwnClock()
    for now in (1.0, 2.0, 3.0):
        own = clock.ask(now).ts1
        clock.hear(messages.Timesync(int(2e9 * now), own), now + 0.1)
        clock.hear(
            messages.Timesync(int(2e9 * now), own - 500_000_000), now + 0.2
        )  # another station's
    assert clock.speed == pytest.approx(2.0)
    assert clock.lead == pytest.approx(0.2)


def test_a_pilot_who_sets_the_failsafes_own_mode_while_it_is_silent_has_it() -> None:
    """It was in that mode for want of setpoints before: the last that was heard is a failsafe."""
    happens = "44-48.5 loses setpoints; 47-50 silence; 48 hold; 70 land"
    scene = staged("swift", "px4", {"COM_OBL_RC_ACT": "5"}, happens)
    modes = messages.Heartbeat | messages.CurrentMode
    # These come after positions, when the link is back.
    scene.tells(lambda message, now: [message][isinstance(message, modes) and 50.0 <= now < 51.0 :])
    assert scene.run() == "taken over"
    assert any("it is in its failsafe" in text for text in scene.watch.seen.told)
    assert scene.after(50.0) == 0


def test_the_finish_is_asked_for_until_its_failsafe_is_over() -> None:
    """The link breaks as setpoints end, and PX4 goes into its failsafe: it lands all the same."""
    scene = Scene("px4", solution=under({}), parameters={"COM_OBL_RC_ACT": 5})
    watch = scene.watch
    scene.loses(lambda _: watch.phase == "ending", end=60.0)
    assert scene.run() == "finished"
    assert scene.watch.seen.fixes[-1].t > 60.0
    assert not scene.mock.armed
