"""Tapes: what one end of a link hears, datagram by datagram; how they are mutated.

A tape is the datagrams one after the other, before each its length in two bytes, big-endian.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from random import Random
from typing import Any

from mutate import changed, damaged
from pymavlink.dialects.v20 import common
from pymavlink.generator.mavcrc import x25crc

from faao_mav.wire.codec import Codec, message_id
from faao_mav.wire.machine import Machine

_HEADER = 10
"""Bytes of a MAVLink 2 packet before its payload."""

_SIGNED = 1
"""The flag of a packet with a signature, which is not written anew: only the key could."""

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

    What it sends is made into packets. Raises `AssertionError` if it does not end.
    """
    begun = now
    packed(codec, machine.start(now))
    while machine.outcome is None:
        assert now - begun < 3600, f"no end: {machine}"
        datagram = next(heard, None)
        now += _STEP
        if datagram is None:
            assert machine.deadline is not None, f"waits for ever: {machine}"
            now = max(now, machine.deadline)
        else:
            answer(machine, codec, datagram, now)
        packed(codec, machine.tick(now))
    return now


def answer(machine: Machine[Any], codec: Codec, datagram: bytes, now: float) -> list[bytes]:
    """Return the packets with which `machine` answers `datagram`."""
    return [
        packet
        for heard in codec.parse(datagram)
        if heard.envelope is not None
        for packet in packed(codec, machine.on(heard.envelope, now))
    ]


def packed(codec: Codec, messages: Sequence[Any]) -> list[bytes]:
    return [codec.pack(message) for message in messages]


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
    if kind is None or packet[0] != 0xFD or packet[2] & _SIGNED:
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
