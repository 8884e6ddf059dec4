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
from faao_mav.sim import MockAutopilot
from faao_mav.sim.faults import Faults
from faao_mav.wire.machine import Machine, Script
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


def ran(machine: Machine[Any], mock: MockAutopilot, faults: Faults | None = None) -> float:
    """Run `machine` beside `mock`, and return the seconds that it took."""
    return simulate(Station(machine, GROUND_STATION), Station(mock, VEHICLE), faults)


def groups_of(mock: MockAutopilot) -> tuple[Names, ...]:
    names = [tuple(each.names) for each in mock.vehicle.parameters.values()]
    return *names, *((name,) for each in mock.vehicle.failsafes for name in each.defaults)


@KINDS
@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_all_are_read_whatever_is_lost(kind: str, loss: float) -> None:
    mock = mock_of(kind)
    reading = Script(read_parameters(peer_of(kind), groups_of(mock)))
    took = ran(reading, mock, Faults(loss=loss, seed=3))
    assert reading.outcome is not None
    assert reading.outcome.missing == ()
    told = mock.parameters.values
    for name, value in reading.outcome.values.items():
        assert same_value(value, told[name]), name
    assert len(reading.outcome.values) == len(set(groups_of(mock)))
    assert took < (2.0 if not loss else 8.0)


@KINDS
def test_what_the_vehicle_does_not_know_is_named_in_time(kind: str) -> None:
    mock = mock_of(kind)
    known = groups_of(mock)
    reading = Script(read_parameters(peer_of(kind), [("NEWER", "OLDER"), *known, ("NO_SUCH",)]))
    took = ran(reading, mock)
    assert reading.outcome is not None
    assert reading.outcome.missing == (("NEWER", "OLDER"), ("NO_SUCH",))
    assert len(reading.outcome.values) == len(set(known))
    assert took < 6
    mock.parameters.values.clear()
    reading = Script(read_parameters(peer_of(kind), known))
    assert ran(reading, mock) < 15
    assert reading.outcome is not None
    assert not reading.outcome.values
    assert {*reading.outcome.missing} == {*known}


def test_other_vehicles_are_not_listened_to() -> None:
    desk = Desk(Script(read_parameters(peer_of("px4"), [("NAV_DLL_ACT",)])))
    desk.start()
    desk.tell(ParamValue("NAV_DLL_ACT", 0.0, INT32, 1, 0), Address(2, 1))
    desk.tell(ParamValue("NAV_RCL_ACT", 0.0, INT32, 1, 0))
    assert not desk.machine.outcome
    desk.wait(20.0)
    assert desk.machine.outcome.missing == (("NAV_DLL_ACT",),)


@given(st.integers(-(2**31), 2**31 - 1))
def test_whole_numbers_of_px4_are_their_bits(number: int) -> None:
    sent = carried(number, INT32, PX4_COPTER)
    assert carried(7.0, INT32, ARDUCOPTER) == 7.0
    if math.isnan(sent):  # a bit of some of these is lost on the way
        return
    assert struct.pack("<f", sent) == struct.pack("<i", number)
    assert value_in(ParamValue("X", sent, INT32, 1, 0), PX4_COPTER) == number


@KINDS
@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_those_of_a_mission_are_set_and_read_back(kind: str, loss: float) -> None:
    mock = mock_of(kind)
    wanted = {
        "ardupilot": {"WPNAV_SPEED": 600.0, "WP_SPD": 6.0, "WP_ACC": 4.0, "WPNAV_JERK": 1.0},
        "px4": {"MPC_XY_CRUISE": 6.0, "MPC_ACC_HOR": 4.1, "MPC_JERK_AUTO": 4.0},
    }[kind]
    before = dict(mock.parameters.values)
    job = Script(set_parameters(wanted, peer_of(kind)))
    ran(job, mock, Faults(loss=loss, seed=5))
    assert job.outcome is not None
    changes, problem = job.outcome
    assert problem == ""
    assert all(change.made for change in changes)
    assert [str(change) for change in changes] == {
        "ardupilot": ["WPNAV_SPEED 1000 -> 600", "WPNAV_ACCEL 250 -> 400"],
        "px4": ["MPC_XY_CRUISE 5 -> 6", "MPC_ACC_HOR 3 -> 4.1"],
    }[kind]
    after = mock.parameters.values
    changed = {name for name, value in after.items() if not same_value(value, before[name])}
    assert changed == {change.name for change in changes}


def test_nothing_is_set_where_one_is_not_known() -> None:
    mock = mock_of("px4")
    del mock.parameters.values["MPC_JERK_AUTO"]
    before = dict(mock.parameters.values)
    job = Script(set_parameters({"MPC_XY_CRUISE": 6.0, "MPC_JERK_AUTO": 9.0}, peer_of("px4")))
    ran(job, mock)
    assert job.outcome is not None
    assert job.outcome[0] == ()
    assert "the vehicle has no MPC_JERK_AUTO: nothing was set" in job.outcome[1]
    assert mock.parameters.values == before


def test_a_value_that_the_vehicle_does_not_keep_is_told() -> None:
    mock = mock_of("ardupilot")
    answer = mock.on

    def stubborn(envelope: Envelope, now: float) -> Any:
        keeps = isinstance(envelope.message, ParamSet)
        return () if keeps else answer(envelope, now)

    mock.on = stubborn  # type: ignore[method-assign]
    job = Script(set_parameters({"WPNAV_SPEED": 600.0}, peer_of("ardupilot")))
    ran(job, mock)
    assert job.outcome == (
        (Change("WPNAV_SPEED", 1000.0, 600.0, 1000.0),),
        "parameters: not set: WPNAV_SPEED 1000 -> 1000 (asked for 600): "
        "the mission was not uploaded",
    )


def test_px4_takes_no_other_type_than_it_has() -> None:
    desk = Desk(mock_of("px4"), GROUND_STATION)
    desk.start()
    assert desk.tell(ParamSet(VEHICLE, "GF_ACTION", 3.0, REAL32)) == []
    (bits,) = struct.unpack("<f", struct.pack("<i", 3))
    (answer,) = desk.tell(ParamSet(VEHICLE, "GF_ACTION", bits, INT32))
    assert (value_in(answer, PX4_COPTER), answer.param_type) == (3, INT32)
    assert desk.machine.parameters.values["GF_ACTION"] == 3
