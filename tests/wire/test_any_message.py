"""No packet brings a machine down: whatever is sent, every answer fits into a packet."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mock_flights import fly
from stations import HOME, KINDS, VEHICLE, a_mission, peer_of, rows_for, vehicle_of

from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.wire import messages
from faao_mav.wire.codec import Codec
from faao_mav.wire.discover import Discovery
from faao_mav.wire.protocol import GROUND_STATION, Address, MissionType
from faao_mav.wire.transfer.download import Download
from faao_mav.wire.transfer.upload import Upload
from faao_mav.wire.wire_items import wire_items

bytes_ = st.integers(0, 255)
shorts = st.one_of(st.integers(0, 5), st.integers(0, 65_535))
ints = st.integers(-(2**31), 2**31 - 1)
floats = st.floats(width=32)
to_vehicle = st.builds(Address, st.sampled_from([0, 1]), st.sampled_from([0, 1, 190]))
to_station = st.just(GROUND_STATION)
commands = st.one_of(
    shorts, st.sampled_from([16, 20, 22, 177, 178, 5000, 5001, 5003, 5100, 176, 300, 400, 512])
)
frames = st.one_of(st.integers(0, 11), bytes_)
types = st.one_of(st.integers(0, 2), bytes_)
items = st.builds(
    messages.WireItem,
    commands,
    frames,
    st.tuples(floats, floats, floats, floats),
    ints,
    ints,
    floats,
    bytes_,
    bytes_,
)


def anything(target: st.SearchStrategy[Address]) -> st.SearchStrategy[messages.Message]:
    """Return a strategy for messages to `target`."""
    return st.one_of(
        st.builds(messages.MissionCount, target, types, shorts, st.integers(0, 2**32 - 1)),
        st.builds(messages.MissionItemInt, target, types, shorts, items),
        st.builds(messages.MissionRequestInt, target, types, shorts, st.booleans()),
        st.builds(messages.MissionAck, target, types, st.one_of(st.integers(0, 15), bytes_)),
        st.builds(messages.MissionRequestList, target, types),
        st.builds(messages.MissionClearAll, target, types),
        st.builds(messages.MissionSetCurrent, target, shorts),
        st.builds(messages.CommandLong, target, commands, bytes_, *[floats] * 7),
        st.builds(messages.SetMode, st.integers(0, 1), bytes_, st.integers(0, 2**32 - 1)),
        st.builds(messages.ParamRequestRead, target, st.just("x"), st.integers(-2, 99)),
        st.builds(messages.Heartbeat, bytes_, bytes_, bytes_, st.integers(0, 9), bytes_),
        st.builds(messages.Statustext, bytes_, st.text(max_size=50)),
    )


def converse(
    machine: Any, address: Address, partner: Address, said: list[messages.Message]
) -> list[bytes]:
    """Tell `machine` all of `said`, a second apart, by way of real packets."""
    here, there = Codec(address), Codec(partner)
    out = [here.pack(message) for message in machine.start(0.0)]
    for now, message in enumerate(said, start=1):
        for packet in here.parse(there.pack(message)):
            out += [here.pack(answer) for answer in machine.on(packet.envelope, float(now))]
        out += [here.pack(answer) for answer in machine.tick(now + 0.5)]
    return out


@settings(max_examples=150)
@given(st.sampled_from(KINDS), st.lists(anything(to_vehicle), max_size=30))
def test_the_mock_bears_everything(kind: MockKind, said: list[messages.Message]) -> None:
    mock = MockAutopilot(behaviour_of(kind), home=HOME, fly=fly)
    firmware = mock.vehicle.family.key
    mock.lists.replace(
        MissionType.MISSION, wire_items(a_mission(4), MissionType.MISSION, vehicle_of(firmware))
    )
    assert converse(mock, VEHICLE, GROUND_STATION, said)


@pytest.mark.parametrize("firmware", ["ardupilot", "px4", "generic"])
@settings(max_examples=60)
@given(st.lists(anything(to_station), max_size=30))
def test_the_client_bears_everything(firmware: str, said: list[messages.Message]) -> None:
    peer = peer_of(firmware)
    for machine in (Upload(rows_for(firmware, 3), peer), Download(peer), Discovery()):
        converse(machine, GROUND_STATION, VEHICLE, said)


@given(st.binary(max_size=300))
def test_the_codec_bears_noise(data: bytes) -> None:
    codec = Codec(GROUND_STATION)
    codec.parse(data)
    codec.parse(b"\xfd" + data)
