"""Packets out of datagrams and streams, whoever else sends on the same port."""

import socket
import time
from collections.abc import Iterator
from contextlib import closing

import pytest
from conftest import free_port
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common
from stations import VEHICLE

from faao_mav.wire.codec import Codec, Framer, message_id, sender_of
from faao_mav.wire.messages import Heartbeat, Message, Statustext
from faao_mav.wire.transport import Transport, open_transport

BEAT = Heartbeat(2, 12, 0, 0, 3)
LONG = Statustext(6, "x" * 50)


def packet_of(message: Message = BEAT) -> bytes:
    return Codec(VEHICLE).pack(message)


def old_packet() -> bytes:
    """Return a MAVLink 1 packet."""
    packet = common.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)
    return bytes(packet.pack(common.MAVLink(None, 1, 1), force_mavlink1=True))


class Port:
    """A listening transport, and sockets that send to it."""

    def __init__(self, kind: int = socket.SOCK_DGRAM) -> None:
        self.address = ("127.0.0.1", free_port(kind))
        scheme = "udpin" if kind == socket.SOCK_DGRAM else "tcpin"
        self.transport: Transport = open_transport(f"{scheme}:127.0.0.1:{self.address[1]}")
        self._kind, self._peers = kind, list[socket.socket]()

    def peer(self) -> socket.socket:
        peer = socket.socket(socket.AF_INET, self._kind)
        self._peers.append(peer)
        peer.connect(self.address)
        peer.settimeout(5.0)
        return peer

    def received(self) -> list[bytes]:
        """Return what arrives until a twentieth of a second is quiet."""
        found = list[bytes]()
        while more := self.transport.read(0.05):
            found += [packet for packet, _ in more]
        return found

    def close(self) -> None:
        for peer in self._peers:
            peer.close()
        self.transport.close()


@pytest.fixture
def udp() -> Iterator[Port]:
    with closing(Port()) as port:
        yield port


@pytest.fixture
def tcp() -> Iterator[Port]:
    with closing(Port(socket.SOCK_STREAM)) as port:
        yield port


def test_datagrams_hold_packets_that_are_cut_anywhere(udp: Port) -> None:
    """One that was cut off does not swallow the next; senders do not complete each other."""
    whole, one, other = packet_of(LONG), udp.peer(), udp.peer()
    for data in (whole[:-9], packet_of(), whole[:2], packet_of()):
        one.send(data)
    assert udp.received() == [packet_of()] * 2
    one.send(whole[:20])
    other.send(packet_of())
    other.send(whole[20:])
    assert udp.received() == [packet_of()]
    one.send(whole[20:])
    assert udp.received() == [whole]
    stream = b"".join(map(packet_of, (LONG, BEAT, LONG)))
    for start in range(0, len(stream), 17):  # as a bridge to a serial line does
        one.send(stream[start : start + 17])
    assert udp.received() == [whole, packet_of(), whole]


def test_who_sends_without_end_is_read_a_burst_at_a_time(
    udp: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("faao_mav.wire.transport._BURST", 10)
    peer = udp.peer()
    for _ in range(25):
        peer.send(packet_of())
    assert [len(udp.transport.read(0.05)) for _ in range(3)] == [10, 10, 5]


def test_of_too_many_tcp_clients_the_first_are_served(tcp: Port) -> None:
    """`select` knows no file descriptor above 1023: a thousand clients would end a mock."""
    peers = []
    for _ in range(100):
        peers.append(tcp.peer())
        tcp.transport.read(0.05)
    for peer in peers[64:]:
        assert peer.recv(9) == b""
    for peer in peers[:64]:
        peer.send(packet_of())
    assert tcp.received() == [packet_of()] * 64


def test_a_tcp_client_that_does_not_read_is_dropped(tcp: Port) -> None:
    idle, busy = tcp.peer(), tcp.peer()
    idle.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    for _ in range(2):
        tcp.transport.read(0.05)
    for _ in range(4000):
        tcp.transport.write(bytes(2000))
        busy.recv(1 << 20)
    busy.send(packet_of())
    assert tcp.received() == [packet_of()]


def test_who_is_silent_for_half_a_minute_is_sent_nothing_more(
    udp: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = udp.peer(), udp.peer()
    for now, peer in ((0.0, one), (20.0, other)):
        monkeypatch.setattr(time, "monotonic", lambda now=now: now)
        peer.send(packet_of())
        udp.transport.read(1.0)
    for now, heard in ((29.0, (one, other)), (31.0, (other,)), (51.0, ())):
        monkeypatch.setattr(time, "monotonic", lambda now=now: now)
        udp.transport.write(b"all")
        udp.transport.write(b"you", "{}:{}".format(*one.getsockname()))
        for peer in (one, other):
            expected = [b"all"] * (peer in heard) + [b"you"] * (peer is one)
            assert [peer.recv(9) for _ in expected] == expected


@given(st.lists(st.sampled_from([packet_of(), packet_of(LONG), old_packet(), b"noise"])), st.data())
def test_packets_come_out_however_a_stream_is_cut(parts: list[bytes], data: st.DataObject) -> None:
    stream, framer, found = b"".join(parts), Framer(), list[bytes]()
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        found += framer.feed(stream[:size])
        stream = stream[size:]
    assert found == [part for part in parts if part != b"noise"]
    assert {(message_id(packet), sender_of(packet)) for packet in found} <= {
        (0, VEHICLE),
        (253, VEHICLE),
    }
