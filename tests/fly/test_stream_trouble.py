"""Streams in trouble: no setpoint beyond the gate, and every end has its name."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from scenes import METRE, AnotherStation, Scene, during, starts
from simulate import Station
from stations import FOREIGN, HOME, a_mission, vehicle_of
from test_gate import CAP, swift
from test_stream import HOLD, KINDS, LAND, LOITER, is_setpoint, low, setpoints, under

from faao_mav.arrays import Real
from faao_mav.fly.gate import LEVEL, NEAR
from faao_mav.mission import Mission, MissionItem
from faao_mav.optimizer.solution import Solution
from faao_mav.sim.faults import Faults
from faao_mav.wire.messages import (
    CurrentMode,
    GlobalPositionInt,
    Heartbeat,
    Message,
    SetPositionTargetLocalNed,
)
from faao_mav.wire.protocol import MavCommand


@dataclass
class Flown:
    """A streamed flight on the mock, and what it was sent: times, where to, and where it was."""

    scene: Scene
    times: list[float] = field(default_factory=list)
    sent: list[Real] = field(default_factory=list)
    places: list[Real] = field(default_factory=list)

    @classmethod
    def of(cls, kind: str, solution: Solution, **options: Any) -> "Flown":
        flown = cls(Scene(kind, solution=solution, **options))
        flight = flown.scene.mock.flight
        hear = flight.hear

        def heard(message: SetPositionTargetLocalNed, now: float) -> bool:
            if flight.armed:
                flown.times.append(now)
                flown.sent.append(flight.aim(message)[0])
                flown.places.append(flight.aircraft.at(now).position)
            return bool(hear(message, now))

        flight.hear = heard
        return flown

    @property
    def off(self) -> Real:
        """How far it was sent each time, (k, 3) m."""
        return np.array(self.sent) - np.array(self.places)

    def assert_gated(self, lag: float = 0.0) -> None:
        """Check that it was never sent farther than the gate lets it, and within its fence.

        `lag` is how far it flies, m, while a position and its answer are on the link.
        """
        across = np.hypot(*self.off[:, :2].T)
        assert across.max() <= CAP + lag
        assert np.abs(self.off[:, 2]).max() <= LEVEL + 2.0 + lag
        area = self.scene.watch.flight._plan.keep_in
        for place, to, far in zip(self.places, self.sent, across, strict=True):
            if area is not None and far > NEAR + lag:
                assert area.covers_path(np.array([place[:2], to[:2]]))

    def assert_arrived(self) -> None:
        """Check that it has flown to the end of its plan."""
        last = self.scene.watch.seen.record().line(swift()).w[-1]
        assert np.linalg.norm(last - swift().w[-1]) < 1.0

    def after(self, time: float) -> int:
        """Return how many setpoints it was sent after `time`, s."""
        return sum(each > time for each in self.times)


# ---- after a failsafe


def test_after_px4s_landing_failsafe_it_climbs_before_it_goes_on() -> None:
    flown = Flown.of("px4", swift(), parameters={"COM_OBL_RC_ACT": 4})
    heights = list[float]()
    events = [(57.5, lambda _: heights.append(flown.scene.mock.posture(57.5).position[2]))]
    assert flown.scene.run(Faults(outages=((46.0, 57.4),)), events=events) == "finished"
    assert 1.0 < heights[0] < 20.0
    assert flown.scene.told("it is in its failsafe")
    assert flown.scene.told("off its flight, and led back to it")
    flown.assert_gated()
    places, off = np.array(flown.places), flown.off
    climbs = (np.array(flown.times) > 57.4) & (places[:, 2] < 26.0)
    assert climbs.sum() > 50
    assert np.hypot(*off[climbs, :2].T).max() < 0.5
    flown.assert_arrived()


def test_an_aircraft_that_its_failsafe_has_landed_is_not_taken_off_again() -> None:
    flown = Flown.of("px4", swift(), parameters={"COM_OBL_RC_ACT": 4})
    mock = flown.scene.mock
    mock.flight.aircraft.landed = lambda _: False  # it does not disarm
    assert flown.scene.run(Faults(outages=((46.0, 90.0),)), until=120.0) == ""
    assert flown.scene.told("setpoints end: it has come down to the ground")
    assert flown.scene.watch.phase == "aside"
    assert flown.after(90.0) == 0


@pytest.mark.parametrize(("kind", "action"), [("ardupilot", 0), ("px4", 3), ("px4", 5)])
@pytest.mark.parametrize("outage", [(42.0, 45.0), (44.0, 52.0), (40.0, 60.0)])
def test_after_a_silence_it_goes_on_inside_the_fence(
    kind: str, action: int, outage: tuple[float, float]
) -> None:
    flown = Flown.of(kind, swift(fenced=True), parameters={"COM_OBL_RC_ACT": action})
    assert flown.scene.run(Faults(outages=(outage,))) == "finished"
    flown.assert_gated()
    assert flown.after(outage[1]) > 50
    flown.assert_arrived()


def test_where_no_way_leads_back_it_is_left_to_its_failsafe() -> None:
    """Its way home, by its failsafe, leads over the zone; there it is heard again."""
    flown = Flown.of("px4", swift(fenced=True), parameters={"COM_OBL_RC_ACT": 3})
    mock, solution = flown.scene.mock, swift(fenced=True)
    area = solution.plan.keep_in
    assert area is not None

    over = list[float]()

    def silent(message: Message, now: float) -> Sequence[Message]:
        place = mock.posture(now).position[None, :2]
        if now > 60.0 and not over and not area.covers(place).all():
            over.append(now)
        return [message] if now < 60.0 or over else []

    flown.scene.tells(silent)
    assert flown.scene.run() == "taken over"
    assert over
    assert flown.scene.told("setpoints end: no way inside the fence leads it back")
    flown.assert_gated()


def test_a_pilot_who_sets_the_failsafes_own_mode_while_it_is_silent_has_it() -> None:
    """It was in that mode for want of setpoints before: the last that was heard is a failsafe."""
    flown = Flown.of("px4", swift(), parameters={"COM_OBL_RC_ACT": 5})
    scene = flown.scene
    scene.loses(lambda message, now: is_setpoint(message) and 44.0 < now < 48.5)
    modes = Heartbeat | CurrentMode  # which come after positions, when the link is back
    scene.tells(lambda message, now: [message][isinstance(message, modes) and 50.0 <= now < 51.0 :])
    events = [(48.0, scene.sets(HOLD["px4"])), (70.0, scene.sets(LAND))]
    assert scene.run(Faults(outages=((47.0, 50.0),)), events=events) == "taken over"
    assert scene.told("it is in its failsafe")
    assert flown.after(50.0) == 0


# ---- hold


@pytest.mark.parametrize(("kind", "action"), [("ardupilot", 0), ("px4", 3), ("px4", 4)])
@pytest.mark.parametrize("silence", [20.0, 100.0])
def test_a_hold_is_asked_for_until_it_is_confirmed(kind: str, action: int, silence: float) -> None:
    """However long nothing is heard, and whatever its failsafe does meanwhile."""
    flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": action})
    scene, modes = flown.scene, list[int]()
    scene.mock.flight.aircraft.landed = lambda _: False  # it does not disarm
    end = 44.0 + silence
    events = [
        (45.0, scene.interrupt),
        (end + 5.0, lambda _: modes.append(scene.mock.mode)),
        (end + 6.0, scene.interrupt),
    ]
    assert scene.run(Faults(outages=((44.0, end),)), events=events) == "left"
    assert scene.told("does not confirm that it holds, it does not answer: it is asked again")
    assert modes == [HOLD[kind]]
    assert scene.told("it holds")
    assert scene.watch.outcome.text.startswith("no longer watched: it is armed, in mode ")
    assert "has not confirmed" not in scene.watch.outcome.text
    assert flown.after(45.0) == 0


@KINDS
def test_a_pilot_who_has_it_meanwhile_keeps_it(kind: str) -> None:
    scene, sent = Scene(kind, solution=swift(), parameters={"COM_OBL_RC_ACT": 4}), list[int]()
    events = [
        (45.0, scene.interrupt),
        (55.0, scene.sets(LOITER)),
        (66.0, lambda _: sent.append(len(scene.orders))),
        (90.0, scene.does(MavCommand.ARM, 0)),
    ]
    assert scene.run(Faults(outages=((44.0, 64.0),)), events=events) == "taken over"
    assert scene.orders[sent[0] :] == []


@KINDS
@pytest.mark.parametrize("streams", [True, False])
def test_who_leaves_an_unconfirmed_hold_is_told_what_is_left(kind: str, streams: bool) -> None:
    scene = Scene(kind, solution=swift()) if streams else Scene(kind, arm=True)
    events = [(45.0, scene.interrupt), (60.0, scene.interrupt)]
    assert scene.run(Faults(outages=((44.0, 1e9),)), events=events) == "left"
    text = scene.watch.outcome.text
    assert "it is armed, in mode " in text
    assert " 16 s ago" in text
    assert text.endswith("has not confirmed that it holds")


@KINDS
def test_a_mission_too_is_held_when_the_link_is_back(kind: str) -> None:
    far = MissionItem(16, 3, x=HOME.latitude + 0.01, y=HOME.longitude, z=30.0)  # 111 s away
    mission = Mission((a_mission(3).items[0], far, MissionItem(20, 2)), HOME)
    scene, modes = Scene(kind, mission, arm=True), list[int]()
    events = [
        (8.0, scene.interrupt),
        (74.0, lambda _: modes.append(scene.mock.mode)),
        (75.0, scene.interrupt),
    ]
    assert scene.run(Faults(outages=((7.0, 70.0),)), events=events) == "left"
    assert modes == [HOLD[kind]]


@KINDS
def test_a_mission_whose_start_is_still_under_way_is_held(kind: str) -> None:
    """The answer to the start is lost, and so is the first request to hold."""
    scene, modes = Scene(kind, arm=True), list[int]()
    scene.loses(lambda message, now: starts(message) and now < 5.5)
    events = [
        (4.7, scene.interrupt),
        (5.5, scene.does(MavCommand.START)),
        (13.5, lambda _: modes.append(scene.mock.mode)),
        (14.0, scene.interrupt),
    ]
    assert scene.run(events=events) == "left"
    assert scene.told("asking the vehicle to hold")
    assert modes == [HOLD[kind]]


def test_a_landing_that_is_not_confirmed_is_interrupted_by_a_hold() -> None:
    scene, modes = Scene("ardupilot", solution=low()), list[int]()
    lands = 9
    scene.loses(lambda message, _: getattr(message, "param2", None) == lands)
    events = [
        (45.0, scene.interrupt),
        (50.0, lambda _: modes.append(scene.mock.mode)),
        (51.0, scene.interrupt),
    ]
    assert scene.run(events=events) == "left"
    assert scene.told("the relay flight is over")
    assert modes == [HOLD["ardupilot"]]


# ---- what the vehicle does without setpoints


@pytest.mark.parametrize(
    ("kind", "parameters", "told"),
    [
        ("px4", {"COM_OBL_RC_ACT": 6}, "without setpoints it terminates the flight (COM_OBL_RC_"),
        ("px4", {"COM_OBL_RC_ACT": 7}, "it stops its motors (COM_OBL_RC_ACT 7)"),
        ("px4", {"COM_OBL_RC_ACT": 8}, "it does what is not known here (COM_OBL_RC_ACT 8)"),
        ("px4", {"COM_OBL_RC_ACT": -1}, "it does what is not known here (COM_OBL_RC_ACT -1)"),
        ("px4", {"COM_OF_LOSS_T": 0}, "it acts after 0 s (COM_OF_LOSS_T) (set COM_OF_LOSS_T to 0."),
        ("px4", {"COM_OF_LOSS_T": 61}, "it acts after 61 s (COM_OF_LOSS_T)"),
        ("ardupilot", {"GUID_TIMEOUT": 3}, "after 3 s (GUID_TIMEOUT), and until then flies on"),
        ("ardupilot", {"GUID_TIMEOUT": 1.01}, "(set GUID_TIMEOUT to 0.5 to 1 s)"),
        ("ardupilot", {"GUID_TIMEOUT": 0}, "after 0 s (GUID_TIMEOUT)"),
    ],
)
def test_it_does_not_stream_to_what_would_not_be_safe_without(
    kind: str, parameters: dict[str, float], told: str
) -> None:
    scene = Scene(kind, solution=low(), parameters=parameters)
    assert scene.run() == "refused"
    assert told in scene.watch.outcome.text
    assert scene.orders == []


@KINDS
def test_nor_to_one_that_does_not_tell_or_tells_no_number(kind: str) -> None:
    vehicle = vehicle_of(kind)
    assert vehicle is not None
    rules = vehicle.family.setpoints
    scene = Scene(kind, solution=low(), untold=rules.defaults)
    assert scene.run() == "refused"
    assert f"it does not tell {' and '.join(rules.defaults)}" in scene.watch.outcome.text
    assert scene.orders == []
    values = rules.defaults | {rules.timeout: 1.0}
    assert rules.refusal(values) is None
    for value in (math.nan, 2.5):
        assert rules.refusal(values | {rules.loss or rules.timeout: value}) is not None


# ---- what it tells


@KINDS
@pytest.mark.parametrize("risen", [50.0, -50.0])
def test_a_home_that_is_set_anew_in_flight_moves_no_setpoint(kind: str, risen: float) -> None:
    flown = Flown.of(kind, low())
    begin, more = 14.0, int(1000 * risen)
    flown.scene.tells(
        during(begin, 1e9, lambda each: replace(each, relative_alt=each.relative_alt - more))
    )
    assert flown.scene.run() == "finished"
    assert flown.scene.told(f"home is {risen:+.0f} m higher now")
    flown.assert_gated()
    late = np.array(flown.times) > begin
    assert np.abs(np.array(flown.sent)[late, 2] - 6.0).max() < 0.2


@KINDS
def test_a_place_that_jumps_is_not_answered_and_ends_the_flight_if_it_stays(kind: str) -> None:
    def jumps(position: GlobalPositionInt) -> GlobalPositionInt:
        return replace(position, lat=position.lat + int(100 * METRE))

    flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": 5})
    flown.scene.tells(during(44.0, 46.0, jumps))
    assert flown.scene.run() == "finished"
    assert flown.scene.told("its place has jumped")
    assert flown.scene.told("its place is believed again")
    flown.assert_gated()
    assert not any(44.1 < each < 46.0 for each in flown.times)

    first = list[GlobalPositionInt]()

    def stuck(position: GlobalPositionInt) -> GlobalPositionInt:
        first.append(position)
        return replace(first[0], time_boot_ms=position.time_boot_ms)

    for change, told in ((jumps, "has jumped"), (stuck, "does not change, though it moves")):
        flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": 5})
        flown.scene.tells(during(44.0, 1e9, change))
        events = [(60.0, flown.scene.does(MavCommand.ARM, 0))]
        ending = flown.scene.run(events=events)
        assert ending == ("held" if kind == "ardupilot" else "taken over")  # by its failsafe
        assert flown.scene.told(f"its place {told}: no setpoints are sent")
        assert flown.scene.told("setpoints end: where it is, is not known")
        assert flown.scene.mock.mode == HOLD[kind]
        assert flown.after(45.2) == 0


@KINDS
def test_positions_that_come_late_at_once_are_not_answered(kind: str) -> None:
    """A link holds back all that it is given for 6 s, and then delivers it."""
    held = list[Message]()

    def bursts(message: Message, now: float) -> Sequence[Message]:
        if 44.0 <= now < 50.0:
            held.append(message)
            return ()
        out = [*held, message]
        held.clear()
        return out

    flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": 5})
    flown.scene.tells(bursts)
    assert flown.scene.run() == "finished"
    flown.assert_gated(lag=8.0)
    told = [each.time_boot_ms / 1000 for each in setpoints(flown.scene)]
    assert not any(44.1 < each < 48.9 for each in told)
    assert any(48.9 < each < 51.0 for each in told)


@KINDS
def test_where_all_positions_are_late_nothing_is_started(kind: str) -> None:
    scene = Scene(kind, solution=low())
    scene.tells(
        during(0.0, 1e9, lambda told: replace(told, time_boot_ms=max(0, told.time_boot_ms - 5000)))
    )
    assert scene.run() == "refused"
    assert "its positions come 5 s late" in scene.watch.outcome.text
    assert scene.orders == []


@KINDS
def test_positions_that_overtake_each_other_are_answered_in_order(kind: str) -> None:
    flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": 5})
    assert flown.scene.run(Faults(reordering=0.3, delay=0.8, seed=2)) == "finished"
    told = [each.time_boot_ms for each in setpoints(flown.scene)]
    assert told == sorted(told)
    flown.assert_gated(lag=8.0)


@KINDS
@pytest.mark.parametrize("leap", [12_000, 100_000])
def test_a_clock_that_leaps_ahead_leaves_the_aircraft_on_its_ways(kind: str, leap: int) -> None:
    flown = Flown.of(kind, swift(fenced=True), parameters={"COM_OBL_RC_ACT": 5})
    flown.scene.tells(
        during(44.0, 1e9, lambda each: replace(each, time_boot_ms=each.time_boot_ms + leap))
    )
    assert flown.scene.run() == "finished"
    flown.assert_gated()
    flown.assert_arrived()


@KINDS
def test_a_clock_that_goes_back_ends_it(kind: str) -> None:
    flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": 5})
    flown.scene.tells(
        during(44.0, 1e9, lambda each: replace(each, time_boot_ms=each.time_boot_ms - 5000))
    )
    assert flown.scene.run() == "rebooted"
    assert flown.after(44.1) == 0
    flown = Flown.of(kind, swift())
    assert flown.scene.run(events=[(44.0, flown.scene.mock.reboot)]) == "rebooted"
    assert flown.after(44.1) == 0


@KINDS
def test_a_ground_station_that_appears_in_flight_is_told_and_changes_nothing(kind: str) -> None:
    flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": 5})
    others = [Station(AnotherStation(since=40.0), FOREIGN)]
    assert flown.scene.run(Faults(outages=((44.0, 48.0),)), others=others) == "finished"
    assert flown.scene.told("another ground station is on this link")
    flown.assert_gated()


@KINDS
def test_an_aircraft_that_does_not_follow_is_asked_to_hold(kind: str) -> None:
    """It hears orders, but its setpoints are lost from the middle of the flight on."""
    flown = Flown.of(kind, swift(), parameters={"COM_OBL_RC_ACT": 5})
    flown.scene.loses(lambda message, now: is_setpoint(message) and now > 44.0)
    events = [(400.0, flown.scene.does(MavCommand.ARM, 0))]
    ending = flown.scene.run(events=events, until=500.0)
    assert ending == ("held" if kind == "ardupilot" else "taken over")
    assert flown.scene.told("setpoints end: it does not follow")


def test_positions_that_cease_end_the_setpoints_by_a_hold() -> None:
    flown = Flown.of("ardupilot", swift())
    flown.scene.tells(
        lambda message, now: [message][isinstance(message, GlobalPositionInt) and now > 44.0 :]
    )
    events = [(130.0, flown.scene.does(MavCommand.ARM, 0))]
    assert flown.scene.run(events=events) == "held"
    assert flown.scene.told("setpoints end: for too long no setpoint could be sent")
    assert flown.scene.mock.mode == HOLD["ardupilot"]


def test_the_finish_is_asked_for_until_its_failsafe_is_over() -> None:
    """The link breaks as setpoints end, and PX4 goes into its failsafe: it lands all the same."""
    flown = Flown.of("px4", under({}), parameters={"COM_OBL_RC_ACT": 5})
    watch = flown.scene.watch
    flown.scene.loses(lambda _, now: now < 60.0 and watch.phase == "ending")
    assert flown.scene.run() == "finished"
    assert flown.scene.watch.seen.fixes[-1].t > 60.0
    assert not flown.scene.mock.armed
