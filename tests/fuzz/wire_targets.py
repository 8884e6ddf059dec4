"""Both ends of a link, as fuzzers see them: a client and mock autopilots.

What one end hears is a tape: its datagrams one after the other, before each its length in two
bytes, big-endian.
"""

import json
import math
import struct
from collections.abc import Iterable, Iterator, Sequence
from random import Random
from typing import Any

from harness import Target
from mutate import changed, damaged
from pymavlink.dialects.v20 import common
from pymavlink.generator.mavcrc import x25crc
from simulate import Station, simulate
from stations import FENCE, HOME, KINDS, RALLY, VEHICLE, a_mission, peer_of

from faao_mav.cli.vehicle import as_dict
from faao_mav.errors import FaaoError
from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.formats import render_files
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire import messages
from faao_mav.wire.codec import Codec, message_id
from faao_mav.wire.discover import FoundVehicle, choose, discover
from faao_mav.wire.jobs import UploadReport, explain, read_held, upload_parts
from faao_mav.wire.machine import Machine, Script, Talk, ask_alive, ask_for
from faao_mav.wire.protocol import GROUND_STATION, HOME_POSITION, MavCommand, MissionType
from faao_mav.wire.transfer import Peer
from faao_mav.wire.wire_items import mission_of, wire_items

_HEADER = 10
"""Bytes of a MAVLink 2 packet before its payload."""

_NUMBERS = (math.nan, math.inf, -math.inf, 3e38, -1.0, 1e-30, 3.0, 65_536.0, 2.0**31, 90.5)
_ODD = (
    *(struct.pack("<f", number) for number in _NUMBERS),
    *(struct.pack("<i", number) for number in (0, -1, 2**31 - 1, -(2**31), 2_000_000_000)),
    *(struct.pack("<h", number) for number in (0, -1, 1, 2**15 - 1)),
    *(b"\x00", b"\x01", b"\xff", b"\xfe", b"\x1b[2J", b"\r\n"),
)
"""What stands in place of some bytes of a payload: limits of its numbers, and odd characters."""

_STEP = 0.002
"""Seconds from one datagram to the next; chosen: shorter than a client waits for an answer."""


def datagrams(tape: bytes) -> Iterator[bytes]:
    """Return the datagrams on `tape`; the last may be cut short."""
    while tape:
        size = int.from_bytes(tape[:2], "big")
        yield tape[2 : 2 + size]
        tape = tape[2 + size :]


def tape_of(packets: Sequence[bytes]) -> bytes:
    return b"".join(len(packet).to_bytes(2, "big") + packet for packet in packets)


def converse(machine: Machine[Any], codec: Codec, heard: Iterator[bytes], now: float) -> float:
    """Run `machine` on what is `heard`, then on silence, to its end; return the time of that, s.

    Raises `AssertionError` if it does not end.
    """
    end = now + 3600
    packed(codec, machine.start(now))
    while machine.outcome is None:
        datagram, now = next(heard, None), now + _STEP
        if datagram is None:
            now = max(now, machine.deadline or 0.0)
        tell(machine, codec, datagram or b"", now)
        assert now < end, f"no end: {machine}"
    return now


def tell(machine: Machine[Any], codec: Codec, datagram: bytes, now: float) -> None:
    """Tell `machine` the packets in a datagram and the time, and make packets of what it says."""
    for heard in codec.parse(datagram):
        if heard.envelope is not None:
            packed(codec, machine.on(heard.envelope, now))
    packed(codec, machine.tick(now))


def packed(codec: Codec, said: Iterable[Any]) -> list[bytes]:
    return [codec.pack(message) for message in said]


def mutated(tape: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Return `tape` after one to four changes of its datagrams; some come from the `others` too."""
    found = list(datagrams(tape))
    changed(found, list(datagrams(random.choice(others))), random, _odd)
    return tape_of(found)


def _odd(packet: bytes, random: Random) -> bytes:
    """Return noise, or `packet` damaged, or with a lie in it under a right checksum."""
    start = random.choice((b"", b"\xfd", b"\xfe", b"\xfd\xff\x00", b"\xfd\x09\x01"))
    noise = start + random.randbytes(random.choice((0, 5, 40, 300)))
    lie = _lied(packet, random)
    return random.choice((lie, lie, lie, damaged(packet, random), noise)) if packet else noise


def _lied(packet: bytes, random: Random) -> bytes:
    kind = common.mavlink_map.get(message_id(packet) if len(packet) > _HEADER else None)
    if kind is None or packet[0] != 0xFD:
        return packet
    content = bytearray(packet[_HEADER : _HEADER + packet[1]].ljust(kind.unpacker.size, b"\0"))
    for _ in range(random.choice((1, 1, 3))):
        odd, start = random.choice(_ODD), random.randrange(len(content))
        start -= start % len(odd) if random.random() < 0.8 else 0  # as fields are aligned
        content[start : start + len(odd)] = odd[: len(content) - start]
    header = bytearray(packet[:_HEADER])
    if random.random() < 0.1:
        header[random.choice((5, 6))] = random.choice((0, 1, 2, 255))
    header[1] = len(content)
    checksum: int = x25crc(bytes(header[1:] + content + bytes([kind.crc_extra]))).crc
    return bytes(header + content) + checksum.to_bytes(2, "little")


_ITEMS = (*a_mission(4).items[:3], MissionItem(178, 2, (1.0, 4.0, -1.0, 0.0)),
          MissionItem(177, 2, (2.0, 1.0, 0.0, 0.0)), MissionItem(20, 2))  # fmt: skip
_MISSION = Mission(_ITEMS, HOME, FENCE, RALLY)
"""What is uploaded: some of each list."""

_COMMANDS = (
    messages.SetMode(1, 1, 0),
    messages.ParamRequestRead(VEHICLE, "WPNAV_SPEED", -1),
    messages.ParamSet(VEHICLE, "WPNAV_SPEED", 500.0, 9),
    messages.CommandLong(VEHICLE, MavCommand.SET_MODE, 0, 1.0, 4.0, 4.0),
    messages.CommandLong(VEHICLE, MavCommand.REQUEST_MESSAGE, 0, 148.0),
    messages.CommandLong(VEHICLE, MavCommand.REBOOT, 0, 1.0),
    messages.Timesync(0, 1),
)
"""What ground stations say beside the mission protocol."""


def wire_targets() -> dict[str, Target]:
    """Return the targets by name."""
    heard = {kind: _session(kind) for kind in KINDS}
    found = [Target("client", _hear, [tapes[0] for tapes in heard.values()], mutated)]
    station = Codec(GROUND_STATION)
    for kind, (_, session) in heard.items():
        tape = session + tape_of(packed(station, _COMMANDS))

        def serve(content: bytes, kind: MockKind = kind) -> object:
            return _serve(kind, content)

        found.append(Target(f"mock_{kind}", serve, [tape], mutated))
    return {target.name: target for target in found}


def _mock(kind: MockKind) -> MockAutopilot:
    return MockAutopilot(behaviour_of(kind), home=HOME, speedup=50.0)


def _jobs(peer: Peer) -> Iterator[Machine[Any]]:
    """Return all that a client does once it has found a vehicle."""
    lists = [(part, wire_items(_MISSION, part, peer.vehicle)) for part in MissionType]
    yield Script(upload_parts(lists, peer))
    yield Script(read_held(peer, parameters=False))
    yield Script(_asks(peer))
    yield Script(upload_parts([(MissionType.FENCE, ()), (MissionType.RALLY, ())], peer))


def _asks(peer: Peer) -> Talk[list[object]]:
    alive = yield from ask_alive(peer.address, 1)
    return [alive, (yield from ask_for(peer.address, HOME_POSITION, messages.HomePosition))]


def _session(kind: MockKind) -> tuple[bytes, bytes]:
    """Return what the client and a mock hear of each other from the heartbeat to the clearing."""
    mock, tapes = _mock(kind), (list[bytes](), list[bytes]())
    for job in (Script(discover(1)), *_jobs(peer_of(kind))):
        faults = Faults(latency=0.002)
        simulate(Station(job, GROUND_STATION), Station(mock, VEHICLE), faults, tapes=tapes)
    return tape_of(tapes[0]), tape_of(tapes[1])


def _hear(tape: bytes) -> object:
    """Do all that a client does with a vehicle that says what is on `tape`, and tell of it."""
    codec, heard = Codec(GROUND_STATION), datagrams(tape)
    discovery = Script(discover(1, patience=1.0))
    now = converse(discovery, codec, heard, 0.0)
    assert discovery.outcome is not None
    found = choose(discovery.outcome, "tape", None, None, 1.0)
    peer = Peer(GROUND_STATION, found.address, found.vehicle)
    verdicts: list[str] = []
    refusals: list[FaaoError] = []
    for job in _jobs(peer):
        now = converse(job, codec, heard, now)
        try:
            verdicts += _told(job, peer, found)
        except FaaoError as error:
            refusals.append(error)
    if refusals:
        raise refusals[0]
    return verdicts


def _told(job: Machine[Any], peer: Peer, found: FoundVehicle) -> list[str]:
    """Say what became of `job`, and return the verdicts on its lists."""
    outcome = job.outcome
    if isinstance(outcome, tuple) and outcome and isinstance(outcome[0], dict):
        mission = mission_of(outcome[0], peer.vehicle)
        for ending in (".waypoints", ".plan", ".kml"):
            render_files(mission, f"m{ending}")
    elif isinstance(outcome, tuple):
        problems = tuple(explain(each, peer, _MISSION) for each in outcome if not each.verified)
        report = UploadReport(found, outcome, 1.0, problems)
        assert str(report).replace("\n", "").isprintable(), report
        json.dumps(as_dict(report), allow_nan=False)
        return [each.verdict for each in outcome]
    return []


def _serve(kind: MockKind, tape: bytes) -> object:
    """Tell a mock what is on `tape`, start it whatever it holds, and ask it for everything."""
    mock, vehicle, station = _mock(kind), Codec(VEHICLE), Codec(GROUND_STATION)
    packed(vehicle, mock.start(0.0))
    asked = [
        messages.CommandLong(VEHICLE, MavCommand.ARM, 0, 1.0),
        messages.CommandLong(VEHICLE, MavCommand.START, 0),
        *(messages.MissionRequestList(VEHICLE, part) for part in MissionType),
        *(messages.MissionRequestInt(VEHICLE, part, 0) for part in MissionType),
    ]
    heard = [*datagrams(tape), *packed(station, asked)]
    for number, datagram in enumerate(heard, start=1):
        tell(mock, vehicle, datagram, 0.01 * number)
    for later in (1.0, 10.0, 100.0, 1e4):
        tell(mock, vehicle, b"", 0.01 * len(heard) + later)
    assert math.isfinite(mock.deadline)
    return mock.lists
