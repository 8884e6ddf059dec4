"""Parameters over the wire: read whatever the link loses, set as the vehicle takes them."""

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulate import Station, simulate
from stations import VEHICLE, Desk, mock_of, peer_of

from faao_mav.autopilot import ARDUCOPTER, PX4_COPTER
from faao_mav.sim import MockAutopilot, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire.machine import Script, Talk
from faao_mav.wire.messages import Envelope, ParamSet, ParamValue
from faao_mav.wire.parameters import (
    Change,
    Names,
    carried,
    read_parameters,
    same_value,
    set_parameters,
    value_in,
)
from faao_mav.wire.protocol import GROUND_STATION, Address

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
INT32, REAL32 = 6, 9


def ran(talk: Talk[Any], mock: MockAutopilot, faults: Faults | None = None) -> tuple[Any, float]:
    """Run `talk` beside `mock`, and return the outcome and the seconds that it took."""
    script = Script(talk)
    took = simulate(Station(script, GROUND_STATION), Station(mock, VEHICLE), faults)
    return script.outcome, took


def groups_of(mock: MockAutopilot) -> tuple[Names, ...]:
    names = [tuple(each.names) for each in mock.vehicle.parameters.values()]
    return *names, *((name,) for each in mock.vehicle.failsafes for name in each.defaults)


@KINDS
def test_all_are_read_whatever_is_lost(kind: str) -> None:
    lossy = [Faults(loss=0.2, latency=0.1, seed=seed) for seed in range(12)]
    for faults, most in ((Faults(), 2.0), *((each, 8.0) for each in lossy)):
        mock = mock_of(kind)
        groups, told = groups_of(mock), mock.parameters.values
        reading, took = ran(read_parameters(peer_of(kind), groups), mock, faults)
        assert reading.missing == ()
        assert all(same_value(value, told[name]) for name, value in reading.values.items())
        assert len(reading.values) == len(set(groups))
        assert took < most


@KINDS
def test_what_the_vehicle_does_not_know_is_named_in_time(kind: str) -> None:
    mock = mock_of(kind)
    known = groups_of(mock)
    some = [("NEWER", "OLDER"), *known, ("NO_SUCH",)]
    reading, took = ran(read_parameters(peer_of(kind), some), mock)
    assert reading.missing == (("NEWER", "OLDER"), ("NO_SUCH",))
    assert len(reading.values) == len(set(known))
    assert took < 6
    desk = Desk(Script(read_parameters(peer_of(kind), known)))
    desk.start()
    desk.tell(ParamValue(known[0][0], 0.0, INT32, 1, 0), Address(2, 1))  # of another vehicle
    desk.wait(15.0)
    assert (desk.machine.outcome.values, {*desk.machine.outcome.missing}) == ({}, {*known})


@given(st.integers(-(2**31), 2**31 - 1))
def test_whole_numbers_of_px4_are_their_bits(number: int) -> None:
    sent = carried(number, INT32, PX4_COPTER)
    assert carried(7.0, INT32, ARDUCOPTER) == 7.0
    if math.isnan(sent):  # a bit of some of these is lost on the way
        return
    assert struct.pack("<f", sent) == struct.pack("<i", number)
    assert value_in(ParamValue("X", sent, INT32, 1, 0), PX4_COPTER) == number


def test_those_of_a_mission_are_set_and_read_back() -> None:
    older = {"WPNAV_SPEED": 600.0, "WP_SPD": 6.0, "WP_ACC": 4.0, "WPNAV_JERK": 1.0}
    px4 = {"MPC_XY_CRUISE": 6.0, "MPC_ACC_HOR": 4.1, "MPC_JERK_AUTO": 4.0}
    for kind, wanted, told in (
        ("ardupilot", older, ["WPNAV_SPEED 1000 -> 600", "WPNAV_ACCEL 250 -> 400"]),
        ("px4", px4, ["MPC_XY_CRUISE 5 -> 6", "MPC_ACC_HOR 3 -> 4.1"]),
    ):
        for loss in (0.0, 0.2):
            mock = mock_of(kind)
            before, after = dict(mock.parameters.values), mock.parameters.values
            job = set_parameters(wanted, peer_of(kind))
            (changes, problem), _ = ran(job, mock, Faults(loss=loss, seed=5))
            assert problem == ""
            assert all(change.made for change in changes)
            assert [str(change) for change in changes] == told
            changed = {name for name, value in after.items() if not same_value(value, before[name])}
            assert changed == {change.name for change in changes}


def test_a_value_that_the_vehicle_does_not_keep_is_told() -> None:
    class Stubborn(MockAutopilot):
        def _receive(self, envelope: Envelope, now: float) -> Any:
            keeps = isinstance(envelope.message, ParamSet)
            return () if keeps else super()._receive(envelope, now)

    mock = Stubborn(behaviour_of("ardupilot"), rate=0.0)
    outcome, _ = ran(set_parameters({"WPNAV_SPEED": 600.0}, peer_of("ardupilot")), mock)
    assert outcome == (
        (Change("WPNAV_SPEED", 1000.0, 600.0, 1000.0),),
        "parameters: not set: WPNAV_SPEED 1000 -> 1000 (asked for 600): "
        "the mission was not uploaded",
    )
